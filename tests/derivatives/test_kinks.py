"""Kinks: weak and dependent constraints, singular systems, one-sided derivatives."""

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import QP, complementary, sparse

import namlcp
from validation.derivatives.cases import (
    KINKS,
    around,
    definite,
    direction,
    flat,
    moved,
    repeated_row,
    vertex,
    weak_bounds,
    weak_lcp,
    weak_rows,
)

EXACT = {"eps_abs": 1e-13, "eps_rel": 1e-13}


FORMS = {
    "dense": lambda qp: namlcp.solve_qp(*qp, **EXACT),
    "sparse": lambda qp: namlcp.solve_qp(*sparse(qp), **EXACT),
    "with factors": lambda qp: namlcp.solve_qp(*qp, **EXACT, derivative=True),
}


def one_sided(at, t=1e-6):
    near, far, x = at(t), at(2 * t), at(0.0)
    return (4.0 * (near - x) - (far - x)) / (2 * t)


def named(d):
    return {f"d{k}": v for k, v in d.items()}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("family", KINKS)
def test_directional_equals_the_one_sided_difference(family, form):
    """`forward` too where x is differentiable: in q and P beside dependent rows."""
    for seed in range(4):
        qp = family(seed)
        result = FORMS[form](qp)
        for names in KINKS[family]:
            d = direction(qp, seed, names)
            expected = one_sided(lambda t, d=d, qp=qp: FORMS[form](moved(qp, d, t)).x)
            found = [result.directional(**named(d))]
            if names in ("q", "P") and family in (repeated_row, vertex):
                found.append(result.forward(**named(d)))
            for tangent in found:
                np.testing.assert_allclose(tangent.x, expected, 1e-4, 1e-4)


