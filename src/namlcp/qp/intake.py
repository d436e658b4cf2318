"""The arguments of a QP, checked in one pass where they are clean already.

Everything else, and every fault, is left to `problem`, which repairs or names it.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import INFINITY, fabs
from scipy.sparse import csc_array, csc_matrix

from namlcp import checks
from namlcp.arrays import from_arrays
from namlcp.qp.problem import QP, absent_parts, qp_arrays, repaired

cnp.import_array()

# What counts as no bound, see `checks`.
INFINITE = checks.INFINITE


def qp_data(P, q, G, h, A, b, lb, ub):
    """Return the user's QP as checked, clean arrays."""
    P, G, A = shortened(P), shortened(G), shortened(A)
    if is_clean(P, q, G, h, A, b, lb, ub):
        return whole(P, q, G, h, A, b, lb, ub)
    qp = qp_arrays(P, q, G, h, A, b, lb, ub)
    P, q, G, h, A, b, lb, ub = qp
    return qp if is_clean(P, q, G, h, A, b, lb, ub) else repaired(qp)


def whole(P, q, G, h, A, b, lb, ub):
    """Return the QP of clean arguments, but for the order of dense matrices.

    Some may be None. Beside a sparse P all matrices become sparse.
    """
    P, G, A = by_rows(P), by_rows(G), by_rows(A)
    rows, sides, below, above = absent_parts(q.size)
    if not cnp.PyArray_CheckExact(P):
        rows, G, A = checks.no_rows(q.size), checks.as_sparse(G), checks.as_sparse(A)
    parts = (
        P, q,
        rows if G is None else G, sides if h is None else h,
        rows if A is None else A, sides if b is None else b,
        below if lb is None else lb, above if ub is None else ub,
    )  # fmt: skip
    return tuple.__new__(QP, parts)  # in half the time of QP(*parts)


def by_rows(M):
    return np.ascontiguousarray(M) if cnp.PyArray_CheckExact(M) else M


def shortened(M):
    """Return a matrix in CSC with its places in 32 bits, where they had 64 and fit."""
    if type(M) is not csc_array and type(M) is not csc_matrix:
        return M
    indptr, indices = M.indptr, M.indices
    if not (are_long(indptr) and are_long(indices)):
        return M
    places = narrowed(indptr), narrowed(indices)
    if places[0] is None or places[1] is None:
        return M
    return from_arrays((*places, M.data), M._shape)


def is_clean(P, q, G, h, A, b, lb, ub):
    """Tell whether arguments are the arrays of a QP: clean, finite and of its sizes.

    P is symmetric, the matrices are all dense or all in CSC, no side is huge. G and h,
    A and b, lb, ub may be None.
    """
    if not fits(q, 1):
        return False
    n: Py_ssize_t = cnp.PyArray_DIM(q, 0)
    is_dense: cython.bint = fits(P, 2)
    if (G is None) != (h is None) or (A is None) != (b is None):
        return False
    if (
        rows_of(P, n, is_dense) != n
        or not (h is None or (fits(h, 1) and rows_of(G, n, is_dense) == h.size))
        or not (b is None or (fits(b, 1) and rows_of(A, n, is_dense) == b.size))
        or is_bad(q, False)
        or (b is not None and is_bad(b, False))
        or not (h is None or is_side(h, 1.0, h.size))
        or not (lb is None or is_side(lb, -1.0, n))
        or not (ub is None or is_side(ub, 1.0, n))
    ):
        return False
    if is_dense:
        gap, _ = dense_asymmetry(P)
    else:
        gap, _ = sparse_asymmetry(P.indptr, P.indices, P.data)
    return gap == 0.0


def rows_of(M, n, is_dense):
    """Return the number of rows of a clean matrix with n columns, -1 if it is none."""
    if is_dense:
        if not (fits(M, 2) and cnp.PyArray_DIM(M, 1) == n):
            return -1
        return -1 if is_bad(M, False) else cnp.PyArray_DIM(M, 0)
    if type(M) is not csc_array and type(M) is not csc_matrix:
        return -1
    data, indices, indptr = M.data, M.indices, M.indptr
    if not (fits(data, 1) and are_places(indices) and are_places(indptr)):
        return -1
    shape: tuple = M._shape  # M.shape takes a call
    rows: Py_ssize_t = shape[0]
    size: Py_ssize_t = cnp.PyArray_DIM(indices, 0)
    is_whole: cython.bint = (
        shape[1] == n
        and cnp.PyArray_DIM(data, 0) == size
        and cnp.PyArray_DIM(indptr, 0) == n + 1
        and indptr[n] == size
        and index_order(indptr, indices, n, rows) == CANONICAL
        and not is_bad(data, False)
    )
    return rows if is_whole else -1


def is_side(array, sign, size):
    """Tell whether an array is a clean vector of sides, none of them NaN or huge.

    An infinite one has this sign.
    """
    if not (fits(array, 1) and cnp.PyArray_DIM(array, 0) == size):
        return False
    values = data_of(array)
    for i in range(size):
        if not (fabs(values[i]) < INFINITE or values[i] == sign * INFINITY):
            return False
    return True
