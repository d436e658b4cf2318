"""The door to the active-set method: from arrays to a result, or an `Outcome`.

`solve_small` is for one QP as it comes from the user, `solve_dense` for one on the
`route`, `solve_items` for a batch, the others for those who keep the object with what a
solve leaves for the next one. What it returns depends on the data alone, not on the
solves before, up to the rounding errors of degenerate QPs.
"""

from time import perf_counter

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import INFINITY, fabs
from cython.cimports.libc.string import memcpy
from scipy.sparse import csc_array, csc_matrix

from namlcp.linalg.csc import as_dense
from namlcp.linalg.threads import blas_threads
from namlcp.qp import problem
from namlcp.qp.problem import Point
from namlcp.status import Status

cnp.import_array()

# Objects that a small solve has no time to look up.
SOLVED, DUAL, clock = Status.SOLVED, "dual", perf_counter
# What a dense QP is found to be, by the codes that decide it.
OUTCOMES = {
    DONE: SOLVED,
    CONTRADICTION: Status.PRIMAL_INFEASIBLE,
    UNBOUNDED: Status.DUAL_INFEASIBLE,
}
# MOST_ORDER: most variables, equations and rows of a QP whose factors LAPACK does not
# make. MOST_BOX: most variables of one with bounds alone, which is quicker as a box LCP
# else. MOST_LINEAR, SPARSE_LINEAR: most variables of a linear program, dense or
# sparse, which interior points solve quicker else. TINY_ENTRIES: most entries, zeros
# included, of a sparse QP that `solve_small` takes.
# FEW_ENTRIES: most entries of a QP that takes P + W whatever it is; a larger one is
# left to the interior-point method where less than FULL percent of them are not zero.
# Operations of pivots after which the interior-point method takes over, about as many
# as take its time: FEW, and for each entry of P, G and A that is not zero PASSES, and
# for each variable OF_COST more where it is one of P, OF_ROWS where it is one of a row.
FEW_OPERATIONS, PASSES, OF_COST, OF_ROWS = 1e7, 200.0, 0.5, 2.0
# The sign of the infinity that means no bound in q, h, b, lb and ub.
OPEN_SIDES = 0.0, 1.0, 0.0, -1.0, 1.0
# Largest slack of a row that counts as active at a point, relative.
ACTIVE = problem.ACTIVE
# Operations of what is made anew, over those from which on a method gives up.
MOST_ANEW = 0.2
# MOST_LENGTH: most variables, rows and equations of a sparse QP together, as a response
# to a row has so many entries. BRIEF: most variables times all of these of a solve that
# keeps Python's lock: releasing it would take a tenth of the time.


def filled(values, count):
    found: Py_ssize_t = 0
    for i in range(count):
        found += values[i] != 0.0
    return found


def attach(m, P, G, A, is_single):
    """Let an object be for QPs with these matrices, which are clean and not copied."""
    m.is_single, m.matrices, m.m, m.p = is_single, (P, G, A), 0, 0
    m.n, m.P = cnp.PyArray_DIM(P, 0), data_of(P)
    if G is not None:
        m.m, m.G = cnp.PyArray_DIM(G, 0), data_of(G)
    if A is not None:
        m.p, m.A = cnp.PyArray_DIM(A, 0), data_of(A)
    make_room(m)
    m.is_large = m.rows + m.p > MOST_ORDER
    set_effort(m)
    return 0


def set_effort(m):
    """Choose from how many operations on others take over, and whether W is of use."""
    n, order = m.n, m.rows + m.p
    m.most_operations, m.wanted = FEW_OPERATIONS, 0.0
    if n * order > FEW_ENTRIES:
        cost, rows = filled(m.P, n * n), filled(m.G, m.m * n) + filled(m.A, m.p * n)
        m.most_operations += PASSES * (cost + rows)
        m.most_operations += n * (OF_COST * cost + OF_ROWS * rows)
        if 100 * (cost + rows) < FULL * n * order:
            m.wanted = NO_WEIGHT


def take_settings(m, settings, start):
    """Note `Options.settings` for a solve that began at this perf_counter()."""
    seconds: cython.double = settings[3]
    m.eps_abs, m.eps_rel, m.max_iter = settings[0], settings[1], settings[2]
    begin_watch(m, start + seconds)


def run(m):
    """Solve the QP at hand: m.code tells how that ended, m.point is the point."""
    x, y, z = new_vector(m.n), new_vector(m.p), new_vector(m.m)
    z_box = new_vector(m.n)
    m.point = x, y, z, z_box
    m.x, m.y, m.z, m.z_box = data_of(x), data_of(y), data_of(z), data_of(z_box)
    if m.n * m.length <= BRIEF:
        m.code = m.decide()
    else:
        with cython.nogil:
            m.code = m.decide()
    raise_kept(m)
    return 0


