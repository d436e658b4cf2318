"""QPs whose P has no good factor: proximal rounds, and faces within them.

With P + W in place of P, W = rho D, the base problem has a factor. A
round with the centre c, at first 0,

1. minimises 1/2 x'Px + q'x + 1/2 (x - c)'W(x - c) by `engine`, from the active rows of
   the round before: its base solution is K^-1 (W c - q, b);
2. minimises the cost without W on the face of the active rows F, see `face`.

If the point at hand has the right signs and violates no row, the QP is solved. Else it
is the next centre, as it is RETRIES times where wrong signs are within tolerance; so is
the point where the second step meets the first row that is not active. Every centre is
feasible and the cost falls from round to round, so that no F comes back (Rockafellar,
SIAM J. Control Optim. 14 (1976) 877-898). The answer depends on the data alone, as c =
0 at the beginning of every solve.

D is the diagonal of P, with the geometric mean of its positive entries in place of the
others, and rho a multiple of

    max(1, tau),   tau = max |q_j| / sqrt(D_j)  over  mean |d_i| / |D^-1/2 c_i|:

in variables scaled by sqrt(D), the largest slope over the geometric mean of the
distances of all planes c_i x = d_i from 0, that is the curvature which has its minimum
about as far away as they are. With P = 0 that is tau alone. A power of 16 in its place
lets rho be the same for most QPs with the same matrices. Norms of rows and sizes of x
are those in the scaled variables, too.

Candidates for certificates, of equations and rows, are refined on the data.
"""

import cython
from cython.cimports.libc.math import INFINITY, exp, fabs, floor, log, sqrt
from cython.cimports.namlcp.linalg.vectors import add_scaled, copy, fill
from cython.cimports.namlcp.qp.active.engine import (
    CONTRADICTION,
    DONE,
    LATE,
    ROUND_ROUNDING,
    STUCK,
    UNBOUNDED,
    drop_wrong_signs,
    hold_active,
    pivot,
    set_base_values,
)
from cython.cimports.namlcp.qp.active.face import FACE_SOLVED, LOST, RAY, descend
from cython.cimports.namlcp.qp.active.judgement import (
    are_within,
    clip_point,
    follow,
    judge,
    measure,
    verdict,
)

# Dual residual over its terms that shows a multiplier of the wrong sign.
WRONG = 1e-14
# rho over that power of 16, if no other is asked for; the value of m.wanted without any
# weight.
RHO, NO_WEIGHT = 1e-4, -1.0
# Diagonal entry of P, over the largest one, up to which it counts as 0.
LEAST_SHAPE = 1e-36
# The curvature is between this number and its inverse.
LEAST_CURVATURE = 1e-100
# MOST_ROUNDS: rounds at most. REFINEMENTS: passes of refinement of multipliers.


def solve_at_hand(m):
    """Solve the QP at the pointers of m, whose factors are there."""
    found = solve_by_rounds(m) if m.rho != 0.0 else follow(m)
    if found == CONTRADICTION and not m.on_face:
        refine_contradiction(m)
    return found


def solve_by_rounds(m):
    """Solve a QP with W; after UNBOUNDED z_box has a ray."""
    fill(m.centre, 0.0, m.n)
    m.rounds, m.retries = 0, RETRIES
    found = try_old_face(m)
    while found == STUCK and m.rounds < MOST_ROUNDS:
        m.changed = False
        drop_wrong_signs(m)
        found = pivot(m)
        if found == LATE:
            judge(m, found)
        if found != DONE:
            return found
        if m.changed:
            m.set_multipliers()
            m.set_point_values()
        m.rounds += 1
        end = descend(m)
        if end == RAY:
            return UNBOUNDED
        if end == LOST:
            return STUCK
        found = settle(m) if end == FACE_SOLVED else STUCK
        if found == STUCK:
            copy(m.s + m.m, m.centre, m.n)
            set_base_values(m)
    return found


def try_old_face(m):
    """Begin with the active rows of the last QP, or a hint; STUCK if they do not do.

    The rounds would first come to those of the QP with the proximal term.
    """
    m.entering, m.level = -1, ROUND_ROUNDING
    m.begin()
    if m.k == 0:
        return STUCK
    m.set_multipliers()
    m.set_point_values()
    return settle(m) if descend(m) == FACE_SOLVED else STUCK


def settle(m):
    """Take multipliers of the right signs; tell whether that solves the QP, or STUCK.

    The products at hand are those of the point with multipliers of either sign.
    """
    negative: cython.bint = False
    for i in range(m.m):
        if m.z[i] < 0.0:
            m.z[i], negative = 0.0, True
    if clip_point(m):
        m.set_products(False)
    elif negative:
        m.set_row_products()
    measure(m)
    is_rough: cython.bint = m.found.dual > WRONG * m.found.dual_size
    if is_rough and m.retries > 0 and are_within(m, 0.0):
        m.retries -= 1
        return STUCK
    return verdict(m)


# ---- certificates


def refine_contradiction(m):
    """Refine y and z, multipliers that contradict the rows: G'z + A'y = 0 off bounds.

    Rows with multipliers are active, or entering. P does not matter here.
    """
    for _ in range(REFINEMENTS):
        m.set_row_products()
        for j in range(m.n):
            m.rhs[j] = -(m.Gtz[j] + m.Aty[j])
        fill(m.rhs + m.n, 0.0, m.p)
        for i in range(m.k):
            if m.active[i] >= m.m:
                m.rhs[m.active[i] - m.m] = 0.0
        if m.entering >= m.m:
            m.rhs[m.entering - m.m] = 0.0
        m.set_values(m.rhs, m.change)
        hold_active(m, m.change)
        for i in range(m.k):
            if m.active[i] < m.m:
                m.z[m.active[i]] += m.work[i]
        add_scaled(1.0, m.change + m.rows, m.y, m.p)


# ---- the weights


def set_shape(m):
    """Make m.shape, the diagonal of P in it, that of D; set the norms of x.

    m.largest is the largest diagonal entry of P.
    """
    total, count = 0.0, 0
    for j in range(m.n):
        if m.shape[j] > LEAST_SHAPE * m.largest:
            total += log(m.shape[j])
            count += 1
    mean = exp(total / max(count, 1))
    for j in range(m.n):
        if not m.shape[j] > LEAST_SHAPE * m.largest:
            m.shape[j] = mean
        m.scale[m.m + j] = sqrt(m.shape[j])


def wanted_rho(m):
    """Return rho for the vectors at hand."""
    total, count, largest = 0.0, 0, 0.0
    for i in range(m.p + m.m + 2 * m.n):
        row = i - m.p
        if row < 0:
            distance = m.b[i] * m.reach[i]
        elif row < m.m:
            distance = m.h[row] * m.scale[row]
        elif row < m.rows:
            distance = m.lb[row - m.m] * m.scale[row]
        else:
            distance = m.ub[row - m.rows] * m.scale[row - m.n]
        if 0.0 < fabs(distance) < INFINITY:
            total += log(fabs(distance))
            count += 1
    for j in range(m.n):
        largest = max(largest, fabs(m.q[j]) / m.scale[m.m + j])
    tau = largest / exp(total / max(count, 1))
    if m.largest > 0.0 or not tau > 0.0:
        tau = max(1.0, tau)
    tau = min(max(tau, LEAST_CURVATURE), 1.0 / LEAST_CURVATURE)
    factor = m.wanted if m.wanted > 0.0 else RHO
    return factor * 16.0 ** floor(log(tau) / log(16.0))
