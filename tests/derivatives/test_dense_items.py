"""The compiled pass over dense items: equal to the pass in Python, item by item."""

import numpy as np
import pytest

import namlcp
from validation.derivatives.cases import regular_qp

PARTS = ("x", "y", "z", "z_box")
VECTORS = ("q", "h", "b", "lb", "ub")


def weights(result, seed):
    rng = np.random.default_rng(seed)
    return [rng.standard_normal(getattr(result, part).shape) for part in PARTS]


@pytest.mark.parametrize("seed", range(10))
def test_the_compiled_pass_is_that_of_the_face(seed):
    result = namlcp.solve_qp(*regular_qp(seed))
    given = weights(result, seed)
    expected = result.derivative.backward_of_face(given)
    first, again = result.backward(*given), result.backward(*given)
    for name in (*VECTORS, "P", "G", "A"):
        own, other = getattr(first, name), getattr(expected, name)
        np.testing.assert_allclose(own, other, rtol=1e-10, atol=1e-12)
        assert np.array_equal(own, getattr(again, name))


@pytest.mark.parametrize("seed", range(3))
def test_forward_takes_the_factors_of_backward(seed):
    qp = regular_qp(seed)
    result, other = namlcp.solve_qp(*qp), namlcp.solve_qp(*qp)
    result.backward(dx=np.ones(qp.q.size))
    assert result.derivative.face.system.memory is result.derivative.item.factors
    own, fresh = result.forward(dq=qp.q), other.forward(dq=qp.q)
    assert np.array_equal(own.x, fresh.x)


@pytest.mark.parametrize("threads", [1, 2])
def test_kinks_and_singular_items_of_a_batch(threads):
    """x = max(c, 0): free, weak, and at two equal bounds, one of them a row of G."""
    q = np.array([[-1.0], [0.0], [1.0]])
    G, h = -np.ones((1, 1)), np.array([[1.0], [1.0], [0.0]])
    batch = namlcp.solve_batch(np.eye(1), q, G, h, lb=np.zeros(1))
    found = batch.backward(dx=np.ones((3, 1)), threads=threads)
    for i, item in enumerate(batch):
        own = item.backward(dx=[1.0])
        assert (found.weak[i], found.singular[i]) == (own.weak, own.singular)
        assert np.array_equal(found.q[i], own.q)
        assert np.array_equal(found.h[i], own.h)
    assert found.weak.tolist() == [0, 1, 1]


def test_singular_items_use_independent_constraints():
    """The row x <= 1 twice: one of the two carries the multiplier."""
    q = np.array([[-2.0], [-3.0]])
    batch = namlcp.solve_batch(np.eye(1), q, np.ones((2, 1)), np.ones(2))
    found = batch.backward(dx=np.ones((2, 1)))
    assert found.h.tolist() in ([2.0, 0.0], [0.0, 2.0])
    assert not found.q.any()


def test_an_item_that_is_not_finite_is_named():
    batch = namlcp.solve_batch(np.eye(1), np.array([[-1.0], [np.nan]]))
    assert batch.backward(dx=np.array([[1.0], [np.nan]])).q.tolist() == [[-1.0], [0.0]]
    with pytest.raises(ValueError, match=r"dx must be finite, got nan at \(0, 0\)"):
        batch.backward(dx=np.array([[np.nan], [1.0]]))