def result_of(m, kind, problem, start, ready):
    """Return the result of a class: solved, or with a certificate."""
    result: ResultBase = made(kind)
    result.status, result.form, result.message = SOLVED, DUAL, ""
    result.x, result.y, result.z, result.z_box = m.point
    result.numbers, result.obj = m.found, m.found.objective
    if m.code != DONE:
        result.status = OUTCOMES[m.code]
        result.obj = INFINITY if m.code == CONTRADICTION else -INFINITY
    result.iterations, result.problem = m.pivots, problem
    done: cython.double = clock()
    result.setup_time, result.solve_time = ready - start, done - ready
    return result


def height_of(C, d, n):
    """Return the rows of a clean pair like G and h with n columns, -1 if it is none."""
    if C is None and d is None:
        return 0
    if not (fits(C, 2) and fits(d, 1)):
        return -1
    rows = cnp.PyArray_DIM(d, 0)
    is_pair: cython.bint = cnp.PyArray_DIM(C, 0) == rows and cnp.PyArray_DIM(C, 1) == n
    return rows if is_pair else -1


def solve_small(
    kind, settings: tuple, start: cython.double, keeps, given: tuple, x0=None,
    warm_start=None,
):  # fmt: skip
    """Solve a small QP whose arguments are clean; None where they are not.

    given: P, q, G, h, A, b, lb, ub as they came. P, G and A are dense, or in CSC and
    tiny, zeros included. Returns its result, of a class derived from `ResultBase`; None
    if another method has to find it. keeps: let the result have the factors. x0,
    warm_start: as of `make_guess`.
    """
    P, q, G, h, A, b, lb, ub = given
    if not fits(q, 1):
        return None
    n, is_sparse = cnp.PyArray_DIM(q, 0), not cnp.PyArray_CheckExact(P)
    if is_sparse:
        P, G, A = tiny_form(P, n), tiny_form(G, n), tiny_form(A, n)
    elif n <= MOST_ORDER:
        P, G, A = small_form(P), small_form(G), small_form(A)
    is_copied: cython.bint = P is not given[0] or G is not given[2] or A is not given[4]
    rows, p = height_of(G, h, n), height_of(A, b, n)
    if height_of(P, q, n) < 0 or rows < 0 or p < 0 or n + rows + p > MOST_ORDER:
        return None
    if not (lb is None or is_vector(lb, n)) or not (ub is None or is_vector(ub, n)):
        return None
    if n > MOST_BOX and rows + p == 0:
        return None
    most: Py_ssize_t = SPARSE_LINEAR if is_sparse else MOST_LINEAR
    if n > most and filled(data_of(P), n * n) == 0:
        return None
    m: DenseActiveSet = DenseActiveSet.__new__(DenseActiveSet)
    attach(m, P, G, A, True)
    if is_copied and m.wanted == NO_WEIGHT:  # few entries: see `route.is_small`
        return None
    m.vectors, m.q = given, data_of(q)
    if rows > 0:
        m.h = data_of(h)
    if p > 0:
        m.b = data_of(b)
    fill(m.no_bound, -INFINITY, n)
    fill(m.no_bound + n, INFINITY, n)
    m.lb = m.no_bound if lb is None else data_of(lb)
    m.ub = m.no_bound + n if ub is None else data_of(ub)
    take_settings(m, settings, start)
    if warm_start is not None:
        if not suggest_solution(m, warm_start):
            return None
    elif x0 is not None and not suggest_point(m, x0):
        return None
    ready: cython.double = clock()
    run(m)
    if m.code != DONE and m.code not in OUTCOMES:
        return None
    result: ResultBase = result_of(m, kind, given, start, ready)
    result.stamp = stamp_of(given)
    if keeps and m.code == DONE and not is_sparse:
        result.factors = factors_of(m)
    return result


def small_form(C):
    """Return a small float64 matrix by columns as a copy by rows, others as given."""
    if C is None or fits(C, 2) or not cnp.PyArray_CheckExact(C):
        return C
    is_by_columns: cython.bint = fits(cnp.PyArray_Transpose(C, cython.NULL), 2)
    if not is_by_columns or cnp.PyArray_DIM(C, 0) > MOST_ORDER:
        return C
    return cnp.PyArray_NewCopy(C, cnp.NPY_CORDER)


def tiny_form(C, n):
    """Return a tiny clean matrix in CSC with n columns as an array, others as given."""
    if type(C) is not csc_array and type(C) is not csc_matrix:
        return C
    shape: tuple = C._shape  # C.shape takes a call
    is_tiny = n * (n + shape[0]) <= TINY_ENTRIES
    return as_dense(C) if is_tiny and rows_of(C, n, False) >= 0 else C


# ---- a QP on the route


