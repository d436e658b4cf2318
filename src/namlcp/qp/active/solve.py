"""The door to the active-set method: from the user's arrays to a result, and back.

`solve_small` is for one dense QP as it comes from the user. `DenseActiveSet.attach` and
`solve` serve those who keep the object, which holds what a solve leaves for the next
one: V, T, U, responses, and the active rows to begin with. What it returns depends on
the data alone, not on the solves before, up to the rounding errors of degenerate QPs.
"""

from time import perf_counter

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.linalg.vectors import fill
from cython.cimports.namlcp.outcome import Outcome, Settings, new_outcome
from cython.cimports.namlcp.qp.active.dense import DenseActiveSet
from cython.cimports.namlcp.qp.active.run import solve_dense
from cython.cimports.namlcp.qp.active.state import DONE, begin_watch, make_room
from cython.cimports.namlcp.qp.active.weight import NO_WEIGHT

from namlcp.status import Status

cnp.import_array()

SOLVED = Status.SOLVED
NO_ENTRIES = np.empty(0)
# MOST_ORDER: most variables, equations and rows of a QP that is solved without BLAS.
# MOST_BOX: most variables of one with bounds alone, which is quicker as a box LCP else.
# FEW_ENTRIES: most entries, zeros included, of a QP that takes P + W whatever it is; a
# larger one is left to the interior point where less than FULL of them are not zero.
FULL = 0.3
# Operations of pivots from which on the interior-point method is quicker, for each one
# of n^2 (n + m + p); and a number, some tens of milliseconds, that is never too large.
# (Linear programs take 10 to 30 of these units, other QPs 1 to 4.)
MOST_OPERATIONS, FEW_OPERATIONS = 4.0, 2e8


def fits(value, ndim):
    """Tell whether a value can go to compiled code as it is."""
    if not cnp.PyArray_CheckExact(value):
        return False
    array: cnp.ndarray = value
    return (
        cnp.PyArray_TYPE(array) == cnp.NPY_DOUBLE
        and cnp.PyArray_NDIM(array) == ndim
        and cnp.PyArray_ISCARRAY_RO(array)
    )


def numbers(array):
    """Return where the entries of an array are."""
    own: cnp.ndarray = array
    return cython.cast(cython.p_double, cnp.PyArray_DATA(own))


def new_vector(size):
    """Return a vector that is not set."""
    if size == 0:
        return NO_ENTRIES
    return cnp.PyArray_EMPTY(1, cython.address(size), cnp.NPY_DOUBLE, 0)


def filled(values, count):
    """Return how many of the values are not zero."""
    found: Py_ssize_t = 0
    for i in range(count):
        found += values[i] != 0.0
    return found


def are_full(m):
    """Tell whether the matrices have few entries, or few zeros."""
    n = m.n
    entries = n * (n + m.m + m.p)
    if entries <= FEW_ENTRIES:
        return True
    found = filled(m.P, n * n) + filled(m.G, m.m * n) + filled(m.A, m.p * n)
    return found >= FULL * entries


def take_settings(m, settings, start):
    """Note tolerances and limits; start: the perf_counter() at the call."""
    m.eps_abs, m.eps_rel = settings.eps_abs, settings.eps_rel
    m.max_iter = settings.max_iter
    begin_watch(m, start + settings.time_limit)


def run(m):
    """Solve the QP at hand: m.code tells how it ended, m.point has x, y, z and z_box.

    Raises what a signal's handler has raised.
    """
    x, y, z = new_vector(m.n), new_vector(m.p), new_vector(m.m)
    z_box = new_vector(m.n)
    m.point = x, y, z, z_box
    m.x, m.y, m.z, m.z_box = numbers(x), numbers(y), numbers(z), numbers(z_box)
    with cython.nogil:
        m.code = solve_dense(cython.cast(DenseActiveSet, m))
    if m.interrupted:
        raise m.error
    return 0


def result_of(m, kind, problem, start, ready):
    """Return the solved result of a class."""
    result: Outcome = new_outcome(kind)
    result.status, result.form = SOLVED, "dual"
    result.x, result.y, result.z, result.z_box = m.point
    result.numbers, result.obj = m.found, m.found.objective
    result.iterations, result.problem = m.pivots, problem
    result.setup_time, result.solve_time = ready - start, perf_counter() - ready
    return result


def rows_of(C, d, n):
    """Return the rows of a clean pair like G and h with n columns, -1 if it is none."""
    if not (fits(C, 2) and fits(d, 1)):
        return -1
    rows = cnp.PyArray_DIM(d, 0)
    if cnp.PyArray_DIM(C, 0) != rows or cnp.PyArray_DIM(C, 1) != n:
        return -1
    return rows


def is_bound(side, n):
    """Tell whether a clean vector of n bounds came, or none."""
    return side is None or (fits(side, 1) and cnp.PyArray_DIM(side, 0) == n)


