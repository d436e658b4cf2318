"""What an iterate needs: to be measured, refined, reported, tested; or the end.

REPORT: to be reported; JUDGE: measured on unscaled data; ACTIVE_SET: refined with its
active set; PROVE: tested for a certificate; CLOCK: the time to be looked at; STOP: the
end of the loop; DOUBT: the least shifts to be asked whether there is a feasible point.
"""

import cython
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.linalg.vectors import fill, largest_entry
from cython.cimports.namlcp.qp.interior.steps import multiply
from cython.cimports.namlcp.watch import is_over

# Gap over its tolerance up to which an iterate with small primal and dual residuals is
# worth measuring on unscaled data, where the sums of the gap round differently.
CLOSE = 1e3
# An active-set refinement needs a worst residual, or a mean of W Z, below these.
NEAR, NEAR_MU = 1e-2, 1e-7
# The worst residual has to fall to this part of that at the last active-set refinement
# before the next one, for small and for large K, with more than LARGE_KKT entries.
DROP, DROP_LARGE = 0.1, 1e-3
# Worst residual over its tolerance from which on a refinement needs an active set that
# did not change in the last iteration.
STEADY = 100.0
# A residual converges if an iteration reduces it to this part: then there is no test
# for a certificate.
CONVERGING = 0.25
# Relative residual of a candidate for a certificate up to which it is promising, and up
# to which it is tested. Between these, it is tested where it fell to the part AGAIN of
# that at the last test.
PROMISING, SMALL_RATIO, AGAIN = 0.1, 1e-4, 0.1
# An iteration counts IDLE times in the patience if a step of full length leaves more
# than the part STUCK of a large primal residual: the next steps will do no better.
STUCK = 0.99
# These are asked once, where the primal residual is FAR times its tolerance or more and
# RESISTS iterations, counted like that, have not halved the worst one.
FAR = 10.0
# Passes over the entries of L in one iteration, about.
PASSES = 20.0


def look(m):
    """Return what the iterate needs."""
    wants: cython.int = REPORT if m.reports else 0
    if m.worst <= CLOSE and max(m.primal_ratio, m.dual_ratio) <= 1.0:
        wants |= JUDGE
    same: cython.bint = mark_active(m)
    near: cython.bint = m.tol * m.worst < NEAR or m.mu < NEAR_MU
    drop = DROP_LARGE if m.nnz > LARGE_KKT else DROP
    if near and m.worst <= drop * m.last_refined and (m.worst < STEADY or same):
        m.last_refined = m.worst
        wants |= ACTIVE_SET
    if promises(m):
        wants |= PROVE
    is_stuck: cython.bint = m.primal_ratio > CLOSE and m.primal > STUCK * m.old_primal
    m.since_halved += IDLE if is_stuck and m.has_full_step else 1
    m.old_primal = m.primal
    if m.worst <= 0.5 * m.reference:
        m.reference, m.since_halved = m.worst, 0
    if m.doubts and m.since_halved > RESISTS and m.primal_ratio > FAR:
        wants |= DOUBT
    stagnates: cython.bint = m.since_halved > m.patience or not m.worst < INFINITY
    if stagnates or m.iterations >= m.max_iter:
        wants |= STOP
    if is_over(m, PASSES * m.factors.entries):
        wants |= CLOCK
    return wants


def mark_active(m):
    """Mark the constraints with Z > W; tell whether they are those of last time."""
    same: cython.bint = True
    for k in range(m.m):
        is_active: cython.bint = m.Z[k] > m.W[k]
        if is_active != m.active[k]:
            same, m.active[k] = False, is_active
    return same


def promises(m):
    """Set the ratios of the candidates for certificates; tell whether one is tested.

    In an infeasible (unbounded) problem the primal (dual) residual cannot vanish. While
    it is within the tolerance or falls to a quarter, no candidate is tested.
    """
    dual_norm, primal_norm = m.dual_norm, max(m.row_norm, m.slack_norm)
    dual: cython.bint = dual_norm > CONVERGING * m.old_dual_norm and m.dual > m.tol
    primal: cython.bint = (
        primal_norm > CONVERGING * m.old_primal_norm and m.primal > m.tol
    )
    m.old_dual_norm, m.old_primal_norm = dual_norm, primal_norm
    if not (primal or dual):
        return False
    du, dZ, dv, ratios = m.step.du, m.step.dZ, m.dv, m.ratios
    fill(dv, 0.0, m.size)
    for i in range(m.p):
        dv[m.n + i] = du[m.n + i]
    for k in range(m.m):
        dv[m.place[k]] += m.sign[k] * max(dZ[k], 0.0)
    multiply(m, du, dv, m.Pdx, m.Ctdv, m.dt)
    size = max(1.0, largest_entry(m.x, m.n))
    ratios[0] = farkas_ratio(m, m.y, m.Z, m.v, m.Ctv, size)
    ratios[1] = farkas_ratio(m, du + m.n, dZ, dv, m.Ctdv, size)
    ratios[2] = ray_ratio(m, m.x, m.Px, m.t)
    ratios[3] = ray_ratio(m, du, m.Pdx, m.dt)
    found: cython.bint = False
    for k in range(4):
        is_stuck: cython.bint = primal if k < 2 else dual
        if not is_stuck or not ratios[k] <= PROMISING:
            ratios[k] = INFINITY
        elif ratios[k] <= SMALL_RATIO or ratios[k] <= AGAIN * m.tested[k]:
            found = True
    return found


def farkas_ratio(m, y, Z, v, Ctv, size):
    """Return min(|r| |x| / -value, |r| / |multipliers|), inf if value >= 0."""
    value: cython.double = 0.0
    most: cython.double = 0.0
    residual: cython.double = 0.0
    for i in range(m.p):
        value += m.b[i] * y[i]
        most = max(most, abs(y[i]))
    for k in range(m.m):
        value += m.c[k] * max(Z[k], 0.0)
        most = max(most, Z[k])
    if not value < 0.0:
        return INFINITY
    for j in range(m.n):
        residual = max(residual, abs(Ctv[j] + v[j]))
    return min(residual * size / -value, residual / most)


def ray_ratio(m, d, Pd, t):
    """Return max(|P d|, |A d|, (C d)+) / |d|, inf if q'd >= 0."""
    value: cython.double = 0.0
    most: cython.double = 0.0
    residual: cython.double = 0.0
    for j in range(m.n):
        value += m.q[j] * d[j]
        most = max(most, abs(d[j]))
        residual = max(residual, abs(Pd[j]))
    if not value < 0.0:
        return INFINITY
    for i in range(m.n, m.n + m.p):
        residual = max(residual, abs(t[i]))
    for k in range(m.m):
        residual = max(residual, m.sign[k] * t[m.place[k]])
    return residual / most
