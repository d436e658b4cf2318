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


def test_a_solver_has_its_own_arrays():
    data = qp()
    solver = namlcp.Solver(**data)
    result = solver.solve()
    expected = result.backward(dx=np.ones(3)).q
    data["P"] *= 100.0
    assert np.array_equal(result.backward(dx=np.ones(3)).q, expected)
