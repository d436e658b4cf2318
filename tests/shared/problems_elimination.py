"""Patterns to eliminate, and the definition of fill."""

import numpy as np
from scipy.sparse import csc_array, diags_array, eye_array, kron, triu

from namlcp.linalg.ordering import postordered


def laplacian(rows, columns, shift=0.1):
    """Return the five-point matrix of a grid plus shift * I."""
    sides = [
        diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(k, k))
        for k in (rows, columns)
    ]
    one = kron(sides[0], eye_array(columns))
    other = kron(eye_array(rows), sides[1])
    return csc_array(one + other + shift * eye_array(rows * columns))


def quasi_definite(n, p, density, seed):
    """Return [P A'; A -D] with random sparse parts, dense, in random order."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((p, n)) * (rng.random((p, n)) < density)
    P = np.diag(1.0 + rng.random(n))
    B = rng.standard_normal((n, n)) * (rng.random((n, n)) < density / 4)
    K = np.block([[P + B @ B.T, A.T], [A, -np.diag(0.1 + rng.random(p))]])
    order = rng.permutation(n + p)
    return K[np.ix_(order, order)]


def upper(K):
    """Return the upper triangle with a full diagonal in CSC with int32 indices."""
    U = csc_array(triu(csc_array(K), format="csc"))
    U.sort_indices()
    parts = U.data, U.indices.astype(np.int32), U.indptr.astype(np.int32)
    return csc_array(parts, shape=U.shape)


def natural(U):
    """Return the order in which the rows come, but for the postorder."""
    place = np.arange(U.shape[0], dtype=np.int32)
    return postordered(*parts(U), place)


def parts(U):
    """Return indptr and indices."""
    return U.indptr, U.indices


def fill(K):
    """Return the pattern of L for a dense pattern, by elimination."""
    L = K != 0
    for j in range(L.shape[0]):
        below = np.flatnonzero(L[j + 1 :, j]) + j + 1
        L[np.ix_(below, below)] = True
    return np.tril(L)