none = np.zeros((0, 2)), np.zeros(0)
CORNERS = {
    "without any force": QP(
        np.array([[2.0, -2.0], [-2.0, 6.0]]), np.zeros(2),
        np.array([[1.0, -1.0], [0.0, -2.0]]), np.zeros(2), *none,
        np.array([0.0, -1.0]), np.ones(2),
    ),
    "held twice": QP(
        np.array([[5.0, -5.0], [-5.0, 5.0]]), np.array([5.0, -7.0]),
        np.array([[2.0, -1.0], [0.0, 2.0], [-2.0, -1.0], [1.0, -1.0]]),
        np.array([0.0, 2.0, -1.0, 0.0]), *none,
        np.full(2, -np.inf), np.array([np.inf, 1.0]),
    ),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", CORNERS)
def test_rounding_makes_no_constraint_strictly_active(name, form):
    """More constraints than variables, most of them with multipliers 0."""
    qp, rng = CORNERS[name], np.random.default_rng(0)
    for _ in range(150):
        sides = {k: rng.standard_normal(getattr(qp, k).shape) for k in ("G", "h", "lb")}
        d = {"q": rng.standard_normal(2), **sides}
        expected = one_sided(lambda t, d=d: FORMS[form](moved(qp, d, t)).x)
        found = FORMS[form](qp).directional(**named(d)).x
        np.testing.assert_allclose(found, expected, 1e-4, 1e-4)


def dense_of(M):
    return M.toarray() if sp.issparse(M) else M


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("family", [weak_rows, repeated_row, vertex])
def test_gradients_are_those_of_a_regular_qp_nearby(family, form):
    """With h of the rows that are not held raised, the QP has the gradients found."""
    for seed in range(8):
        qp = family(seed)
        result = FORMS[form](qp)
        gx = np.random.default_rng([seed, 6]).standard_normal(qp.q.size)
        found = result.backward(dx=gx)
        held = found.h != 0.0
        near = FORMS[form](qp._replace(h=np.where(held, qp.h, qp.h + 1e-6)))
        np.testing.assert_allclose(near.x, result.x, atol=1e-8)
        expected = near.backward(dx=gx)
        assert (expected.weak, expected.singular) == (0, False)
        for name in ("P", "q", "G", "h"):
            own, other = (dense_of(getattr(g, name)) for g in (found, expected))
            np.testing.assert_allclose(own, other, 1e-6, 1e-6)


@pytest.mark.parametrize("form", FORMS)
def test_results_tell_of_kinks(form):
    for qp, kinks in (
        (weak_rows(0), (2, False)), (weak_bounds(0), (2, False)), (flat(0), (3, True))
    ):  # fmt: skip
        found = FORMS[form](qp).backward(dx=np.ones(qp.q.size))
        assert (found.weak, found.singular) == kinks


def repeated_in_a_large_qp(seed, n=400):
    """Five rows meet in a vertex of the first three variables of a sparse QP."""
    qp = vertex(seed)
    rest = complementary(seed, n, n // 3, 4, rank=2 * n, density=0.01).qp
    P = sp.block_diag((qp.P, rest.P + 0.1 * sp.eye_array(n)), format="csc")
    G = sp.block_diag((qp.G, rest.G), format="csc")
    A = sp.hstack((sp.csc_array((4, 3)), rest.A), format="csc")
    lb, ub = np.append(np.full(3, -np.inf), rest.lb), np.append([np.inf] * 3, rest.ub)
    q, h = np.concatenate((qp.q, rest.q)), np.concatenate((qp.h, rest.h))
    return QP(P, q, G, h, A, rest.b, lb, ub)


@pytest.mark.parametrize("seed", range(3))
def test_dependent_rows_in_a_large_sparse_qp(seed):
    """The interior-point method gives all five rows multipliers: three are held."""
    qp, small = repeated_in_a_large_qp(seed), vertex(seed)
    result, alone = namlcp.solve_qp(*qp), namlcp.solve_qp(*small, **EXACT)
    dq = np.zeros(qp.q.size)
    dq[:3] = np.random.default_rng([seed, 1]).standard_normal(3)
    own, other = result.forward(dq=dq), alone.forward(dq=dq[:3])
    np.testing.assert_allclose(own.x[:3], other.x, atol=1e-8)
    found = result.backward(dx=dq).h[:5]
    assert np.count_nonzero(found) == 3
    raised = small._replace(h=np.where(found != 0.0, small.h, small.h + 1e-6))
    expected = namlcp.solve_qp(*raised, **EXACT).backward(dx=dq[:3]).h
    np.testing.assert_allclose(found, expected, atol=1e-7)


@pytest.mark.parametrize("seed", range(40))
def test_backward_is_adjoint_to_forward_at_kinks(seed):
    """Small integers make constraints weak, dependent and P singular."""
    rng = np.random.default_rng(seed)
    n, m = 5, 6
    B = rng.integers(-2, 3, (3, n)).astype(float)
    G = rng.integers(-2, 3, (m, n)).astype(float)
    x = rng.integers(-2, 3, n).astype(float)
    active = rng.random(m) < 0.7
    z = active * rng.integers(0, 3, m)
    qp = around(x, B.T @ B, G, z, active)
    result = namlcp.solve_qp(*(sparse(qp) if seed % 2 else qp))
    d, g = direction(qp, seed), [rng.standard_normal(size) for size in (n, m)]
    tangent, gradients = result.forward(**named(d)), result.backward(*g[:1], dz=g[1])
    total = g[0] @ tangent.x + g[1] @ tangent.z
    paired = [np.sum(dense_of(getattr(gradients, k)) * v) for k, v in d.items()]
    assert abs(total - sum(paired)) <= 1e-7 * (1.0 + np.abs(paired).sum())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("form", FORMS)
def test_redundant_equalities_are_left_out(seed, form):
    """One equality is the sum of two others: x moves with b as long as they agree."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((3, 5))
    A[2] = A[0] + A[1]
    none, free = (np.empty((0, 5)), np.empty(0)), np.full(5, np.inf)
    rows = A, A @ rng.standard_normal(5)
    qp = QP(np.diag(1.0 + rng.random(5)), np.ones(5), *none, *rows, -free, free)
    result, alone = FORMS[form](qp), FORMS[form](qp._replace(A=A[:2], b=qp.b[:2]))
    found, expected = result.forward(db=[1.0, 2.0, 3.0]), alone.forward(db=[1.0, 2.0])
    np.testing.assert_allclose(found.x, expected.x, atol=1e-9)
    assert found.singular
    directional = result.directional(db=[1.0, 2.0, 3.0])
    np.testing.assert_allclose(directional.x, found.x, atol=1e-7)


@pytest.mark.parametrize("form", FORMS)
def test_where_x_is_not_unique_the_derivative_of_P_x_is_right(form):
    """P = diag(1, 0): x_2 is free, P x = -q moves with q_1 alone; least norm else."""
    none, free = (np.empty((0, 2)), np.empty(0)), np.full(2, np.inf)
    qp = QP(np.diag([1.0, 0.0]), np.array([-1.0, 0.0]), *none, *none, -free, free)
    result = FORMS[form](qp)
    found = result.backward(dx=[1.0, 1.0])
    assert (found.weak, found.singular) == (0, True)
    np.testing.assert_allclose(found.q, [-1.0, 0.0], atol=1e-9)
    moves = result.forward(dq=[1.0, 0.0]).x
    np.testing.assert_allclose(moves, [-1.0, 0.0], atol=1e-9)


def test_a_direction_into_infeasibility_is_refused():
    """0 <= x <= 0 by two rows; raising the lower one leaves nothing."""
    qp = np.eye(1), [0.0], [[1.0], [-1.0]], [0.0, 0.0]
    with pytest.raises(ValueError, match="constraints contradict each other"):
        namlcp.solve_qp(*qp).directional(dh=[0.0, -1.0])


@pytest.mark.parametrize("kind", [np.array, sp.csc_array])
def test_a_multiplier_too_small_to_divide_by_counts_as_none(kind):
    P = kind(np.zeros((1, 1)))
    result = namlcp.solve_qp(P, [0.0], kind(np.eye(1)), [1.0], kind(np.eye(1)), [1.0])
    result.z[:], result.y[:] = 1e-310, -1e-310
    found = result.backward(dx=[1.0])
    assert (found.weak, found.h, found.b) == (1, 0.0, 1.0)


# ---- LCPs


@pytest.mark.parametrize("seed", range(8))
def test_directional_of_an_lcp_equals_the_one_sided_difference(seed):
    A, q = weak_lcp(seed)
    dA, dq = np.split(np.random.default_rng([seed, 7]).standard_normal((9, 8)), [8])
    result = namlcp.solve_lcp(A, q, eps_abs=1e-13)
    found = result.directional(dA=dA, dq=dq[0])
    assert (found.weak, found.singular) == (2, False)

    def at(t):
        moved = namlcp.solve_lcp(A + t * dA, q + t * dq[0], eps_abs=1e-13)
        return np.append(moved.z, moved.w)

    expected = one_sided(at, 1e-7)
    np.testing.assert_allclose(np.append(found.z, found.w), expected, 1e-4, 1e-4)


def test_a_direction_leaves_the_start_of_the_next_solve_alone():
    A = namlcp.Prepared(np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 1.0], [0.0, 1.0, 2.0]]))
    result = namlcp.solve_lcp(A, [-1.0, -2.0, 0.0])
    assert result.directional(dq=[1.0, 2.0, -3.0]).weak == 1
    np.testing.assert_array_equal(A.last, result.z)


def test_one_sided_derivatives_are_homogeneous():
    """Of x = 0 where all rows of G x <= 0 are weak, by the interior-point method."""
    n, rng = 300, np.random.default_rng(0)
    P = sp.diags_array([2.0, -1.0, -1.0], offsets=[0, 1, -1], shape=(n, n))
    G = sp.csc_array(sp.random_array((n, n), density=0.01, rng=rng))
    result = namlcp.solve_qp(P, np.zeros(n), G, np.zeros(n))
    dq = rng.standard_normal(n)
    found = result.directional(dq=dq)
    for scale in 1e-12, 1e12:
        scaled = result.directional(dq=scale * dq)
        np.testing.assert_allclose(scaled.x, scale * found.x, 1e-9, 1e-9 * scale)
        np.testing.assert_allclose(scaled.z, scale * found.z, 1e-9, 1e-9 * scale)


@pytest.mark.parametrize("kind", [np.array, sp.csr_array])
def test_an_unknown_is_weak_though_the_terms_of_its_w_cancel(kind):
    """z = (2, 1, 0), w = 0: w_3 = 1 * 2 - 2 * 1 is a rounding error, and q_3 = 0."""
    A = np.array([[5.0, 2.0, -1.0], [6.0, 7.0, 0.0], [1.0, -2.0, 6.0]])
    result = namlcp.solve_lcp(kind(A), [-12.0, -19.0, 0.0])
    dq = np.array([0.0, 0.0, 1.0])
    found = result.directional(dq=-dq)
    assert found.weak == 1
    np.testing.assert_allclose(found.z, np.linalg.solve(A, dq), atol=1e-12)
    assert result.directional(dq=dq).z[2] == 0.0


@pytest.mark.parametrize("kind", [np.array, sp.csr_array])
def test_an_unknown_is_weak_though_rounding_alone_moves_its_w(kind):
    """z = (0, 0, 1, 0), w = 0, up to rounding, and so is the sum of terms of w_1."""
    A = np.array([[7.0, 2, 0, -6], [2, 8, 4, -2], [0, 4, 4, 1], [-6, -2, 1, 10]])
    q, rng = np.array([0.0, -4.0, -4.0, -1.0]), np.random.default_rng(0)
    result = namlcp.solve_lcp(kind(A), q)
    for _ in range(20):
        dq = rng.standard_normal(4)
        found = result.directional(dq=dq).z
        near = namlcp.solve_lcp(A, q + 1e-6 * dq).z
        np.testing.assert_allclose(found, 1e6 * (near - np.eye(4)[2]), 1e-6, 1e-6)


def test_a_singular_free_block_keeps_the_weak_unknowns():
    """A = [1 1; 1 1], w = 0 in both, z = (1, 0): only the first one is free then."""
    result = namlcp.solve_lcp(np.ones((2, 2)), [-1.0, -1.0])
    found = result.backward(dz=[1.0, 1.0])
    if result.z[1] == 0.0:
        assert found.weak == 1
        assert np.allclose(found.q, [-1.0, 0.0])
    assert found.singular


@pytest.mark.parametrize("kind", [np.array, sp.csr_array])
def test_an_indefinite_symmetric_lcp_is_factored_with_pivoting(kind):
    """A = [0 1; 1 0], all unknowns free: z = -(q_2, q_1)."""
    A, free = kind(np.array([[0.0, 1.0], [1.0, 0.0]])), np.full(2, np.inf)
    result = namlcp.solve_lcp(kind(np.eye(2)), [1.0, 2.0], -free, free)
    lcp, _ = result.problem
    lcp = lcp._replace(matrix=namlcp.Prepared(A))
    parts = {name: getattr(result, name) for name in namlcp.LCPResult.__annotations__}
    parts |= {"z": np.array([-2.0, -1.0]), "problem": (lcp, A)}
    other = namlcp.LCPResult(**parts)
    assert np.allclose(other.backward(dz=[1.0, 0.0]).q, [0.0, -1.0])


@pytest.mark.parametrize("kind", [np.array, sp.csc_array])
def test_a_large_null_space_leaves_the_adjoint(kind):
    """P of rank 30 of 60, five rows twice: x is not unique, and pivots vanish."""
    rng = np.random.default_rng(0)
    B, G = definite(60, rng)[:30], rng.standard_normal((30, 60))
    q, G = B.T @ (B @ rng.standard_normal(60)), np.vstack((G, G[:5]))
    result = namlcp.solve_qp(kind(B.T @ B), q, kind(G), np.full(35, 0.1), **EXACT)
    d, g = B.T @ rng.standard_normal(30), B.T @ rng.standard_normal(30)
    found = result.backward(dx=g)
    assert found.singular
    paired = found.q @ d
    assert result.forward(dq=d).x @ g == pytest.approx(paired, rel=1e-9, abs=1e-9)
