"""Dense fronts: each part against its definition, the factors against K itself."""

import numpy as np
import pytest
from problems_elimination import (
    factored,
    fill,
    laplacian,
    natural,
    parts,
    quasi_definite,
    upper,
)
from problems_qp import assert_solves_qp, make_qp
from problems_qp import solve_sparse as solve
from scipy.sparse import block_array, csc_array, diags_array, eye_array

from namlcp.limits import Limits
from namlcp.linalg import factors
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.multifrontal import Multifrontal


def saddle(rows, columns):
    """Return the K of a discretised control problem on a grid."""
    L = laplacian(rows, columns)
    return csc_array(block_array([[eye_array(L.shape[0]), L], [L, -1e-6 * L]]))


def stages(states, inputs, steps):
    """Return the K of linear control: variables (x_1, u_0, x_2, u_1, ...), dynamics.

    All inputs of a step have the same rows, which are the columns of one supernode.
    """
    rng = np.random.default_rng(4)
    F, B = rng.standard_normal((states, states)), rng.standard_normal((states, inputs))
    A = np.zeros((steps, states, steps, states + inputs))
    for t in range(steps):
        A[t, :, t] = np.hstack((-np.eye(states), B))
        if t > 0:
            A[t, :, t - 1, :states] = F
    A = A.reshape(steps * states, -1)
    P = np.diag(rng.uniform(1.0, 2.0, A.shape[1]))
    return np.block([[P, A.T], [A, -np.eye(A.shape[0])]])


def dense_factors(f):
    """Return L and D of Multifrontal factors as dense matrices, in their order."""
    L = np.eye(f.D.size)
    for s in range(f.nodes.first.size - 1):
        begin, end = f.nodes.first[s], f.nodes.first[s + 1]
        rows = f.nodes.rows[f.nodes.starts[s] : f.nodes.starts[s + 1]]
        panel = f.L[f.nodes.panels[s] : f.nodes.panels[s + 1]].reshape(
            rows.size, end - begin
        )
        for k in range(end - begin):
            L[rows[k + 1 :], begin + k] = panel[k + 1 :, k]
    return L, np.diag(f.D)


CASES = {
    "one": np.array([[-2.0]]),
    "diagonal": np.diag([1.0, -2.0, 3.0]),
    "dense": quasi_definite(130, 90, 1.0, 1),
    "sparse": quasi_definite(60, 40, 0.06, 2),
    "two parts": np.kron(np.eye(2), quasi_definite(12, 6, 0.3, 3)),
    "grid": laplacian(17, 13).toarray(),
    "saddle": saddle(9, 12).toarray(),
    "stages": stages(9, 5, 6),
    "wide stages": stages(40, 60, 3),
}


@pytest.fixture(params=CASES)
def K(request):
    return CASES[request.param]


@pytest.mark.parametrize("order", [natural, None])
def test_factors_reproduce_the_matrix(K, order):
    U = upper(K)
    order = minimum_degree(*parts(U)) if order is None else order(U)
    f = factored(Multifrontal(*parts(U), order), U)
    L, D = dense_factors(f)
    by_place = np.argsort(f.place)
    np.testing.assert_allclose(
        L @ D @ L.T, K[np.ix_(by_place, by_place)], rtol=0, atol=1e-12 * abs(K).max()
    )


def test_rows_of_a_supernode_hold_the_pattern_of_its_columns():
    K = CASES["saddle"]
    U = upper(K)
    f = factored(Multifrontal(*parts(U), minimum_degree(*parts(U))), U)
    by_place = np.argsort(f.place)
    L = fill(K[np.ix_(by_place, by_place)])
    kept = 0
    for s in range(f.nodes.first.size - 1):
        rows = f.nodes.rows[f.nodes.starts[s] : f.nodes.starts[s + 1]]
        assert (np.diff(rows) > 0).all()
        for j in range(f.nodes.first[s], f.nodes.first[s + 1]):
            assert np.isin(np.flatnonzero(L[:, j]), rows).all()
            kept += int((rows >= j).sum())
    assert L.sum() <= kept <= 2 * L.sum()


def test_solve_and_update():
    K = CASES["saddle"]
    U = upper(K)
    f = factored(Multifrontal(*parts(U), minimum_degree(*parts(U))), U)
    rhs = np.random.default_rng(0).standard_normal(K.shape[0])
    np.testing.assert_allclose(K @ f.solve(rhs), rhs, atol=1e-8)
    other = K + np.diag(np.sign(np.diag(K)))
    f.refactor(upper(other).data)
    np.testing.assert_allclose(other @ f.solve(rhs), rhs, atol=1e-11)
    f.refactor(U.data)
    np.testing.assert_allclose(K @ f.solve(rhs), rhs, atol=1e-8)


def test_factors_repeat_bit_for_bit():
    U = upper(saddle(20, 20))
    order = minimum_degree(*parts(U))
    rhs = np.arange(U.shape[0]) * 1.0
    one, two = (
        factored(Multifrontal(*parts(U), order), U).solve(rhs) for _ in range(2)
    )
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("bad", [0.0, np.nan])
def test_a_pivot_that_vanishes_is_told(bad):
    U = upper(np.diag([1.0, 5.0, 2.0]))
    U.data[1] = bad
    with pytest.raises(ValueError, match="pivot"):
        factored(Multifrontal(*parts(U), natural(U)), U)


def test_the_path_solves_with_dense_fronts(monkeypatch):
    monkeypatch.setattr(factors, "SOME", 0.0)
    monkeypatch.setattr(factors, "HEAVY", 0.0)
    used = []
    init = Multifrontal.__init__
    monkeypatch.setattr(
        Multifrontal, "__init__", lambda *args: (used.append(1), init(*args))[1]
    )
    n = 15
    L = laplacian(n, n)
    P = csc_array(diags_array(np.r_[np.ones(n * n), np.full(n * n, 1e-2)]))
    A = csc_array(block_array([[L, -eye_array(n * n)]]))
    q = np.r_[-np.sin(np.arange(n * n)), np.zeros(n * n)]
    lb, ub = np.full(2 * n * n, -0.2), np.full(2 * n * n, 0.3)
    qp = make_qp(P, q, A=A, b=np.zeros(n * n), lb=lb, ub=ub)
    result = solve(qp, Limits(eps_abs=1e-9, eps_rel=0.0))
    assert used
    assert_solves_qp(qp, result, 1e-9)
