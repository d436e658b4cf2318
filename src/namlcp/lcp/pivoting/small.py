"""Small dense LCPs as they come to `solve_lcp`, by pivoting: one call, at most.

What is not clean, or not solved, is left to the ways that take a closer look.
"""

from time import perf_counter

import cython
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import INFINITY, fabs
from cython.cimports.namlcp.lcp.loops import MOST_SMALL, affine_at, are_ordinary
from cython.cimports.namlcp.lcp.pivoting.pivot import (
    DONE,
    GO_ON,
    RAY,
    advance,
    begin_pivoting,
)
from cython.cimports.namlcp.lcp.pivoting.state import Pivoting, allocate, best_point
from cython.cimports.namlcp.linalg.arrays import data_of, fits, new_vector
from cython.cimports.namlcp.linalg.vectors import copy, fill, hash_of
from cython.cimports.namlcp.measure import are_met, both_residuals
from cython.cimports.namlcp.result_base import LCPResultBase, made

from namlcp.lcp.pivoting import driver
from namlcp.linalg import definite
from namlcp.status import Status

cnp.import_array()

ACCURACY, SOLVED, NAME = driver.ACCURACY, Status.SOLVED, "pivoting"
# Factorisations at most: nothing looks at the clock between them.
MOST = 100
SYMMETRY_ROUNDING = definite.SYMMETRY_ROUNDING


def solve_small(kind, begun, given, A, q, lower, upper, start, stamp):
    """Solve a box LCP of up to MOST_SMALL unknowns to the default tolerance.

    given: A as the user holds it. Bounds that are None are 0 and inf; start: where to
    begin, or None; stamp: that of A, None if it is not known; begun: the value of
    perf_counter() at the call. Returns a result, of a class derived from
    `LCPResultBase`; None where others are to solve it.
    """
    if not (fits(A, 2) and fits(q, 1)):
        return None
    n: cython.Py_ssize_t = cnp.PyArray_DIM(q, 0)
    if not 0 < n <= MOST_SMALL:
        return None
    if cnp.PyArray_DIM(A, 0) != n or cnp.PyArray_DIM(A, 1) != n:
        return None
    if not (is_vector(lower, n) and is_vector(upper, n) and is_vector(start, n)):
        return None
    values = data_of(A)
    total, gap = sum_and_asymmetry(values, n)
    if not total < INFINITY or 0.0 < gap <= SYMMETRY_ROUNDING * total:
        return None
    m: Pivoting = Pivoting.__new__(Pivoting)
    m.n, m.entries, m.is_dense, m.symmetric = n, n * n, True, gap == 0.0
    m.given = A if m.symmetric else A.T.copy()
    m.values = data_of(m.given)
    allocate(m)
    copy(data_of(q), m.q, n)
    low, high = bound(lower, 0.0, m.lower, n), bound(upper, INFINITY, m.upper, n)
    if not are_ordinary(m.q, low, high, n):
        return None
    if start is not None:
        copy(data_of(start), m.own_z, n)
    m.eps_rel = ACCURACY
    code: cython.int = begin_pivoting(m)
    while code in (GO_ON, RAY) and m.factorisations < MOST:
        code = advance(m)
    if code != DONE:
        return None
    z, w, s = best_point(m, low, high), new_vector(n), new_vector(n)
    at_z, at_w, at_s = data_of(z), data_of(w), data_of(s)
    affine_at(values, at_z, data_of(q), at_w, n)
    for i in range(n):
        m.y[i] = 1.0 / m.root[i]
        slope = values[i * (n + 1)]
        at_s[i] = at_z[i] - at_w[i] / (slope if slope > 0.0 else 1.0)
    residual, scaled = both_residuals(at_z, at_w, low, high, m.y, n)
    if not are_met(0.0, ACCURACY, m.size, residual, scaled):
        return None
    if residual != 0.0 and not 1e-100 < residual < 1e100:
        return None  # sums of squares have left the range
    vectors = q, lower, upper
    if lower is None or upper is None:
        vectors = tuple([v for v in vectors if v is not None])
    total: cython.ulonglong = hash_of(values, n * n, 0) if stamp is None else stamp
    for v in vectors:
        total = hash_of(data_of(v), n, total)
    result: LCPResultBase = made(kind)
    result.status, result.z, result.w, result.s = SOLVED, z, w, s
    result.iterations, result.residual, result.method = m.factorisations, residual, NAME
    result.message, result.stamp = "", (total, vectors)
    result.problem = given, bool(m.symmetric), q, lower, upper
    result.solve_time = perf_counter() - begun
    return result


def is_vector(value, n):
    return value is None or (fits(value, 1) and cnp.PyArray_DIM(value, 0) == n)


def sum_and_asymmetry(A, n):
    """Return the sum of |A_ij|, NaN if one is, and max |A - A'|."""
    total, gap = 0.0, 0.0
    for i in range(n):
        for j in range(n):
            total += fabs(A[i * n + j])
        for j in range(i):
            gap = max(gap, fabs(A[i * n + j] - A[j * n + i]))
    return total, gap


def bound(value, default, out, n):
    """Write the bounds to `out`; return where they stay as they are if scaled."""
    if value is None:
        fill(out, default, n)
        return out
    copy(data_of(value), out, n)
    return data_of(value)
