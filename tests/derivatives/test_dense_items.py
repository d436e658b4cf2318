"""The compiled pass over dense items: equal to the pass in Python, item by item."""

import gc
import pickle

import numpy as np
import pytest
import scipy.sparse as sp

import namlcp
from namlcp.qp.responses.fresh import POOL
from validation.derivatives.cases import regular_qp

PARTS = ("x", "y", "z", "z_box")
VECTORS = ("q", "h", "b", "lb", "ub")


def weights(result, seed):
    rng = np.random.default_rng(seed)
    return [rng.standard_normal(getattr(result, part).shape) for part in PARTS]


@pytest.mark.parametrize(("seed", "n"), [*((k, 16) for k in range(10)), (0, 60)])
def test_the_compiled_pass_is_that_of_the_face(seed, n):
    """Matrices of up to 2000 entries are made with the rest, those of n = 60 later."""
    result = namlcp.solve_qp(*regular_qp(seed, n))
    given = weights(result, seed)
    expected = result.derivative.backward_of_face(given)
    first, again = result.backward(*given), result.backward(*given)
    for name in (*VECTORS, "P", "G", "A"):
        own, other = getattr(first, name), getattr(expected, name)
        np.testing.assert_allclose(own, other, rtol=1e-10, atol=1e-12)
        assert np.array_equal(own, getattr(again, name))


@pytest.mark.parametrize(("seed", "n"), [*((k, 16) for k in range(10)), (0, 60)])
def test_the_factors_of_the_solve_give_the_same(seed, n):
    qp = regular_qp(seed, n)
    result = namlcp.solve_qp(*qp, derivative=True)
    given = weights(result, seed)
    expected = namlcp.solve_qp(*qp).backward(*given)
    found, again = result.backward(*given), result.backward(*given)
    assert result.derivative.item.held is result.factors
    assert found.weak == expected.weak == 0
    for name in (*VECTORS, "P", "G", "A"):
        own, other = getattr(found, name), getattr(expected, name)
        np.testing.assert_allclose(own, other, rtol=1e-10, atol=1e-12)
        assert np.array_equal(own, getattr(again, name))


def test_the_factors_of_the_solve_are_left_where_they_do_not_serve():
    """x = max(c, 0) with c = 0: the bound is held by no multiplier, or not at all."""
    result = namlcp.solve_qp(np.eye(1), [0.0], lb=[0.0], derivative=True)
    found = result.backward(dx=[1.0])
    assert (found.weak, found.q.tolist()) == (1, [-1.0])
    twice = namlcp.solve_qp(
        [[1.0]], [-2.0], [[1.0], [1.0]], [1.0, 1.0], derivative=True
    )
    assert sorted(twice.backward(dx=[1.0]).h.tolist()) == [0.0, 1.0]


def test_factors_are_not_disturbed_by_later_solves_and_end_with_the_result():
    qp, other = regular_qp(1), regular_qp(2)
    result = namlcp.solve_qp(*qp, derivative=True)
    before = result.backward(dx=qp.q).q
    for _ in range(3):
        namlcp.solve_qp(*other, derivative=True).backward(dx=other.q)
    assert np.array_equal(result.backward(dx=qp.q).q, before)
    assert pickle.loads(pickle.dumps(result)).factors is None
    space = result.factors.space
    del result
    gc.collect()
    assert any(kept is space for kept in POOL)


def test_factors_are_kept_of_dense_solves_that_are_asked_to():
    qp = regular_qp(0)
    assert namlcp.solve_qp(*qp).factors is None
    result = namlcp.solve_qp(*qp, x0=qp.q, derivative=True)
    own, other = result.backward(dx=qp.q), namlcp.solve_qp(*qp).backward(dx=qp.q)
    assert result.derivative.item.held is result.factors
    np.testing.assert_allclose(own.P, other.P, rtol=1e-10, atol=1e-12)
    sparse = [sp.csc_array(v) if v.ndim == 2 else v for v in qp]
    assert namlcp.solve_qp(*sparse, derivative=True).factors is None
    with pytest.raises(TypeError, match="derivative"):
        namlcp.solve_qp(*qp, derivative=1)


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


def test_results_of_a_solver_use_its_factors_until_it_solves_again():
    qp, other = regular_qp(1), regular_qp(2)
    solver = namlcp.Solver(*qp)
    assert solver.solve().factors is None
    result = solver.solve(derivative=True)
    given = weights(result, 1)
    first = result.backward(*given)
    assert result.derivative.item.held is result.factors
    later = solver.solve(derivative=True)
    solver.update(q=qp.q + 1.0)
    solver.solve()
    found = later.backward(*given)
    assert later.factors.address == 0
    assert later.derivative.item.held is None
    expected = namlcp.solve_qp(*qp).backward(*given)
    for name in (*VECTORS, "P", "G", "A"):
        for own in (first, found):
            np.testing.assert_allclose(
                getattr(own, name), getattr(expected, name), rtol=1e-10, atol=1e-12
            )
    with pytest.raises(TypeError, match="derivative must be True or False, got 1"):
        solver.solve(derivative=1)
    kept = solver.solve(derivative=True)
    solver.update(P=other.P)
    assert kept.factors.address == 0
    assert kept.backward(dx=qp.q).weak == 0


def test_only_some_methods_of_a_solver_leave_factors():
    """Not those for a singular P, and for most variables at bounds (n >= 32)."""
    n = 40
    q = np.where(np.arange(n) < 2, -1.0, 1.0)
    solver = namlcp.Solver(np.eye(n), q, lb=np.zeros(n))
    first, second = solver.solve(derivative=True), solver.solve(derivative=True)
    own, other = first.backward(dx=np.ones(n)), second.backward(dx=np.ones(n))
    assert np.array_equal(own.q, other.q)
    assert second.factors is None
    flat = namlcp.Solver(np.zeros((1, 1)), [1.0], lb=[0.0])
    results = [flat.solve(derivative=True) for _ in range(2)]
    assert [r.factors for r in results] == [None, None]
    assert results[1].backward(dx=[1.0]).lb.tolist() == [1.0]
