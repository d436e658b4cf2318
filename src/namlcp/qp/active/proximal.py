"""QPs whose P has no good factor: proximal rounds, and faces within them.

With P + W in place of P, W = rho D as in `weight`, the base problem has a factor. A
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

Candidates for certificates, of equations and rows, are refined on the data.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import fabs
from cython.cimports.namlcp.linalg.vectors import add_scaled, copy, dot, fill
from cython.cimports.namlcp.qp.active.engine import (
    CONTRADICTION,
    DONE,
    LATE,
    ROUND_ROUNDING,
    STUCK,
    UNBOUNDED,
    admit_hints,
    drop_wrong_signs,
    hold_active,
    pivot,
    recall,
    size_of,
)
from cython.cimports.namlcp.qp.active.face import FACE_SOLVED, LOST, RAY, descend
from cython.cimports.namlcp.qp.active.judgement import (
    are_within,
    clip_point,
    measure,
    set_contradiction,
    set_point,
    verdict,
)

# Residual of a dependent equation over its terms from which on it contradicts others,
# and the one up to which one that was left out is called dependent.
CONTRADICTED, LEFT = 1e-9, 1e-11
# Dual residual over its terms that shows a multiplier of the wrong sign.
WRONG = 1e-14
# MOST_ROUNDS: rounds at most. REFINEMENTS: passes of refinement of multipliers.


def solve_by_rounds(m):
    """Solve the QP at the pointers of m; after UNBOUNDED z_box has a ray."""
    fill(m.centre, 0.0, m.n)
    set_base_values(m)
    m.rounds, m.retries = 0, RETRIES
    found = try_old_face(m)
    while found == STUCK and m.rounds < MOST_ROUNDS:
        found = minimise(m)
        if found != DONE:
            return found
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


def set_base_values(m):
    """Set s0, the base solution with the proximal term of this centre."""
    for j in range(m.n):
        m.rhs[j] = m.weight[j] * m.centre[j] - m.q[j]
    copy(m.b, m.rhs + m.n, m.p)
    m.set_values(m.rhs, m.s0)
    m.base_size = size_of(m, m.s0)


def try_old_face(m):
    """Begin with the active rows of the last QP, or a hint; STUCK if they do not do.

    The rounds would first come to those of the QP with the proximal term.
    """
    m.entering = -1
    recall(m)
    admit_hints(m)
    m.level = ROUND_ROUNDING
    if m.k == 0:
        return STUCK
    m.set_multipliers()
    m.set_point_values()
    return settle(m) if descend(m) == FACE_SOLVED else STUCK


def minimise(m):
    """Solve the QP with the proximal term of this centre."""
    m.changed = False
    drop_wrong_signs(m)
    found = pivot(m)
    if found == DONE and m.changed:
        m.set_multipliers()
        m.set_point_values()
    elif found == LATE:
        set_point(m)
        clip_point(m)
        m.set_products(False)
        measure(m)
    elif found == CONTRADICTION:
        set_contradiction(m)
    return found


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


def equation_error(m, i, x):
    """Return the residual of an equation over the moduli of its terms."""
    row = m.A + i * m.n
    rest, size = -m.b[i], fabs(m.b[i])
    for j in range(m.n):
        rest += row[j] * x[j]
        size += fabs(row[j] * x[j])
    return fabs(rest) / size if size > 0.0 else 0.0


def contradicts_equations(m):
    """Tell whether a dependent equation contradicts the others: y is the candidate.

    It contradicts them where the solution of these violates it.
    """
    fill(m.rhs, 0.0, m.n)
    copy(m.b, m.rhs + m.n, m.p)
    m.set_values(m.rhs, m.s)
    at: Py_ssize_t = -1
    worst = CONTRADICTED
    for i in range(m.p):
        error = equation_error(m, i, m.s + m.m)
        if error > worst:
            worst, at = error, i
    if at < 0:
        return False
    copy(m.s + m.m, m.x, m.n)
    fill(m.y, 0.0, m.p)
    fill(m.z, 0.0, m.m)
    fill(m.z_box, 0.0, m.n)
    m.y[at] = 1.0
    k, m.k, m.entering = m.k, 0, -1
    refine_contradiction(m)
    m.k = k
    if dot(m.b, m.y, m.p) > 0.0:
        for i in range(m.p):
            m.y[i] = -m.y[i]
    return True


def leaves_equations(m):
    """Tell whether the point violates an equation by more than rounding.

    Then one that was left out depends on the others but for a small part.
    """
    for i in range(m.p):
        if equation_error(m, i, m.x) > LEFT:
            return True
    return False