def solve_dense(qp, chain, guess, judge, memory=None):
    """Solve a QP in dense form; None where another method has to, or a number is bad.

    chain: the way from the user's QP to this one.
    """
    limits, own = judge.limits, qp.in_dense_form()
    settings = *limits.tolerances, limits.max_iter, 0.0
    m: DenseActiveSet = DenseActiveSet.__new__(DenseActiveSet)
    attach(m, own.P, own.G, own.A, True)
    suggest(m, guess)
    solve(m, own.joined(), settings, limits.deadline.at)
    answer = answer_of(m, judge, chain)
    if own is judge.qp and answer is not None and answer.status is SOLVED:
        answer = answer._replace(factors=factors_of(m))
    return answer


def answer_of(m: ActiveSet, judge, chain):
    """Return the answer after a solve, None for other methods."""
    point, is_sparse = Point(*m.point), isinstance(m, SparseActiveSet)
    if m.code == DONE or m.code == SUMMED or m.code == LATE:
        judge.offer(chain.point(*point))
        if m.code == LATE:
            return judge.answer(Status.TIME_LIMIT, m.pivots, DUAL)
        return judge.answer(SOLVED, m.pivots, DUAL) if judge.is_solved else None
    if m.code not in OUTCOMES:
        return None
    zero = Point(*map(np.zeros_like, point))
    near = point if is_sparse else chain.point(*zero)
    if m.code == CONTRADICTION:
        proof = chain.point(*zero._replace(y=point.y, z=point.z), data=0.0)
        is_proved = judge.accept_multipliers(near.x, proof.y, proof.z)
    else:  # a sparse one leaves the ray in z_box
        ray = zero._replace(x=point.z_box if is_sparse else point.x)
        is_proved = judge.accept_ray(chain.point(*ray, data=0.0).x, near)
    return judge.answer(OUTCOMES[m.code], m.pivots, DUAL) if is_proved else None


# ---- those who keep the object


def kept_for(qp):
    """Return an `ActiveSet` for these matrices, which it holds.

    None where they are sparse, and so large or full that other methods are quicker.
    """
    n, p = qp.q.size, qp.b.size
    if not qp.is_dense and (p > n or n + qp.h.size + p > MOST_LENGTH):
        return None
    m = DenseActiveSet() if qp.is_dense else SparseActiveSet()
    renew(m, qp)
    return m if qp.is_dense or m.is_ready else None


def renew(m, qp):
    """Take other matrices of the same sizes; the active rows become a hint."""
    if qp.is_dense:
        attach(m, qp.P, qp.G, qp.A, False)
    else:
        m.attach(qp.P, qp.G, qp.A)


def is_slow_anew(m: ActiveSet):
    """Tell whether others are quicker after `renew`: all active rows need responses."""
    if not isinstance(m, SparseActiveSet):
        return False
    k, cost = m.k + m.hints, cython.cast(SparseActiveSet, m).response_operations
    return m.rho != 0.0 or k * cost + k**3 / 3 > MOST_ANEW * m.most_operations


def suggest(m: ActiveSet, guess):
    """Begin the next solve with the rows that are active in a `Guess`."""
    rows, last = m.m, m.rows
    marks = np.zeros(last)
    if guess.active.size > 0:
        marks[:] = guess.active[:last]
        marks[rows:] = np.where(guess.active[rows:last], -1.0, guess.active[last:])
    suggest_signs(m, data_of(marks), data_of(marks) + rows)


def suggest_signs(m, z, z_box):
    """Begin the next solve with the rows of these signs, with none if too many."""
    forget_rows(m)
    for row in range(m.rows):
        sign = z[row] if row < m.m else z_box[row - m.m]
        if sign > 0.0 or (sign < 0.0 and row >= m.m):
            if m.hints == m.most:
                forget_rows(m)
                return
            m.active[m.hints], m.side[row] = row, 1 if sign > 0.0 else -1
            m.hints += 1


def suggest_point(m, x0):
    """Begin with the rows that hold with equality at x0; False if it is no point."""
    n, rows, signs = m.n, m.m, m.s
    if not is_vector(x0, n) or is_bad(x0, False):
        return False
    x = data_of(x0)
    for i in range(rows):
        signs[i] = is_met(m.h[i], dot(m.G + i * n, x, n))
    for j in range(n):
        signs[rows + j] = -1.0 if is_met(m.lb[j], x[j]) else is_met(m.ub[j], x[j])
    suggest_signs(m, signs, signs + rows)
    return True


def is_met(side, value):
    """Tell whether a finite side is reached, as `make_guess` has it."""
    return fabs(side) < INFINITY and fabs(side - value) <= ACTIVE * (1.0 + fabs(side))


