"""Convex QPs as a differentiable function of JAX; needs jax 0.4.34 or newer.

The solution comes from a callback to the processor. Its derivative is written in JAX:
with the active constraints of the solution held, the KKT conditions are equations, and
the derivative w = (dx, dz, dy) solves linear ones (see `namlcp.derivatives.qp`) with

        [P G' A']
    H = [G 0  0 ],    K = t H t + diag(1, -1, -1) (I - t),
        [A 0  0 ]

where the diagonal t masks free variables and active rows, so that shapes do not depend
on the solution: w = w0 + t v, K v = t (right - H w0), w0 moves the fixed variables.

All are functions of the data, so that the derivative can be differentiated again, any
number of times, in both modes, under vmap and jit.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from namlcp.derivatives.gradients import right_sides
from namlcp.qp.problem import Point, refuse_half
from namlcp.results import QPSolution
from namlcp.stack import AXES, Stack

# K is factored with its diagonal shifted by eps**SHIFT of its size, eps the rounding
# unit of the type, so that a singular one has factors. Each step of refinement divides
# the error by the least singular value of K, scaled to rows of size 1, over the shift.
SHIFT, REFINEMENTS = 0.6, 3


def solve_qp(
    P: Any,
    q: Any,
    G: Any = None,
    h: Any = None,
    A: Any = None,
    b: Any = None,
    lb: Any = None,
    ub: Any = None,
    **settings: Any,
) -> QPSolution[jax.Array]:
    """Solve a convex QP so that JAX can differentiate its solution.

    ``minimise 1/2 x'Px + q'x  subject to  Gx <= h,  Ax = b,  lb <= x <= ub``

    Parameters
    ----------
    P : (n, n) array
        Symmetrised: the QP is that of (P + P') / 2.
    q, G, h, A, b, lb, ub : arrays, optional from G on
        As for `namlcp.solve_qp`, but of its shapes: no number for all bounds, no row
        for a matrix.
    **settings
        The fields of `namlcp.Options`. Under vmap, threads are those of
        `namlcp.solve_batch`.

    Returns
    -------
    QPSolution
        x, y, z and z_box can be differentiated in all arguments: jvp, vjp, any number
        of times, under jit and vmap (which solves all items in one call). A QP that is
        not solved (infeasible, unbounded, out of time) gives NaN, whatever the option
        `infeasible` says, and derivatives 0: weigh it by `solved` in a loss, with
        jnp.where.

    Raises
    ------
    ValueError
        Shapes disagree.
    jax.errors.JaxRuntimeError
        An argument is malformed (NaN), or P is not convex. Under vmap an item of which
        this is true is not solved.

    Notes
    -----
    The solve runs in double precision, the derivative in the type of the arguments,
    which is single precision unless ``jax_enable_x64`` is set. At a kink of the
    solution its derivative is chosen as by `namlcp.QPResult.backward`.

    Examples
    --------
    >>> import jax
    >>> import jax.numpy as jnp
    >>> import namlcp
    >>> def first(q):
    ...     return namlcp.jax.solve_qp(jnp.eye(2), q, ub=jnp.array([2.0, 1.0])).x[0]
    >>> print(jax.grad(first)(jnp.array([-1.0, -4.0])) + 0.0)
    [-1.  0.]
    """
    refuse_half("G", G, "h", h)
    refuse_half("A", A, "b", b)
    given = P, q, G, h, A, b, lb, ub
    kind = jnp.result_type(float, *(v for v in given if v is not None))
    n, m, p = (0 if v is None else np.size(v) for v in (q, h, b))
    shapes = (n, n), (n,), (m, n), (m,), (p, n), (p,), (n,), (n,)
    data = []
    for name, value, shape in zip(AXES, given, shapes, strict=True):
        if value is None:
            value = jnp.full(shape, {"lb": -jnp.inf, "ub": jnp.inf}.get(name, 0.0))
        value = jnp.asarray(value, kind)
        if value.shape != shape:
            raise ValueError(
                f"{name} must have shape {shape} to match q, h and b, got {value.shape}"
            )
        data.append(value)
    data[0] = (data[0] + data[0].T) / 2
    x, y, z, z_box, solved, *_ = solution(tuple(settings.items()), tuple(data))
    return QPSolution(x, y, z, z_box, solved == 1.0)


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def solution(settings: tuple[Any, ...], data: tuple[jax.Array, ...]) -> Any:
    """Return x, y, z, z_box, 1 if solved, and what `Stack.faces` returns."""
    q, h, b = data[1], data[3], data[5]
    solved = jax.ShapeDtypeStruct((), q.dtype)
    shapes = q, b, h, q, solved, h, q, b, h

    def solve(*parts: Any) -> tuple[np.ndarray, ...]:
        stack = Stack([np.array(part, float) for part in parts], dict(settings))
        found = *stack.solution, stack.solved, *stack.faces()
        return tuple(v.astype(q.dtype) for v in found)

    return jax.pure_callback(solve, shapes, *data, vmap_method="expand_dims")


@solution.defjvp
def with_derivative(settings: Any, primals: Any, tangents: Any) -> Any:
    found = solution(settings, *primals)
    return found, derivative(found, *primals, *tangents)


@jax.jit
def derivative(found: Any, data: Any, changes: Any) -> tuple[jax.Array, ...]:
    solved = found[4] == 1.0
    # where nothing is solved, NaN must not meet the derivatives, not even times 0
    x, P, _, G, _, A, *_ = (jnp.where(solved, v, 0.0) for v in (found[0], *data))
    rows, side, y, z = found[5:]
    point = Point(x, y, z, found[3])
    d = dict(zip(AXES, changes, strict=True))
    of_x, of_y, of_z, moved = right_sides(d, point, side)
    right = jnp.concatenate((of_x, of_z, of_y))
    C, v = jnp.concatenate((G, A)), jnp.concatenate((z, y))
    H = jnp.block([[P, C.T], [C, jnp.zeros_like(jnp.outer(v, v))]])
    free = jnp.where(side == 0.0, 1.0, 0.0)
    t = jnp.concatenate((free, rows, jnp.ones_like(y)))
    sign = jnp.concatenate((jnp.ones_like(x), -jnp.ones_like(v)))
    K = t[:, None] * H * t + jnp.diag(sign * (1.0 - t))
    w = jnp.concatenate(((1.0 - free) * moved, jnp.zeros_like(v)))
    w += t * solve_symmetric(K, t * (right - H @ w), sign)

    dx, dz, dy = jnp.split(w, (x.size, x.size + z.size))
    dz_box = (free - 1.0) * (H @ w - right)[: x.size]
    dx, dy, dz, dz_box = (jnp.where(solved, v, 0.0) for v in (dx, dy, dz, dz_box))
    return dx, dy, dz, dz_box, *map(jnp.zeros_like, found[4:7]), dy, dz


def solve_symmetric(K: jax.Array, rhs: jax.Array, sign: jax.Array) -> jax.Array:
    """Solve K w = rhs, nearly by the solution of least norm where K is singular.

    K is semidefinite where sign is 1, negative where it is -1.
    """
    size = jax.lax.stop_gradient(jnp.abs(K).max(axis=1, initial=0.0))
    scale = 1.0 / jnp.sqrt(jnp.where(size > 0.0, size, 1.0))
    K = scale[:, None] * K * scale
    shift = jnp.finfo(K.dtype).eps ** SHIFT
    factors = jax.scipy.linalg.lu_factor(K + shift * jnp.diag(sign))

    def solve(product: Callable[[Any], Any], right: jax.Array) -> jax.Array:
        w = jax.scipy.linalg.lu_solve(factors, right)
        for _ in range(REFINEMENTS):
            w += jax.scipy.linalg.lu_solve(factors, right - product(w))
        return w

    product = partial(jnp.matmul, K)
    return scale * jax.lax.custom_linear_solve(
        product, scale * rhs, solve, symmetric=True
    )
