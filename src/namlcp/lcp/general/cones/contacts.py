"""The contacts with friction in a matrix.

A speed is an unknown with a diagonal entry 0, whose column has d entries v_j > 0, and
whose row has -v_j there and one entry more.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

SAME = 1e-11
"""Largest difference of entries of M, whose diagonal is 1 or 0, that are taken for
equal: the directions of friction are combinations of the first ones to rounding."""


class Cones(NamedTuple):
    """The friction cones of k contacts with d directions in p dimensions.

    g, normal (k,): indices of the speeds and of the normal impulses x_l. b (k, d):
    those of the impulses along the directions, the first p a basis. kappa (k,) and
    v (k, d): entries of M. c (k, d, p): tau_j / v_j. remaining: indices of what is not
    eliminated, all unknowns but g and b[:, p:].
    """

    g: np.ndarray
    normal: np.ndarray
    b: np.ndarray
    kappa: np.ndarray
    v: np.ndarray
    c: np.ndarray
    remaining: np.ndarray


def cones_of(M: Any) -> Cones | None:
    """Return the friction cones in a sparse M, None if there are none that fit."""
    M = sparse.csr_array(M)
    by_columns = sparse.csc_array(M)
    g = np.flatnonzero(M.diagonal() == 0.0)
    columns, rows = by_columns[:, g], M[g]
    sizes = np.diff(columns.indptr)
    if g.size == 0 or sizes[0] < 2 or (sizes != sizes[0]).any():
        return None
    d, p = int(sizes[0]), 1 if sizes[0] == 2 else 2
    b, v = columns.indices.reshape(-1, d), columns.data.reshape(-1, d)
    if (v <= 0.0).any() or np.unique(b).size < b.size:
        return None
    rest = sparse.csr_array(rows + columns.T)
    rest.data[np.abs(rest.data) <= SAME] = 0.0
    rest.eliminate_zeros()
    if (np.diff(rest.indptr) != 1).any():
        return None
    if np.isin(rest.indices, np.append(g, b)).any():
        return None
    gram = np.empty((g.size, d, p))
    for j in range(d):
        for i in range(p):
            gram[:, j, i] = M[b[:, j], b[:, i]]
    if np.abs(np.linalg.det(gram[:, :p])).min() <= SAME:
        return None
    # the rows of d directions are combinations tau of the first p
    tau = gram @ np.linalg.inv(gram[:, :p])
    eliminated = np.concatenate((g, b[:, p:].ravel()))
    remaining = np.setdiff1d(np.arange(M.shape[0]), eliminated)
    cones = Cones(g, rest.indices, b, rest.data, v, tau / v[:, :, None], remaining)
    return cones if spans(M, cones, tau) else None


def spans(M: Any, cones: Cones, tau: np.ndarray) -> bool:
    """Tell whether M = U N U' but for the rows and columns of the speeds."""
    n, (_, d, p) = M.shape[0], tau.shape
    plain = np.setdiff1d(cones.remaining, cones.b[:, :p])
    position = np.empty(n, dtype=np.intp)
    position[cones.remaining] = np.arange(cones.remaining.size)
    row = np.repeat(cones.b.ravel(), p)
    column = position[np.repeat(cones.b[:, None, :p], d, axis=1)].ravel()
    U = sparse.csr_array(
        (
            np.append(np.ones(plain.size), tau.ravel()),
            (np.append(plain, row), np.append(position[plain], column)),
        ),
        shape=(n, cones.remaining.size),
    )
    other = np.ones(n)
    other[cones.g] = 0.0
    left = sparse.diags_array(other)
    difference = left @ M @ left - U @ M[cones.remaining][:, cones.remaining] @ U.T
    return float(np.abs(difference.data).max(initial=0.0)) <= SAME
