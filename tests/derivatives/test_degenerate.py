"""Kinks: weak and dependent constraints, singular systems, one-sided derivatives."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import complementary

import namlcp
from namlcp.qp import QP
from validation.derivatives.cases import (
    KINKS,
    around,
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
SEEDS = range(8)


def dense(qp) -> QP:
    return qp


def sparse(qp) -> QP:
    return QP(*(sp.csc_array(v) if v.ndim == 2 else v for v in qp))


def one_sided(qp, d, form, t=1e-6):
    def at(s):
        return namlcp.solve_qp(*form(moved(qp, d, s)), **EXACT).x

    near, far = at(t), at(2 * t)
    x = at(0.0)
    return (4.0 * (near - x) - (far - x)) / (2 * t)


def named(d):
    return {f"d{k}": v for k, v in d.items()}


@pytest.mark.parametrize("form", [dense, sparse])
@pytest.mark.parametrize(
    ("family", "names"), [(f, k) for f, names in KINKS.items() for k in names]
)
@pytest.mark.parametrize("seed", SEEDS[:4])
def test_directional_equals_the_one_sided_difference(seed, family, names, form):
    qp = family(seed)
    d = direction(qp, seed, names)
    result = namlcp.solve_qp(*form(qp), **EXACT)
    found, expected = result.directional(**named(d)), one_sided(qp, d, form)
    assert np.allclose(found.x, expected, rtol=1e-4, atol=1e-4)


@pytest.mark.parametrize("form", [dense, sparse])
@pytest.mark.parametrize("names", ["q", "P"])
@pytest.mark.parametrize("family", [repeated_row, vertex])
@pytest.mark.parametrize("seed", SEEDS)
def test_dependent_rows_do_not_spoil_the_derivative_of_x(seed, family, names, form):
    """x is differentiable in q and P there, whatever multipliers the solve gave."""
    qp = family(seed)
    d = direction(qp, seed, names)
    result = namlcp.solve_qp(*form(qp), **EXACT)
    assert np.allclose(
        result.forward(**named(d)).x, one_sided(qp, d, form), rtol=1e-4, atol=1e-4
    )


@pytest.mark.parametrize("form", [dense, sparse])
@pytest.mark.parametrize("family", [weak_rows, repeated_row, vertex])
@pytest.mark.parametrize("seed", SEEDS)
def test_gradients_are_those_of_a_regular_qp_nearby(seed, family, form):
    """With h of the rows that are not held raised, the QP has the gradients found."""
    qp = family(seed)
    result = namlcp.solve_qp(*form(qp), **EXACT)
    held = result.derivative.face.active.rows
    h = qp.h + 1e-6
    h[held] = qp.h[held]
    near = namlcp.solve_qp(*form(qp._replace(h=h)), **EXACT)
    assert np.allclose(near.x, result.x, atol=1e-8)
    gx = np.random.default_rng([seed, 6]).standard_normal(qp.q.size)
    found, expected = result.backward(dx=gx), near.backward(dx=gx)
    assert (expected.weak, expected.singular) == (0, False)
    for name in ("P", "q", "G", "h"):
        own, other = getattr(found, name), getattr(expected, name)
        if sp.issparse(own):
            own, other = own.toarray(), other.toarray()
        assert np.allclose(own, other, rtol=1e-6, atol=1e-6), name


@pytest.mark.parametrize("form", [dense, sparse])
def test_results_tell_of_kinks(form):
    def kinks(qp):
        found = namlcp.solve_qp(*form(qp), **EXACT).backward(dx=np.ones(qp.q.size))
        return found.weak, found.singular

    assert kinks(weak_rows(0)) == (2, False)
    assert kinks(weak_bounds(0)) == (2, False)
    assert kinks(flat(0)) == (3, True)


def repeated_in_a_large_qp(seed, n=400):
    """Five rows meet in a vertex of the first three variables of a sparse QP."""
    qp = vertex(seed)
    rest = complementary(seed, n, n // 3, 4, rank=2 * n, density=0.01).qp
    P = sp.block_diag((qp.P, rest.P + 0.1 * sp.eye_array(n)), format="csc")
    G = sp.block_diag((qp.G, rest.G), format="csc")
    A = sp.hstack((sp.csc_array((4, 3)), rest.A), format="csc")
    bounds = (np.concatenate((np.full(3, s * np.inf), v)) for s, v in
              ((-1, rest.lb), (1, rest.ub)))  # fmt: skip
    q, h = np.concatenate((qp.q, rest.q)), np.concatenate((qp.h, rest.h))
    return QP(P, q, G, h, A, rest.b, *bounds)


@pytest.mark.parametrize("seed", range(3))
def test_dependent_rows_in_a_large_sparse_qp(seed):
    """The interior-point method gives all five rows multipliers: three are held."""
    qp = repeated_in_a_large_qp(seed)
    result = namlcp.solve_qp(*qp)
    dq = np.zeros(qp.q.size)
    dq[:3] = np.random.default_rng(seed).standard_normal(3)
    found = result.forward(dq=dq)
    assert np.count_nonzero(result.derivative.face.active.rows < 5) == 3
    alone = namlcp.solve_qp(*vertex(seed), **EXACT).forward(dq=dq[:3])
    assert np.allclose(found.x[:3], alone.x, atol=1e-8)
    gradients = result.backward(dx=dq)
    reference = namlcp.solve_qp(*vertex(seed), **EXACT)
    h = vertex(seed).h + 1e-6
    held = result.derivative.face.active.rows[:3]
    h[held] -= 1e-6
    reference = namlcp.solve_qp(*vertex(seed)._replace(h=h), **EXACT)
    expected = reference.backward(dx=dq[:3])
    assert np.allclose(gradients.h[:5], expected.h, atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_directional_of_an_lcp_equals_the_one_sided_difference(seed):
    A, q = weak_lcp(seed)
    dA, dq = np.split(np.random.default_rng([seed, 7]).standard_normal((9, 8)), [8])
    result = namlcp.solve_lcp(A, q, eps_abs=1e-13)
    found = result.directional(dA=dA, dq=dq[0])
    assert (found.weak, found.singular) == (2, False)
    t = 1e-7
    moved = namlcp.solve_lcp(A + t * dA, q + t * dq[0], eps_abs=1e-13)
    assert np.allclose(found.z, (moved.z - result.z) / t, rtol=1e-4, atol=1e-4)
    assert np.allclose(found.w, (moved.w - result.w) / t, rtol=1e-4, atol=1e-4)


def test_a_singular_free_block_keeps_the_weak_unknowns():
    """A = [1 1; 1 1], w = 0 in both, z = (1, 0): only the first one is free then."""
    result = namlcp.solve_lcp(np.ones((2, 2)), [-1.0, -1.0])
    found = result.backward(dz=[1.0, 1.0])
    if result.z[1] == 0.0:
        assert found.weak == 1
        assert np.allclose(found.q, [-1.0, 0.0])
    assert found.singular


def test_a_direction_into_infeasibility_is_refused():
    """0 <= x <= 0 by two rows; raising the lower one leaves nothing."""
    qp = np.eye(1), [0.0], [[1.0], [-1.0]], [0.0, 0.0]
    with pytest.raises(ValueError, match="constraints contradict each other"):
        namlcp.solve_qp(*qp).directional(dh=[0.0, -1.0])


@pytest.mark.parametrize("form", [dense, sparse])
def test_where_x_is_not_unique_the_derivative_of_P_x_is_right(form):
    """P = diag(1, 0): x_2 is free, P x = -q moves with q_1 alone; least norm else."""
    none, free = (np.empty((0, 2)), np.empty(0)), np.full(2, np.inf)
    qp = QP(np.diag([1.0, 0.0]), np.array([-1.0, 0.0]), *none, *none, -free, free)
    result = namlcp.solve_qp(*form(qp))
    found = result.backward(dx=[1.0, 1.0])
    assert (found.weak, found.singular) == (0, True)
    assert np.allclose(found.q, [-1.0, 0.0], atol=1e-9)
    assert np.allclose(result.forward(dq=[1.0, 0.0]).x, [-1.0, 0.0], atol=1e-9)


@pytest.mark.parametrize("kind", [np.array, sp.csr_array])
def test_an_indefinite_symmetric_lcp_is_factored_with_pivoting(kind):
    """A = [0 1; 1 0], all unknowns free: z = -(q_2, q_1)."""
    A, free = kind(np.array([[0.0, 1.0], [1.0, 0.0]])), np.full(2, np.inf)
    result = namlcp.solve_lcp(kind(np.eye(2)), [1.0, 2.0], -free, free)
    lcp, _ = result.problem
    lcp = lcp._replace(matrix=namlcp.Prepared(A))
    moved_result = replace(result, z=np.array([-2.0, -1.0]), problem=(lcp, A))
    assert np.allclose(moved_result.backward(dz=[1.0, 0.0]).q, [0.0, -1.0])


@pytest.mark.parametrize("seed", range(3))
def test_redundant_equalities_are_left_out(seed):
    """One equality is the sum of two others: x moves with b as long as they agree."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((3, 5))
    A[2] = A[0] + A[1]
    b = A @ rng.standard_normal(5)
    P = np.diag(1.0 + rng.random(5))
    for form in (np.array, sp.csc_array):
        result = namlcp.solve_qp(form(P), np.ones(5), A=form(A), b=b)
        found = result.forward(db=[1.0, 2.0, 3.0])
        alone = namlcp.solve_qp(P, np.ones(5), A=A[:2], b=b[:2])
        assert np.allclose(found.x, alone.forward(db=[1.0, 2.0]).x, atol=1e-9)
        assert found.singular
        directional = result.directional(db=[1.0, 2.0, 3.0])
        assert np.allclose(directional.x, found.x, atol=1e-7)


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
    d = direction(qp, seed)
    tangent = result.forward(**named(d))
    g = [rng.standard_normal(size) for size in (n, m)]
    gradients = result.backward(dx=g[0], dz=g[1])
    terms = [g[0] @ tangent.x, g[1] @ tangent.z]
    paired = []
    for name, change in d.items():
        own = getattr(gradients, name)
        paired.append(np.sum((own.toarray() if sp.issparse(own) else own) * change))
    assert abs(sum(terms) - sum(paired)) <= 1e-7 * (1.0 + np.abs(paired).sum())
