"""Loops over the entries of arrays, for the checks of arguments."""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs, isinf


def is_bad(values, infinite_allowed):
    """Tell whether a NaN (or an infinite value unless allowed) is among the values."""
    bad: Py_ssize_t = 0
    for i in range(values.shape[0]):
        v = fabs(values[i])
        bad += not (v <= INFINITY if infinite_allowed else v < INFINITY)
    return bad > 0


def is_moderate(values, most):
    """Tell whether all values are below `most` in modulus; False for NaN."""
    bad: Py_ssize_t = 0
    for i in range(values.shape[0]):
        bad += not fabs(values[i]) < most
    return bad == 0


def has_huge(values, most):
    """Tell whether a value is finite, but not below `most` in modulus."""
    for i in range(values.shape[0]):
        if fabs(values[i]) >= most and not isinf(values[i]):
            return True
    return False


def dense_asymmetry(P):
    """Return (max |P - P'|, max |P|)."""
    gap, size = 0.0, 0.0
    for i in range(P.shape[0]):
        size = max(size, fabs(P[i, i]))
        for j in range(i):
            gap = max(gap, fabs(P[i, j] - P[j, i]))
            size = max(size, max(fabs(P[i, j]), fabs(P[j, i])))
    return gap, size


def sparse_asymmetry(indptr, indices, data):
    """Return (max |P - P'|, max |P|) of a canonical square CSR or CSC matrix.

    Entries (i, j) come in ascending order of i, so follow[j] moves once along row j.
    """
    n = indptr.shape[0] - 1
    gap, size = 0.0, 0.0
    follow: cython.int[::1] = np.array(indptr[:n], np.int32)
    for i in range(n):
        for t in range(indptr[i], indptr[i + 1]):
            j, value = indices[t], data[t]
            size = max(size, fabs(value))
            if j <= i:
                continue
            s = follow[j]
            while s < indptr[j + 1] and indices[s] < i:
                gap = max(gap, fabs(data[s]))  # no partner above the diagonal
                s += 1
            if s < indptr[j + 1] and indices[s] == i:
                gap = max(gap, fabs(value - data[s]))
                s += 1
            else:
                gap = max(gap, fabs(value))
            follow[j] = s
    for j in range(n):
        for s in range(follow[j], indptr[j + 1]):
            if indices[s] < j:
                gap = max(gap, fabs(data[s]))
    return gap, size