def suggest_solution(m, point):
    """Begin with the rows that have multipliers in a solution; False if it is none."""
    x, y = getattr(point, "x", m), getattr(point, "y", m)
    z, z_box = getattr(point, "z", m), getattr(point, "z_box", m)
    if x is None or y is None or z is None or z_box is None:
        return True  # it has no point: begin with no rows, as with a certificate
    if is_vector(z_box, 0):  # without bounds
        z_box = np.zeros(m.n)
    if not (is_vector(x, m.n) and is_vector(y, m.p)):
        return False
    if not (is_vector(z, m.m) and is_vector(z_box, m.n)):
        return False
    for part in (x, y, z, z_box):
        if is_bad(part, False):
            return True
    suggest_signs(m, data_of(z), data_of(z_box))
    return True


def is_vector(value, size):
    return fits(value, 1) and cnp.PyArray_DIM(value, 0) == size


def solve(m, vectors, settings, start):
    """Solve the QP with these vectors, see `QP.joined`; return the code."""
    m.vectors, m.q = vectors, data_of(vectors)
    m.h = m.q + m.n
    m.b = m.h + m.m
    m.lb = m.b + m.p
    m.ub = m.lb + m.n
    take_settings(m, settings, start)
    run(m)
    return m.code


def solve_next(
    m: ActiveSet, kind, problem: tuple, settings: tuple, start: cython.double, threads
):
    """Solve the QP with the vectors problem[1]; return the result, None if not DONE."""
    order = m.rows + m.p
    if order <= MOST_ORDER or (m.is_ready and m.rho == 0.0):
        solve(m, problem[1], settings, start)
    else:  # which may take LAPACK
        with blas_threads(threads, order, isinstance(m, DenseActiveSet)):
            solve(m, problem[1], settings, start)
    return result_of(m, kind, problem, start, start) if m.code == DONE else None


def updated(vectors, parts: tuple, sizes: tuple):
    """Return a copy of vectors, see `QP.joined`, with those parts that are not None.

    None where one of these takes a closer look.
    """
    total = cnp.PyArray_SIZE(vectors)
    made = new_vector(total)
    at = data_of(made)
    copy(data_of(vectors), at, total)
    for k in range(5):
        part, size = parts[k], cython.cast(Py_ssize_t, sizes[k])
        if part is not None:
            if not is_side(part, OPEN_SIDES[k], size):
                return None
            copy(data_of(part), at, size)
        at += size
    return made


# ---- batches


def solve_items(
    m: DenseActiveSet, arrays, stacked, first: Py_ssize_t, end: Py_ssize_t,
    settings: tuple, outs, codes, iterations,
):  # fmt: skip
    """Solve the items first to end - 1 of a batch, each from nothing.

    arrays: P, q, G, h, A, b, lb and ub, of all items where `stacked` says so; outs: the
    rows x, y, z, z_box and numbers of `Residuals` of all items.
    """
    n, rows, p = m.n, m.m, m.p
    data = cython.declare(cython.p_double[8])
    width = cython.declare(Py_ssize_t[8])
    out = cython.declare(cython.p_double[5])
    for k in range(8):
        array: cnp.ndarray = arrays[k]
        data[k] = data_of(array)
        width[k] = cnp.PyArray_STRIDE(array, 0) // 8 if stacked[k] else 0
    has_new_matrices: cython.bint = stacked[0] or stacked[2] or stacked[4]
    for k in range(5):
        out[k] = data_of(outs[k])
    code = cython.cast(cython.p_longlong, cnp.PyArray_DATA(codes))
    count = cython.cast(cython.p_longlong, cnp.PyArray_DATA(iterations))
    take_settings(m, settings, INFINITY)
    with cython.nogil:
        for i in range(first, end):
            m.P, m.q = data[0] + i * width[0], data[1] + i * width[1]
            m.G, m.h = data[2] + i * width[2], data[3] + i * width[3]
            m.A, m.b = data[4] + i * width[4], data[5] + i * width[5]
            m.lb, m.ub = data[6] + i * width[6], data[7] + i * width[7]
            m.x, m.y, m.z = out[0] + i * n, out[1] + i * p, out[2] + i * rows
            m.z_box = out[3] + i * n
            forget_rows(m)
            if has_new_matrices:
                m.is_ready = False
                set_effort(m)
            code[i] = m.decide()
            count[i] = m.pivots
            cython.cast(cython.pointer(Numbers), out[4])[i] = m.found
            if m.interrupted:
                break
    raise_kept(m)


def factors_of(m: DenseActiveSet):
    """Return what derivatives can use of the last solve, None if there is nothing."""
    if m.rho != 0.0 or m.face_is_kept:
        return None
    if m.is_single:  # nobody will solve with m any more
        return m
    other: DenseActiveSet = DenseActiveSet.__new__(DenseActiveSet)
    P, G, A = m.matrices
    attach(other, P, G, A, True)
    memcpy(other.memory, m.memory, other.memory_end)  # the layout of m begins like that
    other.k, other.skipped = m.k, m.skipped
    return other
