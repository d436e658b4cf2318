"""Block principal pivoting inside a proximal-point loop.

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0). With
the others fixed, the free unknowns F solve the free system (A_FF + rho I) z_F = rhs.
Then the unknowns with a wrong sign change their states, all of them (Judice and Pires,
Computers Ops Res 21 (1994) 587-596); that may go round, and is then given up. The
proximal-point loop around it regularises singular systems by rho I and refines the
solution of the others.

`solve_small` is for small dense LCPs as they come to `solve_lcp`. What is not clean, or
not solved, is left to the ways that take a closer look.
"""

from time import perf_counter

import cython
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import INFINITY, fabs, isfinite, sqrt

from namlcp.linalg import factors
from namlcp.status import Status

cnp.import_array()

# Default eps_rel.
ACCURACY = 1e-9
SOLVED, SYMMETRY_ROUNDING = Status.SOLVED, factors.SYMMETRY_ROUNDING
# FIRST_SWEEPS: first sweeps at most; STILL_SWEEPS: sweeps in a row without a change of
# state that end them. BLOCK_STEPS: changes of states without fewer wrong signs until
# block pivoting is given up. OUTER_STEPS: proximal steps at most. EARLY_STEPS, FEW,
# SOME: those of a symmetric A that may end early, while at most one sign in FEW is
# wrong and more than SOME factorisations were made. FACTORISATIONS: those of
# `solve_small` at most, as nothing looks at the clock between them.
# Relaxation parameter of the first sweeps.
SWEEP_RELAXATION = 1.4
# The proximal parameter, relative to the unit diagonal. With 1e-9 singular problems end
# with smaller residuals, but many of full degeneracy stagnate before they end.
RHO = 1e-8
# Scaled Res, relative to its value at clip(0), below which no step is tried.
EXACT_RESIDUAL = 1e-15
# Part of the tolerances that a start must meet to be returned as it is: in a sequence
# of slowly changing problems the errors of starts add up, to that part.
START_MARGIN = 0.01


def pivot(m):
    """Solve from the start in z, and return why that ended.

    With ask_convex, m.convex tells once the problem is solved whether `is_definite`: at
    one more factorisation, of what the others have not shown to be so.
    """
    code: cython.int
    with cython.nogil:
        code = begin_pivoting(m)
    while code == GO_ON:
        done = m.factorisations
        if done >= m.most:
            return MOST
        if done > 0:
            look_at_clock(m)
            raise_kept(m)
            if m.over:
                return LATE
        if m.is_external:
            set_right_side(m)
            m.solve_free_system()
            with cython.nogil:
                code = use_solution(m)
        else:
            with cython.nogil:
                code = advance(m)
        if code == RAY and not m.is_unsolvable():
            code = GO_ON
        if m.factorisations > done:
            m.report()
    if code == DONE and m.ask_convex and not m.convex:
        with cython.nogil:
            m.convex = is_definite(m)
    if m.is_short:
        raise MemoryError("an LCP of this size needs more memory than there is")
    return code


def advance(m):
    """Factor the free system, and go on until another one is needed."""
    if m.must_factor:
        regular = factor_free(m, m.rho)
        if m.is_short:
            return HALTED
        if m.ask_convex and m.count == m.n:
            m.convex = regular and m.has_unit
        m.factorisations += 1
        m.must_factor = False
    code: cython.int = GO_ON
    while code == GO_ON and not m.must_factor:
        set_right_side(m)
        solve_free(m)
        code = use_solution(m)
    return code


# ---- the start


def begin_pivoting(m):
    n, z, w, lower, upper = m.n, m.own_z, m.w, m.lower, m.upper
    scale_problem(m)
    m.best_residual = INFINITY
    # First z = clip(0), whose Res is the reference of eps_rel; then the start.
    for i in range(n):
        z[i] = min(max(0.0, lower[i]), upper[i])
    write_w(m, w)
    record(m)
    m.size = m.best_residual
    if m.solved:
        return DONE
    copy(m.centre, z, n)
    write_w(m, w)
    record(m)
    if m.solved and meets(m, START_MARGIN):
        return DONE
    eps = 0.01 * m.eps_rel * m.size / sqrt(n)
    m.tolerance = max(1e-14 * largest_entry(m.q, n), eps)
    copy(z, m.centre, n)
    copy(w, m.own_rhs, n)
    before = m.best_residual
    first_sweeps(m)
    record(m)
    # On a nonsymmetric A the sweeps may diverge: discard them if Res did not fall.
    if m.best_residual == before and not m.symmetric:
        copy(m.centre, z, n)
        copy(m.own_rhs, w, n)
    for i in range(n):
        m.side[i] = state_of(z[i] - w[i], lower[i], upper[i])
        m.centre[i] = z[i]
    m.must_factor = True
    reset_patience(m, RHO if m.symmetric else 0.0)
    return GO_ON


