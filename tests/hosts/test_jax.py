"""Derivatives of QPs in JAX, by its own checks and against `QPResult.backward`."""

import numpy as np
import pytest
from problems_layers import SHARP, layer_data

jax = pytest.importorskip("jax")
import jax.numpy as jnp  # noqa: E402
from jax.test_util import check_grads  # noqa: E402

import namlcp  # noqa: E402
from namlcp.jax import solve_qp  # noqa: E402


@pytest.fixture(autouse=True)
def double_precision():
    with jax.enable_x64(True):
        yield


def solutions(*arguments):
    return solve_qp(*arguments, **SHARP)[:4]


def test_derivatives_pass_the_check_of_jax():
    data = [jnp.asarray(v) for v in layer_data(n=3, m=3, p=1)]
    check_grads(jax.jit(solutions), data, 1, eps=1e-6, atol=1e-5, rtol=1e-5)


def test_no_variables_have_no_gradient():
    gradient = jax.grad(lambda q: solve_qp(jnp.zeros((0, 0)), q).x.sum())
    assert gradient(jnp.zeros(0)).shape == (0,)


def test_second_derivatives():
    data = [jnp.asarray(v) for v in layer_data(n=3, m=3, p=1)]
    rng = np.random.default_rng(0)
    change = [jnp.asarray(rng.standard_normal(v.shape)) for v in data]

    def loss(*arguments):
        return sum((v * v).sum() for v in solutions(*arguments))

    gradients = jax.jit(jax.grad(loss, range(8)))
    _, along = jax.jit(lambda *a: jax.jvp(gradients, a[:8], a[8:]))(*data, *change)
    sides = [
        gradients(*(v + step * d for v, d in zip(data, change, strict=True)))
        for step in (1e-5, -1e-5)
    ]
    for v, up, down in zip(along, *sides, strict=True):
        np.testing.assert_allclose(v, (up - down) / 2e-5, rtol=1e-5, atol=1e-5)


def test_gradients_are_those_of_backward_jitted_and_mapped():
    data = layer_data()
    scales = np.array([1.0, 2.0, 0.5])
    P, q, *others = (jnp.asarray(v) for v in data)

    def loss(q):
        found = solve_qp(P, q, *others)
        return found.x.sum() + 2.0 * found.z.sum()

    gradients = jax.jit(jax.vmap(jax.grad(loss)))(scales[:, None] * q)
    for gradient, scale in zip(gradients, scales, strict=True):
        result = namlcp.solve_qp(data[0], scale * data[1], *data[2:])
        exact = result.backward(dx=np.ones(5), dz=2.0 * np.ones(6))
        np.testing.assert_allclose(gradient, exact.q, atol=1e-9)


def test_a_singular_face_has_the_gradient_of_backward():
    """Two equal rows, both strictly active for the interior-point method or not."""
    P, q = np.eye(2), np.array([-3.0, -1.0])
    G, h = np.array([[1.0, 0.0], [1.0, 0.0]]), np.ones(2)
    gradient = jax.jit(jax.grad(lambda q: solve_qp(P, q, G, h).x.sum()))(q)
    exact = namlcp.solve_qp(P, q, G, h).backward(dx=np.ones(2))
    np.testing.assert_allclose(gradient, exact.q, atol=1e-9)


def test_multipliers_that_are_not_unique_have_the_gradient_of_backward():
    """Of an assignment: those of an interior point belong to more bounds than held."""
    k, rng = 10, np.random.default_rng(0)
    rows = [np.kron(np.eye(k), np.ones(k)), np.kron(np.ones(k), np.eye(k))]
    A, b, lb = np.vstack(rows)[:-1], np.ones(2 * k - 1), np.zeros(k * k)
    P, q = np.zeros((k * k, k * k)), rng.uniform(1.0, 2.0, k * k)
    dx, dy = rng.standard_normal(k * k), rng.standard_normal(2 * k - 1)

    def loss(q, A):
        found = solve_qp(P, q, A=A, b=b, lb=lb)
        return dx @ found.x + dy @ found.y

    gradients = jax.jit(jax.grad(loss, (0, 1)))(q, A)
    result = namlcp.solve_qp(P, q, A=A, b=b, lb=lb)
    exact = result.backward(dx, dy)
    assert abs(result.y - result.derivative.point.y).max() > 0.1
    for gradient, wanted in zip(gradients, (exact.q, exact.A), strict=True):
        np.testing.assert_allclose(gradient, wanted, atol=1e-8)


def test_items_without_a_solution_leave_the_others_alone():
    q = jnp.array([[-1.0], [jnp.nan], [-2.0]])
    G, h = jnp.array([[1.0], [-1.0]]), jnp.array([[3.0, 0.0], [3.0, 0.0], [-1.0, 0.0]])

    def total(q, h):
        found = jax.vmap(lambda q, h: solve_qp(jnp.eye(1), q, G, h))(q, h)
        assert found.solved.dtype == bool
        return jnp.where(found.solved[:, None], found.x, 0.0).sum(), found

    value, found = total(q, h)
    assert found.solved.tolist() == [True, False, False]
    assert value == pytest.approx(1.0)
    assert jnp.isnan(found.x[1:]).all()
    gradient = jax.jit(jax.grad(lambda q: total(q, h)[0]))(q)
    np.testing.assert_allclose(gradient, [[-1.0], [0.0], [0.0]])


def test_single_precision():
    with jax.enable_x64(False):
        data = [jnp.asarray(v) for v in layer_data()]
        gradient = jax.grad(lambda q: solve_qp(data[0], q, *data[2:]).x.sum())(data[1])
        assert gradient.dtype == jnp.float32
    exact = namlcp.solve_qp(*layer_data()).backward(dx=np.ones(5))
    np.testing.assert_allclose(gradient, exact.q, atol=1e-4)


def test_faults_are_named():
    with pytest.raises(ValueError, match=r"lb must have shape \(2,\) to match q"):
        solve_qp(jnp.eye(2), jnp.ones(2), lb=jnp.ones(3))
    with pytest.raises(ValueError, match="h was given without G: pass both"):
        solve_qp(jnp.eye(2), jnp.ones(2), h=jnp.ones(3))
    with pytest.raises(jax.errors.JaxRuntimeError, match="q must be finite"):
        jax.block_until_ready(solve_qp(jnp.eye(1), jnp.array([jnp.nan])))
