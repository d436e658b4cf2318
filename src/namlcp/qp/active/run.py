"""A solve: checks of the numbers, missing factors, the method, and the end."""

import cython
from cython.cimports.libc.math import INFINITY, NAN, fabs
from cython.cimports.namlcp.linalg.blas import blas_times, blas_times_transposed
from cython.cimports.namlcp.linalg.vectors import copy, fill
from cython.cimports.namlcp.measure import Terms, gap_by_products
from cython.cimports.namlcp.qp.acceptance import (
    Claim,
    Matrix,
    prove_infeasible,
    prove_unbounded,
)
from cython.cimports.namlcp.qp.active.dense import prepare, set_up
from cython.cimports.namlcp.qp.active.engine import (
    CONTRADICTION,
    DONE,
    FAULTY,
    STUCK,
    SUMMED,
    UNBOUNDED,
    UNPROVED,
    UNSUITED,
    VIOLATION_ROUNDING,
    admit_hints,
    drop_wrong_signs,
    finish,
    pivot,
    recall,
    size_of,
)
from cython.cimports.namlcp.qp.active.judgement import (
    are_within,
    judge,
    measure_point,
    set_contradiction,
    set_terms,
)
from cython.cimports.namlcp.qp.active.proximal import (
    contradicts_equations,
    leaves_equations,
    refine_contradiction,
    solve_by_rounds,
)
from cython.cimports.namlcp.qp.active.weight import RHO, wanted_rho

from namlcp.checks import INFINITE as HUGE_SIDE

INFINITE = HUGE_SIDE
# Other values of m.wanted: where too many rounds were needed, and where rounding errors
# were too large.
LESS_RHO, MORE_RHO = 1e-2 * RHO, 1e2 * RHO


def is_faulty(m):
    """Tell whether a number in the vectors is not allowed, or two sides are opposed.

    Not allowed are NaN, infinite entries of q and b, and sides beyond `INFINITE`.
    """
    fine: cython.bint = True
    most = INFINITE
    for j in range(m.n):
        fine = fine and fabs(m.q[j]) < INFINITY and m.lb[j] <= m.ub[j]
        fine = fine and (-most < m.lb[j] < most or m.lb[j] == -INFINITY)
        fine = fine and (-most < m.ub[j] < most or m.ub[j] == INFINITY)
    for i in range(m.p):
        fine = fine and fabs(m.b[i]) < INFINITY
    for i in range(m.m):
        fine = fine and (-most < m.h[i] < most or m.h[i] == INFINITY)
    return not fine


def decide(m):
    """Solve the QP at the pointers of m, if need be with another W, see `weight`.

    Without W, rounding errors are to blame; with W, these or too many rounds.
    """
    are_hinted: cython.bint = m.hints > 0
    found = proved(m, solve_dense(m))
    if are_hinted and (found == STUCK or found == UNPROVED):
        found = solve_anew(m, m.wanted)  # as a wrong guess may mislead
    if (found != STUCK and found != UNPROVED) or m.wanted != 0.0:
        return found
    if m.pivots > m.max_iter or m.operations > m.most_operations:
        return found
    # Where P is definite, a small W leaves little to the passes; where rows seem to
    # contradict each other by rounding, it is too small.
    is_long: cython.bint = found == STUCK and (m.rho == 0.0 or m.rounds > 1)
    return solve_anew(m, LESS_RHO if is_long else MORE_RHO)


def solve_anew(m, wanted):
    """Solve the same QP from nothing, with the W wanted."""
    m.wanted, m.is_ready = wanted, False
    m.k, m.kept_k, m.hints = 0, 0, 0
    return proved(m, solve_dense(m))


def proved(m, found):
    """Turn a candidate for a certificate into one; UNPROVED where it is none."""
    P: Matrix
    G: Matrix
    A: Matrix
    c: Claim
    if found != CONTRADICTION and found != UNBOUNDED:
        return found
    numbers, claim = cython.address(m.found), cython.address(c)
    P.lines, P.width, P.values, P.starts = m.n, m.n, m.P, cython.NULL
    G.lines, G.width, G.values, G.starts = m.m, m.n, m.G, cython.NULL
    A.lines, A.width, A.values, A.starts = m.p, m.n, m.A, cython.NULL
    c.P, c.G, c.A = cython.address(P), cython.address(G), cython.address(A)
    c.n, c.m, c.p, c.tol = m.n, m.m, m.p, m.eps_abs
    c.q, c.h, c.b, c.lb, c.ub = m.q, m.h, m.b, m.lb, m.ub
    c.units, c.largest, c.r = m.best, m.change, m.direction
    c.primal, c.dual = NAN, NAN
    if found == CONTRADICTION:
        done = prove_infeasible(claim, m.x, m.y, m.z, m.z_box)
        fill(m.x, NAN, m.n)
    else:
        done = prove_unbounded(claim, m.x, m.y, m.z, m.z_box)
        copy(m.z_box, m.x, m.n)
        fill(m.z_box, NAN, m.n)
        fill(m.y, NAN, m.p)
        fill(m.z, NAN, m.m)
    numbers.primal, numbers.dual, numbers.gap = c.primal, c.dual, NAN
    numbers.primal_size, numbers.dual_size, numbers.gap_size = NAN, NAN, NAN
    numbers.objective = NAN
    return found if done else UNPROVED


def solve_dense(m):
    """Solve the QP at the pointers of m; certificates are candidates."""
    m.pivots = 0
    if is_faulty(m):
        return FAULTY
    if not m.is_ready:
        if not set_up(m):
            return UNSUITED
        m.is_ready = True
        if m.is_large and m.is_single and m.rho == 0.0:
            prepare(m)
    if m.rho != 0.0 and m.rho != wanted_rho(m) and not set_up(m):
        return UNSUITED
    if m.skipped > 0 and contradicts_equations(m):
        return CONTRADICTION
    found = solve_by_rounds(m) if m.rho != 0.0 else follow(m)
    if found == CONTRADICTION:
        refine_contradiction(m)
    elif found == SUMMED:
        found = sum_anew(m)
    if found == DONE and m.skipped > 0 and leaves_equations(m):
        return UNSUITED
    return found


def follow(m):
    """Solve the QP by `engine`, from the active rows at hand, and judge."""
    for j in range(m.n):
        m.rhs[j] = -m.q[j]
    copy(m.b, m.rhs + m.n, m.p)
    m.set_values(m.rhs, m.s0)
    m.base_size = size_of(m, m.s0)
    m.entering = -1
    recall(m)
    admit_hints(m)
    drop_wrong_signs(m)
    m.level = VIOLATION_ROUNDING
    found = pivot(m)
    if found == STUCK:
        return STUCK
    if found == CONTRADICTION:
        set_contradiction(m)
        return CONTRADICTION
    if found == DONE and not finish(m):
        return STUCK
    return judge(m, found)


def sum_anew(m):
    """Measure the point with sums in the order of the data: DONE or STUCK.

    They are those of `qp_residuals`, which takes them from NumPy and thus from BLAS.
    """
    n = m.n
    t: Terms
    blas_times(m.P, n, n, m.x, m.Px)
    blas_times(m.G, m.m, n, m.x, m.Gx)
    blas_times(m.A, m.p, n, m.x, m.Ax)
    blas_times_transposed(m.G, m.m, n, m.z, m.Gtz)
    blas_times_transposed(m.A, m.p, n, m.y, m.Aty)
    measure_point(m)
    set_terms(m, cython.address(t))
    m.found.gap = fabs(gap_by_products(cython.address(t), m.change, m.direction))
    return DONE if are_within(m, 0.0) else STUCK