def scale_problem(m):
    """Scale the problem to a unit diagonal; write the scaled clip(z) to centre."""
    n, d, lower, upper = m.n, m.root, m.lower, m.upper
    m.has_unit = True
    for j in range(n):
        d[j] = 0.0
        if m.is_dense:
            d[j] = m.values[j * (n + 1)]
        else:
            for p in range(m.indptr[j], m.indptr[j + 1]):
                if m.indices[p] == j:
                    d[j] = m.values[p]
        m.unit[j] = d[j] > 0.0
        m.has_unit = m.has_unit and m.unit[j]
        d[j] = 1.0 / sqrt(d[j]) if d[j] > 0.0 else 1.0
        m.q[j] *= d[j]
        lower[j] /= d[j]
        upper[j] /= d[j]
        m.centre[j] = min(max(m.own_z[j] / d[j], lower[j]), upper[j])
    for j in range(n):
        d_j = d[j]
        if m.is_dense:
            for i in range(j * n, (j + 1) * n):
                m.scaled[i] = m.values[i] * d_j * d[i - j * n]
        else:
            for p in range(m.indptr[j], m.indptr[j + 1]):
                m.scaled[p] = m.values[p] * d_j * d[m.indices[p]]


def first_sweeps(m):
    """Sweep by projected SOR; update z, w = A z + q and the states.

    An unknown that does not move costs no pass over its column.
    """
    n, z, w, side, lower, upper = m.n, m.own_z, m.w, m.side, m.lower, m.upper
    still: Py_ssize_t = 0
    for _ in range(FIRST_SWEEPS):
        still += 1
        for i in range(n):
            if m.unit[i]:
                t = min(max(z[i] - SWEEP_RELAXATION * w[i], lower[i]), upper[i])
                if t != z[i]:
                    add_column(m, i, t - z[i], w)
                    z[i] = t
            found = state_of(z[i] - w[i], lower[i], upper[i])
            if found != side[i]:
                side[i] = found
                still = 0
        if still >= STILL_SWEEPS:
            break


# ---- products and residuals


def add_column(m, j, factor, out):
    """Add `factor` times column j of the scaled matrix."""
    if m.is_dense:
        add_scaled(factor, m.scaled + j * m.n, out, m.n)
    else:
        for p in range(m.indptr[j], m.indptr[j + 1]):
            out[m.indices[p]] += factor * m.scaled[p]


def write_w(m, w):
    copy(m.q, w, m.n)
    for j in range(m.n):
        if m.own_z[j] != 0.0:
            add_column(m, j, m.own_z[j], w)


def state_of(s, lower, upper):  # s = z - w
    return -1 if s <= lower else (1 if s >= upper else 0)


def record(m):
    """Copy z to best if its Res is the least; tell whether that fell to a quarter."""
    scaled, plain = both_residuals(m.own_z, m.w, m.lower, m.upper, m.root, m.n)
    improved: cython.bint = scaled < 0.25 * m.best_residual
    if scaled < m.best_residual:
        m.best_residual, m.best_plain = scaled, plain
        copy(m.own_z, m.best, m.n)
        m.solved = meets(m, 1.0)
    return improved


def meets(m, margin):
    eps_abs, eps_rel = margin * m.eps_abs, margin * m.eps_rel
    return are_met(eps_abs, eps_rel, m.size, m.best_plain, m.best_residual)


# ---- the free system and its solution


def set_right_side(m):
    z, rhs = m.own_z, m.own_rhs
    for i in range(m.n):
        z[i] = 0.0
        if m.side[i] != 0:
            z[i] = m.lower[i] if m.side[i] < 0 else m.upper[i]
    write_w(m, rhs)
    for i in range(m.n):
        rhs[i] = m.rho * m.centre[i] - rhs[i]


def use_solution(m):
    clip_rounding(m)
    write_w(m, m.w)
    for i in range(m.n):
        if not isfinite(m.w[i]):
            if m.rho > 0.0:
                return HALTED
            # The free system is singular: go on from the best point with rho > 0.
            copy(m.best, m.centre, m.n)
            reset_patience(m, RHO)
            return GO_ON
    wrong = set_goals(m)
    # Far from the solution an exact proximal step wastes factorisations; the next one
    # uses the same factor unless rho changes.
    early: cython.bint = m.symmetric and m.rho > 0.0 and m.factorisations > SOME
    early = early and wrong < m.fewest_wrong and m.outer_steps < EARLY_STEPS
    if wrong == 0 or (early and FEW * wrong <= m.n):
        return end_outer_step(m)
    if m.solved:
        return DONE
    if wrong < m.fewest_wrong:
        m.fewest_wrong = wrong
        m.patience = BLOCK_STEPS
    elif m.patience > 0:
        m.patience -= 1
    else:
        return HALTED
    for i in range(m.n):
        m.side[i] = m.goal[i]
    m.must_factor = True
    return GO_ON


def clip_rounding(m):
    """Clip z if no free unknown is outside its bounds by more than the tolerance."""
    z, lower, upper, tolerance = m.own_z, m.lower, m.upper, m.tolerance
    for i in range(m.n):
        if not lower[i] - tolerance <= z[i] <= upper[i] + tolerance:
            return
    for i in range(m.n):
        z[i] = min(max(z[i], lower[i]), upper[i])


