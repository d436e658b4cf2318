"""Arrays that are changed after the solve: a derivative is right, or it is an error."""

import numpy as np
import pytest
from scipy import sparse

import namlcp


def qp():
    P = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.0], [0.0, 0.0, 1.0]])
    q = np.array([-1.0, 1.0, 0.0])  # x_3 = 0: a change of P_33 moves no residual
    G, h = np.array([[1.0, 1.0, 0.0]]), np.array([0.1])
    A, b = np.array([[1.0, -1.0, 0.0]]), np.array([0.2])
    return {"P": P, "q": q, "G": G, "h": h, "A": A, "b": b, "lb": -np.ones(3)}


CHANGES = {
    "times 100": lambda v: np.multiply(v, 100.0, out=v),
    "other signs": lambda v: np.negative(v, out=v),
    "one bit": lambda v: (
        v.view(np.int64).__iadd__(np.eye(*v.shape, dtype=np.int64))
        if v.ndim == 2
        else v.view(np.int64).__iadd__(1)
    ),
}


@pytest.mark.parametrize("kind", [np.array, sparse.csc_array])
@pytest.mark.parametrize("name", ["P", "q", "G", "h", "A", "b", "lb"])
@pytest.mark.parametrize("change", CHANGES)
def test_no_derivative_of_arrays_that_have_changed(kind, name, change):
    data = {k: kind(v) if v.ndim == 2 else v for k, v in qp().items()}
    result = namlcp.solve_qp(**data)
    expected = result.backward(dx=np.ones(3)).q
    values = data[name].data if sparse.issparse(data[name]) else data[name]
    before = values.copy()
    CHANGES[change](values)
    for derivative in (
        lambda: result.backward(dx=np.ones(3)),
        lambda: result.forward(dq=np.ones(3)),
        lambda: result.directional(dq=np.ones(3)),
    ):
        with pytest.raises(ValueError, match="one has been changed in place since"):
            derivative()
    values[...] = before
    assert np.array_equal(result.backward(dx=np.ones(3)).q, expected)


A, TWO = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([[-1.0, 1.0], [1.0, -2.0]])


def of_batch(A, q, lb, ub):
    result = namlcp.solve_batch(A, q, lb=lb, ub=ub)
    return lambda: result.backward(dx=np.ones((2, 2))).q


def of_item(A, q, lb, ub):
    result = namlcp.solve_batch(A, q, lb=lb, ub=ub)[1]
    return lambda: result.backward(dx=np.ones(2)).q


def of_lcp(A, q, lb, ub, prepare=namlcp.Prepared):
    result = namlcp.solve_lcp(prepare(A), q[0], lb, ub)
    return lambda: result.forward(dlower=np.ones(2)).w


def of_sparse_lcp(A, q, lb, ub):
    M = sparse.csr_array(A)
    M.data = A.reshape(-1)
    return of_lcp(M, q, lb, ub, lambda matrix: matrix)


def of_closest(A, q, lb, ub):
    """x >= 2 by a row, and x <= 1."""
    result = namlcp.solve_qp(A, q[0], -A, -7.0 * ub, lb=lb, ub=ub, infeasible="closest")
    return lambda: result.closest.backward(dx=np.ones(2)).q


@pytest.mark.parametrize("of", [of_batch, of_item, of_lcp, of_sparse_lcp, of_closest])
@pytest.mark.parametrize("change", CHANGES)
def test_no_derivative_of_other_results_whose_arrays_have_changed(of, change):
    """One array, and all of them: the signs of lb and ub change places."""
    arrays = A.copy(), TWO.copy(), -np.ones(2), np.ones(2)
    derivative = of(*arrays)
    expected = derivative()
    for changed in (*((v,) for v in arrays), arrays, arrays[2:]):
        before = [v.copy() for v in changed]
        for values in changed:
            CHANGES[change](values)
        with pytest.raises(ValueError, match="one has been changed in place since"):
            derivative()
        for values, old in zip(changed, before, strict=True):
            values[...] = old
    assert np.array_equal(derivative(), expected)


@pytest.mark.parametrize("infeasible", [False, True])
def test_a_solver_has_its_own_arrays(infeasible):
    data, new = qp(), qp()
    solver = namlcp.Solver(**data, infeasible="closest")
    new["h"] -= 10.0 * infeasible
    new["P"] *= 2.0
    solver.update(**new)
    result = solver.solve()
    assert result.found is not infeasible
    result = result.closest if infeasible else result
    expected = result.backward(dx=np.ones(3)).q
    for values in (*data.values(), *new.values()):
        values *= 100.0
    assert np.array_equal(result.backward(dx=np.ones(3)).q, expected)


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_other_numbers_in_the_place_of_a_sparse_matrix_are_noticed(kind):
    """Of half the size, or every other one: none is read beyond their end."""
    P = sparse.csc_array(2.0 * np.eye(500))
    result = namlcp.solve_qp(P, -np.ones(500), -np.ones((1, 500)), [0.0])
    A = sparse.csr_array(P)
    solved = namlcp.solve_lcp(A, -np.ones(500))
    for M in P, A:
        M.data = np.full(1000, 2.0, kind)[::2]
    for derivative in result.backward, solved.backward:
        with pytest.raises(ValueError, match="one has been changed in place since"):
            derivative(np.ones(500))
