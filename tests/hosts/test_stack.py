"""Stacks of QPs: axes that broadcast, items that fail, shared arguments."""

import numpy as np
import pytest
from problems_layers import SHARP, layer_data

import namlcp
from namlcp.stack import AXES, Stack

SIZES = {"P": (2, 2), "q": (2,), "G": (1, 2), "h": (1,)}


def small(**changes):
    """min |x - c|^2/2 with x_1 + x_2 <= 1, arguments as `changes` say."""
    parts = {"P": np.eye(2), "q": -np.ones(2), "G": np.ones((1, 2)), "h": np.ones(1)}
    parts |= changes
    return [parts.get(name) for name in AXES]


def test_one_problem_has_no_axes():
    stack = Stack(small(), {})
    assert stack.lead == ()
    assert stack.solved.shape == ()
    np.testing.assert_allclose(stack.solution.x, [0.5, 0.5])
    gradients = stack.backward(
        [np.ones(2), *map(np.zeros_like, stack.solution[1:])], [True] * 8
    )
    np.testing.assert_allclose(gradients[3], [1.0])
    assert gradients[4] is None


@pytest.mark.parametrize("name", SIZES)
def test_an_empty_stack_has_gradients(name):
    parts = small(**{name: np.empty((0, *SIZES[name]))})
    stack = Stack(parts, {})
    gradients = stack.backward(stack.solution, [True] * 8)
    assert stack.forward(parts).x.shape == stack.solution.x.shape == (0, 2)
    assert all(g.shape == v.shape for g, v in zip(gradients[:4], parts, strict=False))


@pytest.mark.parametrize("lead", [(1,), (4,), (2, 3)])
def test_items_are_solved_as_each_alone(lead):
    data = layer_data(lead=lead)
    stack = Stack(data, {})
    assert stack.solved.all()
    for place in np.ndindex(*lead):
        item = [v if v is data[4] else v[place] for v in data]
        alone = namlcp.solve_qp(*item)
        for name in "x", "y", "z", "z_box":
            found = getattr(stack.solution, name)[place]
            np.testing.assert_allclose(found, getattr(alone, name), atol=1e-9)


def test_axes_broadcast_and_gradients_have_the_shapes_of_the_arguments():
    rng = np.random.default_rng(0)
    q, h = -rng.random((3, 1, 2)), rng.random((4, 1))
    P = np.stack([np.eye(2) + k for k in np.arange(4.0)])[None] + np.zeros((1, 4, 2, 2))
    parts = small(P=P, q=q, h=h)
    stack = Stack(parts, SHARP)
    assert stack.lead == (3, 4)
    weights = [rng.standard_normal(v.shape) for v in stack.solution]
    gradients = stack.backward(weights, [True, True, True, True] + [False] * 4)
    for k, gradient in enumerate(gradients[:4]):
        assert gradient.shape == parts[k].shape
        change = rng.standard_normal(parts[k].shape)
        if k == 0:
            change = change + np.swapaxes(change, -1, -2)
        tangents = [change if i == k else None for i in range(8)]
        along = stack.forward(tangents)
        total = sum((w * v).sum() for w, v in zip(weights, along, strict=True))
        assert (gradient * change).sum() == pytest.approx(total, rel=1e-10)
        sides = []
        for step in 1e-5, -1e-5:
            moved = [v if i != k else v + step * change for i, v in enumerate(parts)]
            sides.append(Stack(moved, SHARP).solution)
        for v, up, down in zip(along, *sides, strict=True):
            np.testing.assert_allclose(v, (up - down) / 2e-5, atol=1e-6)


def test_items_that_fail_are_nan_and_have_no_gradients():
    q = np.array([[-1.0, -1.0], [np.nan, 0.0], [-2.0, -2.0]])
    rows, sides = np.array([[1.0, 1.0], [-1.0, -1.0]]), np.array([1.0, -1.0])
    h = np.stack([sides, sides, sides - 1.0])  # the last one contradicts itself
    stack = Stack(small(q=q, G=rows, h=h), {})
    np.testing.assert_array_equal(stack.solved, [True, False, False])
    assert np.isnan(stack.solution.x[1:]).all()
    assert np.isnan(stack.solution.z[1:]).all()
    weights = [np.full(v.shape, np.nan) for v in stack.solution]
    for w in weights:
        w[0] = 1.0
    gradients = stack.backward(weights, [True] * 8)
    assert np.isfinite(gradients[0]).all()
    assert (gradients[1][1:] == 0.0).all()
    along = stack.forward([None, np.ones_like(q), *[None] * 6])
    assert (along.x[1:] == 0.0).all()
    rows, _, y, z = stack.faces()
    assert all((v[1:] == 0.0).all() for v in (rows, y, z))


def test_a_shared_argument_alone_may_change():
    stack = Stack(small(P=np.stack([np.eye(2), 2.0 * np.eye(2)])), SHARP)
    along = stack.forward([None, np.array([1.0, -1.0]), *[None] * 6])
    np.testing.assert_allclose(along.x, [[-1.0, 1.0], [-0.5, 0.5]])


def test_shapes_are_named():
    with pytest.raises(ValueError, match=r"P must have at least 2 axes, got shape \(2"):
        Stack(small(P=np.ones(2)), {})
    with pytest.raises(ValueError, match=r"leading axes must broadcast, got those of"):
        Stack(small(q=np.ones((2, 2)), h=np.ones((3, 1))), {})


def test_a_change_that_is_not_finite_is_named():
    stack = Stack([np.eye(1), np.array([[1.0], [2.0]]), *[None] * 6], {})
    with pytest.raises(ValueError, match=r"dq must be finite, got nan at \(1, 0\)"):
        stack.forward([None, np.array([[1.0], [np.nan]]), *[None] * 6])