def set_goals(m):
    """Write to goal the states that the signs of z and w ask for; count the changes."""
    z, lower, upper, side, goal = m.own_z, m.lower, m.upper, m.side, m.goal
    rho, tolerance = m.rho, m.tolerance
    wrong: Py_ssize_t = 0
    for i in range(m.n):
        goal[i] = side[i]
        if side[i] == 0:
            if z[i] < lower[i] - tolerance:
                goal[i] = -1
            elif z[i] > upper[i] + tolerance:
                goal[i] = 1
        elif lower[i] < upper[i]:
            if side[i] * (m.w[i] + rho * (z[i] - m.centre[i])) > tolerance:
                goal[i] = 0
        wrong += goal[i] != side[i]
    return wrong


# ---- proximal steps


def reset_patience(m, rho):
    m.fewest_wrong = m.n + 1
    m.patience = BLOCK_STEPS
    if rho != m.rho:
        m.rho = rho
        m.must_factor = True


def end_outer_step(m):
    """Move the proximal point to z, with the difference in rhs."""
    improved = record(m)
    m.outer_steps += 1
    rho = m.rho
    exact: cython.bint = m.best_residual <= EXACT_RESIDUAL * m.size
    if m.solved and (exact or rho == 0.0 or not improved):
        return DONE
    if m.outer_steps >= OUTER_STEPS:
        return HALTED
    for i in range(m.n):
        m.own_rhs[i] = m.own_z[i] - m.centre[i]
        m.centre[i] = m.own_z[i]
    reset_patience(m, RHO)
    # Steps 3, 6, 12, ...: later directions are more accurate, but every test costs.
    turn = m.outer_steps // 3
    due: cython.bint = m.outer_steps == 3 * turn and turn > 0 and turn & (turn - 1) == 0
    return RAY if due and rho > 0.0 and not m.solved else GO_ON


# ---- a small LCP in one call


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
    total, largest, gap = sizes(values, n)
    if not total < INFINITY:
        return None
    m: Pivoting = Pivoting.__new__(Pivoting)
    m.n, m.entries, m.is_dense = n, n * n, True
    m.symmetric = gap <= SYMMETRY_ROUNDING * largest
    m.given = A if m.symmetric else A.T.copy()
    m.values = data_of(m.given)
    allocate(m)
    copy(data_of(q), m.q, n)
    m.low = bound(lower, 0.0, m.lower, n)
    m.high = bound(upper, INFINITY, m.upper, n)
    if not are_ordinary(m.q, m.low, m.high, n):
        return None
    if start is not None:
        copy(data_of(start), m.own_z, n)
    m.eps_rel = ACCURACY
    code: cython.int = begin_pivoting(m)
    while code in (GO_ON, RAY) and m.factorisations < FACTORISATIONS:
        code = advance(m)
    if code != DONE:
        return None
    z, w, s = m.best_point(), new_vector(n), new_vector(n)
    at_z, at_w, at_s = data_of(z), data_of(w), data_of(s)
    affine_at(values, at_z, data_of(q), at_w, n)
    for i in range(n):
        m.y[i] = 1.0 / m.root[i]
        slope = values[i * (n + 1)]
        at_s[i] = at_z[i] - at_w[i] / (slope if slope > 0.0 else 1.0)
    residual, scaled = both_residuals(at_z, at_w, m.low, m.high, m.y, n)
    if not are_met(0.0, ACCURACY, m.size, residual, scaled):
        return None
    if residual != 0.0 and not 1e-100 < residual < 1e100:
        return None  # sums of squares have left the range
    found: cython.ulonglong = hash_of(values, n * n, 0) if stamp is None else stamp
    found = hash_of(m.high, n, hash_of(m.low, n, hash_of(data_of(q), n, found)))
    result: LCPResultBase = made(kind)
    result.status, result.z, result.w, result.s = SOLVED, z, w, s
    result.iterations, result.residual = m.factorisations, residual
    result.method, result.message, result.stamp = "pivoting", "", found
    result.problem = given, bool(m.symmetric), q, lower, upper
    result.solve_time = perf_counter() - begun
    return result


def is_vector(value, n):
    return value is None or (fits(value, 1) and cnp.PyArray_DIM(value, 0) == n)


def sizes(A, n):
    """Return the sum of |A_ij|, NaN if one is, max |A_ij| and max |A - A'|."""
    total, largest, gap = 0.0, 0.0, 0.0
    for i in range(n):
        for j in range(n):
            size = fabs(A[i * n + j])
            total += size
            largest = max(largest, size)
        for j in range(i):
            gap = max(gap, fabs(A[i * n + j] - A[j * n + i]))
    return total, largest, gap


def bound(value, default, out, n):
    """Write the bounds to `out`; return where they stay as they are if scaled."""
    if value is None:
        fill(out, default, n)
        return out
    copy(data_of(value), out, n)
    return data_of(value)
