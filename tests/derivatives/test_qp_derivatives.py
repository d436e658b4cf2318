"""Derivatives of QPs: against central differences, the adjoint, and the envelope."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

import namlcp
from namlcp.qp import QP
from validation.derivatives.cases import direction, moved, regular_qp

PARTS = ("x", "y", "z", "z_box")
EXACT = {"eps_abs": 1e-13, "eps_rel": 1e-13}


def dense(qp):
    return qp


def sparse(qp):
    return QP(*(sp.csc_array(v) if v.ndim == 2 else v for v in qp))


def random_cotangents(result, seed):
    """A gradient in the solution, in units that make all its terms alike."""
    rng = np.random.default_rng([seed, 3])
    parts = [getattr(result, part) for part in PARTS]
    return [rng.standard_normal(v.size) / (np.abs(v) + 1e-3) for v in parts]


def point(result):
    return np.concatenate([getattr(result, part) for part in PARTS])


def differences(qp, d, form, step=1e-3):
    """Central differences along d, extrapolated from two steps (Richardson)."""

    def central(t):
        ends = [namlcp.solve_qp(*form(moved(qp, d, s)), **EXACT) for s in (t, -t)]
        return (point(ends[0]) - point(ends[1])) / (2 * t)

    return (4.0 * central(step / 2) - central(step)) / 3.0


def tangent(result, d):
    return result.forward(**{f"d{k}": v for k, v in d.items()})


def pairing(gradients, d):
    total = 0.0
    for name, change in d.items():
        g = getattr(gradients, name)
        total += np.sum((g.toarray() if sp.issparse(g) else g) * change)
    return total


@pytest.mark.parametrize("form", [dense, sparse])
@pytest.mark.parametrize("scale", [1.0, 1e4])
@pytest.mark.parametrize("seed", range(6))
def test_forward_equals_differences(seed, scale, form):
    qp = regular_qp(seed, scale=scale)
    result = namlcp.solve_qp(*form(qp), **EXACT)
    d = direction(qp, seed)
    found, expected = tangent(result, d), differences(qp, d, form)
    size = np.abs(point(result)) + np.abs(expected)
    assert np.all(np.abs(point(found) - expected) <= 1e-6 * size + 1e-9)
    assert (found.weak, found.singular) == (0, False)


@pytest.mark.parametrize("form", [dense, sparse])
@pytest.mark.parametrize("seed", range(30))
def test_backward_is_adjoint_to_forward(seed, form):
    qp = regular_qp(seed, scale=10.0 ** (seed % 5))
    result = namlcp.solve_qp(*form(qp))
    d, gradients = direction(qp, seed), random_cotangents(result, seed)
    forward = tangent(result, d)
    terms = [g * getattr(forward, k) for g, k in zip(gradients, PARTS, strict=True)]
    size = sum(np.abs(t).sum() for t in terms)
    gap = sum(t.sum() for t in terms) - pairing(result.backward(*gradients), d)
    assert abs(gap) <= 1e-10 * size


def test_gradients_are_those_of_the_transcribed_kkt_system():
    """One dense solve with all conditions (Amos and Kolter 2017, eq. 6), no blocks."""
    qp = regular_qp(0)
    P, q, G, h, A, b = qp[:6]
    result = namlcp.solve_qp(*qp, **EXACT)
    n, m, p = q.size, h.size, b.size
    x, y, z, z_box = (getattr(result, part) for part in PARTS)
    bounds = np.diag((z_box != 0.0).astype(float))
    inside = np.eye(n) - bounds
    K = np.block(
        [
            [P, A.T, G.T, np.eye(n)],
            [A, np.zeros((p, p + m + n))],
            [z[:, None] * G, np.zeros((m, p)), np.diag(G @ x - h), np.zeros((m, n))],
            [bounds, np.zeros((n, p + m)), inside],
        ]
    )
    gx = np.arange(1.0, n + 1.0)
    solution = np.linalg.solve(K.T, np.concatenate((gx, np.zeros(p + m + n))))
    u, nu, lam = solution[:n], solution[n : n + p], z * solution[n + p : n + p + m]
    mu = solution[n + p + m :]
    found = result.backward(dx=gx)
    for own, expected in (
        (found.q, -u),
        (found.b, nu),
        (found.h, lam),
        (found.lb + found.ub, np.diag(bounds) * mu),
        (found.P, -0.5 * (np.outer(u, x) + np.outer(x, u))),
        (found.G, -np.outer(z, u) - np.outer(lam, x)),
        (found.A, -np.outer(y, u) - np.outer(nu, x)),
    ):
        assert np.allclose(own, expected, rtol=1e-10, atol=1e-10)
    assert np.array_equal(found.P, found.P.T)


@pytest.mark.parametrize("seed", range(5))
def test_gradients_of_the_objective_are_the_multipliers(seed):
    """The envelope theorem: d obj = x'dPx/2 + x'dq + z'dG x - z'dh + ... ."""
    qp = regular_qp(seed)
    result = namlcp.solve_qp(*qp, **EXACT)
    P, q, x = qp.P, qp.q, result.x
    found = result.backward(dx=P @ x + q)
    assert np.allclose(found.P + 0.5 * np.outer(x, x), 0.5 * np.outer(x, x))
    assert np.allclose(found.q + x, x)
    assert np.allclose(found.h, -result.z, atol=1e-8)
    assert np.allclose(found.b, -result.y, atol=1e-8)
    assert np.allclose(found.G, np.outer(result.z, x), atol=1e-8)
    assert np.allclose(found.A, np.outer(result.y, x), atol=1e-8)
    assert np.allclose(found.lb, -np.minimum(result.z_box, 0.0), atol=1e-8)
    assert np.allclose(found.ub, -np.maximum(result.z_box, 0.0), atol=1e-8)


def test_sparse_gradients_stand_on_the_users_pattern():
    qp = regular_qp(3)
    P, G, A = (np.where(np.abs(M) > 0.4, M, 0.0) for M in (qp.P, qp.G, qp.A))
    P = P + 20.0 * np.eye(P.shape[0])
    dense = namlcp.solve_qp(P, qp.q, G, qp.h, A, qp.b, **EXACT)
    given = sp.csr_array(P), sp.coo_array(G), A
    mixed = namlcp.solve_qp(given[0], qp.q, given[1], qp.h, A, qp.b, **EXACT)
    gx = np.ones(qp.q.size)
    full, found = dense.backward(dx=gx), mixed.backward(dx=gx)
    assert (found.P.format, found.G.format, type(found.A)) == ("csr", "csc", np.ndarray)
    for own, user, whole in (
        (found.P, given[0], full.P),
        (found.G, given[1], full.G),
    ):
        assert own.nnz == user.nnz
        assert np.allclose(own.toarray(), np.where(user.toarray() != 0.0, whole, 0.0))
    assert np.allclose(found.A, full.A)


def test_absent_parts_have_empty_gradients():
    result = namlcp.solve_qp(np.eye(2), [1.0, -1.0])
    found = result.backward(dx=[1.0, 2.0])
    assert found.q.tolist() == [-1.0, -2.0]
    assert (found.G.shape, found.h.shape, found.A.shape) == ((0, 2), (0,), (0, 2))
    assert not found.lb.any()
    assert not found.ub.any()


def test_an_inactive_row_has_no_gradient():
    result = namlcp.solve_qp(np.eye(2), [1.0, -1.0], [[1.0, 1.0], [0, 1]], [np.inf, 9])
    found = result.backward(dx=[1.0, 2.0], dz=[1.0, 1.0])
    assert not found.h.any()
    assert not found.G.any()


def test_errors_name_what_is_wrong():
    result = namlcp.solve_qp(np.eye(2), [1.0, -1.0])
    with pytest.raises(ValueError, match=r"dx must have shape \(2,\) to match x"):
        result.backward(dx=np.ones(3))
    with pytest.raises(ValueError, match=r"dq must have shape \(2,\) to match q"):
        result.forward(dq=np.ones(3))
    with pytest.raises(ValueError, match=r"dP must have shape \(2, 2\) to match P"):
        result.forward(dP=np.ones((3, 2)))
    with pytest.raises(ValueError, match="dx must be finite, got nan"):
        result.backward(dx=[np.nan, 0.0])
    infeasible = namlcp.solve_qp(np.eye(1), [0.0], lb=[1.0], ub=[0.0])
    with pytest.raises(ValueError, match="status solved, got primal_infeasible"):
        infeasible.backward(dx=[1.0])
    with pytest.raises(ValueError, match="a pickled or copied one has lost"):
        pickle.loads(pickle.dumps(result)).backward(dx=np.ones(2))


def test_factors_are_made_once_and_kept():
    result = namlcp.solve_qp(np.eye(2), [1.0, -1.0])
    assert "derivative" not in vars(result)
    result.backward(dx=[1.0, 0.0])
    kept = result.derivative
    result.forward(dq=[1.0, 0.0])
    assert result.derivative is kept
    assert pickle.loads(pickle.dumps(result)).problem is None


@pytest.mark.parametrize("kind", [np.array, sp.csc_array])
def test_without_a_free_variable_the_bounds_alone_move(kind):
    result = namlcp.solve_qp(kind(np.eye(2)), [1.0, 2.0], lb=[0.0, 0.0], ub=[5.0, 5.0])
    found = result.backward(dx=[1.0, 2.0])
    assert not found.q.any()
    assert found.lb.tolist() == [1.0, 2.0]
    assert not found.ub.any()


@pytest.mark.parametrize("kind", [np.array, sp.csc_array])
def test_a_linear_program_moves_with_its_vertex(kind):
    """min x_1 + x_2, 2 x_1 + x_2 >= 3, x_1 + 2 x_2 >= 3: x = (1, 1)."""
    G = np.array([[-2.0, -1.0], [-1.0, -2.0]])
    result = namlcp.solve_qp(kind(np.zeros((2, 2))), np.ones(2), kind(G), [-3.0, -3.0])
    tangent = result.forward(dh=[1.0, 0.0])
    assert np.allclose(tangent.x, np.linalg.solve(G, [1.0, 0.0]))
    assert (tangent.weak, tangent.singular) == (0, False)


def test_gradients_show_themselves_without_the_matrices():
    qp = namlcp.solve_qp(np.eye(1), np.array([-2.0]), ub=np.ones(1))
    assert repr(qp.backward(dx=np.ones(1))) == (
        "QPGradients(q=array([0.]), h=array([], dtype=float64), "
        "b=array([], dtype=float64), lb=array([0.]), ub=array([1.]), weak=0, "
        "singular=False)"
    )
    lcp = namlcp.solve_lcp(np.eye(1), np.array([-2.0]))
    assert repr(lcp.backward(dz=np.ones(1))) == (
        "LCPGradients(q=array([-1.]), lower=array([0.]), upper=array([0.]), weak=0, "
        "singular=False)"
    )