def solve_small(kind, P, q, G, h, A, b, lb, ub, settings: Settings, start, keeps):
    """Solve a small dense QP whose arguments are clean; None where they are not.

    Returns its result, of a class derived from `Outcome`, or the `DenseActiveSet` that
    has tried in vain. keeps: let the result have the factors.
    """
    if not fits(q, 1):
        return None
    n = cnp.PyArray_DIM(q, 0)
    rows: Py_ssize_t = 0
    p: Py_ssize_t = 0
    if G is not None or h is not None:
        rows = rows_of(G, h, n)
    if A is not None or b is not None:
        p = rows_of(A, b, n)
    if rows_of(P, q, n) < 0 or rows < 0 or p < 0 or n + rows + p > MOST_ORDER:
        return None
    if not (is_bound(lb, n) and is_bound(ub, n)) or (n > MOST_BOX and rows + p == 0):
        return None
    m: DenseActiveSet = DenseActiveSet.__new__(DenseActiveSet)
    m.n, m.m, m.p, m.is_single = n, rows, p, True
    m.matrices = m.vectors = problem = P, q, G, h, A, b, lb, ub
    m.P, m.q = numbers(P), numbers(q)
    if rows > 0:
        m.G, m.h = numbers(G), numbers(h)
    if p > 0:
        m.A, m.b = numbers(A), numbers(b)
    make_room(m)
    set_bounds(m, lb, ub)
    set_limits(m)
    take_settings(m, settings, start)
    ready = perf_counter()
    run(m)
    if m.code != DONE:
        return m
    result: Outcome = result_of(m, kind, problem, start, ready)
    result.stamp = stamp_of(m)
    if keeps and m.rho == 0.0:
        result.factors = m
    return result


def set_bounds(m, lb, ub):
    """Note bounds, which may be absent."""
    m.lb, m.ub = m.no_bound, m.no_bound + m.n
    if lb is None:
        fill(m.no_bound, -INFINITY, m.n)
    else:
        m.lb = numbers(lb)
    if ub is None:
        fill(m.no_bound + m.n, INFINITY, m.n)
    else:
        m.ub = numbers(ub)


def set_limits(m):
    """Set what a solve may take, and whether P + W may take the place of P."""
    order, unit = m.n + m.m + m.p, cython.cast(cython.double, m.n * m.n)
    m.is_large = order > MOST_ORDER
    m.most_operations = max(FEW_OPERATIONS, MOST_OPERATIONS * unit * order)
    m.wanted = 0.0 if are_full(m) else NO_WEIGHT


# ---- those who keep the object


def attach(m: DenseActiveSet, P, G, A):
    """Let an object be for QPs with these matrices, which are clean and not copied."""
    m.matrices = P, G, A
    m.n, m.m, m.p = P.shape[0], G.shape[0], A.shape[0]
    m.P, m.G, m.A = numbers(P), numbers(G), numbers(A)
    make_room(m)
    set_limits(m)


def suggest(m: ActiveSet, active):
    """Begin the next solve with rows that are probably active, as `Guess` has them.

    None are noted if there are too many of them.
    """
    m.kept_k, m.hints = 0, 0
    for i in np.flatnonzero(active).tolist():
        if m.hints == m.most:
            m.hints = 0
            return
        m.kept_active[m.hints] = i if i < m.rows else i - m.n
        m.kept_side[m.hints] = -1 if m.m <= i < m.rows else 1
        m.hints += 1


def solve(m: ActiveSet, vectors, settings: Settings, start):
    """Solve the QP with q, h, b, lb and ub, one after another; return the code."""
    at = numbers(vectors)
    m.vectors = vectors
    m.q, m.h, m.b = at, at + m.n, at + m.n + m.m
    m.lb = at + m.n + m.m + m.p
    m.ub = m.lb + m.n
    take_settings(m, settings, start)
    run(m)
    return m.code


def step(m: ActiveSet, kind, vectors, problem, settings: Settings, start):
    """Do `solve`; return the result of a class, None where it is not DONE."""
    if solve(m, vectors, settings, start) != DONE:
        return None
    return result_of(m, kind, problem, start, start)


def found_numbers(m: ActiveSet):
    """Return the numbers of `Residuals` of the point."""
    return m.found


# ---- the stamp


def add_stamp(values, count, total):
    """Add a hash of the bits and places of numbers to a sum (mod 2^64).

    Each term is two rounds of the mixing of SplitMix64 (Steele, Lea and Flood, 2014).
    """
    bits = cython.cast(cython.pointer(cython.ulonglong), values)
    v: cython.ulonglong
    step: cython.ulonglong = 0x9E3779B97F4A7C15
    factor: cython.ulonglong = 0xBF58476D1CE4E5B9
    for i in range(count):
        v = bits[i] + cython.cast(cython.ulonglong, i) * step
        v = (v ^ (v >> 32)) * factor
        total += v ^ (v >> 29)
    return total


def stamp_of(m):
    """Return a hash of all numbers of the QP at hand."""
    n, total = m.n, cython.cast(cython.ulonglong, 0)
    total = add_stamp(m.P, n * n, total)
    total = add_stamp(m.G, m.m * n, total)
    total = add_stamp(m.A, m.p * n, total)
    total = add_stamp(m.q, n, total)
    total = add_stamp(m.h, m.m, total)
    total = add_stamp(m.b, m.p, total)
    total = add_stamp(m.lb, n, total)
    return add_stamp(m.ub, n, total)


def stamp_of_arrays(arrays):
    """Return the hash of `stamp_of` for P, G, A, q, h, b, lb and ub."""
    total = cython.cast(cython.ulonglong, 0)
    for array in arrays:
        total = add_stamp(numbers(array), array.size, total)
    return total
