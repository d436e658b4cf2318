"""Derivatives of LCPs: against central differences, the adjoint, and each other."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

import namlcp
from namlcp.derivatives import differentiate_lcp
from validation.derivatives.cases import regular_lcp

EXACT = {"eps_abs": 1e-13, "eps_rel": 1e-15}


def random_direction(A, q, lower, upper, seed):
    rng = np.random.default_rng([seed, 2])
    dA, dq = rng.standard_normal(A.shape), rng.standard_normal(q.size)
    dl, du = rng.standard_normal((2, q.size))
    pinned = lower == upper
    dl[pinned] = du[pinned]
    return dA, dq, dl, du


@pytest.mark.parametrize("kind", [np.array, sp.csr_array], ids=["dense", "sparse"])
@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("seed", range(5))
def test_forward_equals_differences(seed, symmetric, kind):
    A, q, lower, upper = regular_lcp(seed, symmetric=symmetric)
    d = random_direction(A, q, lower, upper, seed)
    result = namlcp.solve_lcp(kind(A), q, lower, upper, **EXACT)
    dA, dq, dl, du = d
    found = result.forward(dA=kind(dA), dq=dq, dlower=dl, dupper=du)
    assert (found.weak, found.singular) == (0, False)

    def central(t):
        ends = []
        for s in (t, -t):
            new = kind(A + s * dA), q + s * dq, lower + s * dl, upper + s * du
            ends.append(namlcp.solve_lcp(*new, **EXACT))
        return [(getattr(ends[0], k) - getattr(ends[1], k)) / (2 * t) for k in "zw"]

    coarse, fine = central(1e-4), central(5e-5)
    for own, far, near in zip((found.z, found.w), coarse, fine, strict=True):
        assert np.allclose(own, (4.0 * near - far) / 3.0, rtol=1e-7, atol=1e-7)


@pytest.mark.parametrize("kind", [np.array, sp.csr_array, sp.csc_array])
@pytest.mark.parametrize("seed", range(20))
def test_backward_is_adjoint_to_forward(seed, kind):
    A, q, lower, upper = regular_lcp(seed, symmetric=seed % 3 == 0)
    dA, dq, dl, du = random_direction(A, q, lower, upper, seed)
    result = namlcp.solve_lcp(kind(A), q, lower, upper)
    cotangents = np.random.default_rng([seed, 3]).standard_normal((2, q.size))
    tangent = result.forward(dA=dA, dq=dq, dlower=dl, dupper=du)
    terms = cotangents * np.array([tangent.z, tangent.w])
    g = result.backward(*cotangents)
    gA = g.A.toarray() if sp.issparse(g.A) else g.A
    assert type(g.A) is kind or kind is np.array
    paired = np.sum(gA * dA) + g.q @ dq + g.lower @ dl + g.upper @ du
    assert abs(terms.sum() - paired) <= 1e-10 * np.abs(terms).sum()


def test_obstacle_by_cycles_equals_factors():
    """From order 10^4 on the hierarchy of the solve serves, symmetric or not."""
    n = 120
    one = np.ones(n)
    T = sp.diags_array([-one[1:], 2 * one, -one[1:]], offsets=[-1, 0, 1])
    L = sp.csr_array(sp.kron(T, sp.eye_array(n)) + sp.kron(sp.eye_array(n), T))
    wind = sp.diags_array([-one[1:], one], offsets=[-1, 0])
    f = np.full(n * n, -4.0 / n**2)
    f[: n * n // 3] *= -1.0
    for A in (L, L + 0.1 * sp.csr_array(sp.kron(wind, sp.eye_array(n)))):
        result = namlcp.solve_lcp(A, f, eps_rel=1e-12)
        free = np.flatnonzero(result.z > 0.0)
        assert free.size >= 1e4 / 2
        gz = np.random.default_rng(0).standard_normal(n * n)
        found = result.backward(dz=gz)
        expected = np.zeros(n * n)
        expected[free] = sp.linalg.spsolve(sp.csc_array(A[free][:, free].T), -gz[free])
        assert np.allclose(
            found.q, expected, rtol=1e-9, atol=1e-9 * abs(expected).max()
        )
        assert found.A.nnz == A.nnz


def test_errors_name_what_is_wrong():
    result = namlcp.solve_lcp(np.eye(2), [1.0, -1.0])
    with pytest.raises(ValueError, match=r"dz must have shape \(2,\) to match q"):
        result.backward(dz=np.ones(3))
    with pytest.raises(ValueError, match=r"dA must have shape \(2, 2\) to match A"):
        result.forward(dA=np.ones((3, 2)))
    with pytest.raises(ValueError, match="a pickled or copied one has lost"):
        pickle.loads(pickle.dumps(result)).backward(dz=np.ones(2))
    operator = sp.linalg.aslinearoperator(np.eye(2))
    with pytest.raises(ValueError, match="need the entries of A, got a LinearOperator"):
        differentiate_lcp(namlcp.solve_lcp(operator, [1.0, -1.0]))


@pytest.mark.parametrize("kind", [np.array, sp.csr_array])
@pytest.mark.parametrize("skew", [0.0, 1.0])
def test_without_a_free_unknown_the_bounds_alone_move(kind, skew):
    A = kind(np.array([[2.0, skew], [-skew, 2.0]]))
    result = namlcp.solve_lcp(A, [1.0, 2.0])
    found = result.backward(dz=[1.0, 2.0], dw=[1.0, 0.0])
    assert found.q.tolist() == [1.0, 0.0]
    assert np.allclose(found.lower, [3.0, 2.0 + skew])
    assert result.forward(dq=[1.0, 1.0]).w.tolist() == [1.0, 1.0]
