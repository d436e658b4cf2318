"""What `backward` and `forward` return, and the outer products that they ask for."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.arrays import fits, from_arrays
from namlcp.checks import matrix, refuse_number, sparse_matrix, vector
from namlcp.derivatives.dense import add_rank_two_at, rank_two
from namlcp.qp.problem import Point


class QPTangent(NamedTuple):
    """How the solution of a QP changes: derivatives along one direction of the data.

    Attributes
    ----------
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Derivatives of the parts of a `QPResult`.
    weak, singular : int, bool
        As in `QPGradients`; where weak > 0, the derivative depends on the sign of the
        direction.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    weak: int
    singular: bool


def formed(name: str) -> Any:
    found = cached_property(lambda gradients: gradients.matrix(name))
    found.__doc__ = f"The gradient in {name}."
    return found


@dataclass(eq=False)
class QPGradients:
    """Gradients of a scalar in the data of a QP, from its gradient in the solution.

    Attributes
    ----------
    q, h, b, lb, ub : array
        Shaped as the data; (0,) where h or b was not given, 0 where a bound is infinite
        or was not given. Of a pinned variable (lb_j = ub_j) only the two bounds moved
        together have a derivative: it stands at the bound that the multiplier presses
        on.
    P, G, A : array or sparse array
        Formed at the first access. Sparse where the matrix was given so, on its stored
        entries (CSR for CSR, else CSC). That of P is symmetric: the scalar changes by
        the sum of P_ij dP_ij over all i and j, for a symmetric dP.
    weak : int
        How many constraints are active with a multiplier 0. The solution has a kink
        there; the gradients are those of the QP without these constraints, one of the
        limits of gradients nearby.
    singular : bool
        Whether the KKT system of the strictly active constraints is singular.
    """

    q: np.ndarray
    h: np.ndarray
    b: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    weak: Any
    singular: Any
    matrix: Callable[[str], Any] = field(repr=False)
    """Returns the gradient in P, G or A by its name."""

    P, G, A = map(formed, "PGA")


@dataclass(eq=False, repr=False)
class BatchGradients(QPGradients):
    """Gradients of a scalar in the data of a batch of QPs.

    Attributes
    ----------
    P, q, G, h, A, b, lb, ub : array or sparse array
        With a leading axis of the items where the argument had one; else, as it was
        shared, the sum over all items. P, G and A are formed at the first access.
    used : (N,) bool array
        Which items were solved; the others have gradients 0.
    weak, singular : (N,) array
        As in `QPGradients`, for each item.
    """

    used: np.ndarray


def change(name: str, value: Any, other: str, own: Any) -> Any:
    """Return finite numbers of the caller, shaped as `own` is.

    In place of None there is a vector of zeros, of a matrix None.
    """
    if value is None:
        return np.zeros(own.size) if own.ndim == 1 else None
    if own.ndim == 1:
        if not (fits(value, 1) and value.size == own.size):
            value = vector(name, value, own.size, other, own.shape)
        refuse_number(name, value, False)
        return value
    C = matrix(name, value, "csc")
    if C.shape != own.shape:
        raise ValueError(
            f"{name} must have shape {own.shape} to match {other}, got {C.shape}"
        )
    refuse_number(name, C, False)
    return C


def rank_two_on(pattern: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """Return a b' + c d' as an array, or on the entries of a sparse `pattern`.

    The vectors may have a leading axis, of sums to be added up.
    """
    if not sp.issparse(pattern):
        return rank_two(a, b, c, d) if a.ndim == 1 else a.T @ b + c.T @ d
    if pattern.format == "csr":
        return rank_two_on(pattern.T, b, a, d, c).T
    pattern = sparse_matrix("pattern", pattern, "csc")
    indptr, indices, data = pattern.indptr, pattern.indices, np.zeros(pattern.nnz)
    for vectors in zip(*map(np.atleast_2d, (a, b, c, d)), strict=True):
        add_rank_two_at(pattern, *vectors, data)
    return from_arrays((indptr.copy(), indices.copy(), data), pattern.shape)


def matrix_gradient(
    given: tuple[Any, ...],
    vectors: Sequence[np.ndarray],
    point: Point,
    name: str,
    stacked: Collection[str] = (),
) -> Any:
    """Return the gradient in P, G or A from those in q, h and b, the first `vectors`.

    It has a leading axis of items if that is stacked.
    """
    (of_q, of_h, of_b), (x, y, z, _) = vectors[:3], point
    if name == "P":
        half = 0.5 * x
        a, b, c, d = of_q, half, half, of_q
    else:
        a, b, c, d = (z, of_q, -of_h, x) if name == "G" else (y, of_q, -of_b, x)
    if name in stacked:
        return a[:, :, None] * b[:, None] + c[:, :, None] * d[:, None]
    return rank_two_on(given["PGA".index(name)], a, b, c, d)


def right_sides(d: dict[str, Any], point: Point, side: Any) -> tuple[Any, ...]:
    """Return -(dP x + dq + dG'z + dA'y), db - dA x, dh - dG x and dub or dlb.

    The last one for x_j whose side is not 0. Of dP the symmetric part counts. All may
    have a leading axis, or the changes none. Absent changes, or None, are 0.
    """
    x, y, z, _ = point
    dP, dG, dA = map(d.get, "PGA")
    dq, db, dh, dlb, dub = (d.get(name, 0.0) for name in ("q", "b", "h", "lb", "ub"))

    def times(M: Any, v: Any) -> Any:
        return 0.0 if M is None else (M @ v[..., None])[..., 0]

    def turned(v: Any, M: Any) -> Any:
        return 0.0 if M is None else (v[..., None, :] @ M)[..., 0, :]

    r = dq + 0.5 * (times(dP, x) + turned(x, dP)) + turned(z, dG) + turned(y, dA)
    moved = (side > 0) * dub + (side <= 0) * dlb
    return -r, db - times(dA, x), dh - times(dG, x), moved


class LCPTangent(NamedTuple):
    """How the solution of an LCP changes: derivatives along one direction of the data.

    Attributes
    ----------
    z, w : (n,) array
        Derivatives of the parts of an `LCPResult`.
    weak, singular : int, bool
        As in `LCPGradients`; where weak > 0, the derivative depends on the sign of the
        direction.
    """

    z: np.ndarray
    w: np.ndarray
    weak: int
    singular: bool


@dataclass(eq=False)
class LCPGradients:
    """Gradients of a scalar in the data of a box LCP, from its gradient in z and w.

    Attributes
    ----------
    q, lower, upper : (n,) array
        0 where a bound is infinite. Of an unknown with lower_i = upper_i only the two
        bounds moved together have a derivative: it stands at the bound that w_i presses
        on.
    A : array or sparse array
        Formed at the first access; sparse where A was given so, on its stored entries
        (CSR for CSR, else CSC). All entries of A count as independent.
    weak : int
        How many unknowns are at a bound with w = 0. The solution has a kink there; the
        gradients are those with these unknowns free, one of the limits of gradients
        nearby.
    singular : bool
        Whether A_FF is singular, F all unknowns with w = 0.
    """

    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    weak: int
    singular: bool
    matrix: Callable[[str], Any] = field(repr=False)

    A = formed("A")
