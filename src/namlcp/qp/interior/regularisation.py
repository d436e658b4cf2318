"""Proximal regularisation that follows the accuracy of the linear solves.

rho and delta, on the diagonal of K~, belong to proximal terms around the current point:
they shorten the steps but do not move the solution. They fall with mu to FLOOR. From
there inaccurate solves raise them, and accurate solves lower the one that dominates its
residual, if that residual or its share of the gap has to become smaller: below 1e-7
factorisations of K~ begin to fail.
"""

import cython

# Values at the start.
RHO, DELTA = 1e-6, 1e-4
# rho and delta fall with mu down to FLOOR; then accurate solves, or steps without
# inequalities, lower them down to LOWEST. A bad solve raises them tenfold, up to TOP.
FLOOR, LOWEST, TOP = 1e-7, 1e-16, 1e-6
# Relative residuals above which a solve is bad, and below which it is accurate; the
# latter after a step of full length, too, whose remainder is due to rho and delta.
POOR, ACCURATE, ACCURATE_FULL = 1e-5, 1e-8, 1e-6
# WAIT: iterations without lowering after a bad solve.
# Scaled dual residual up to which rho is not held responsible for it.
NEGLIGIBLE_RESIDUAL = 1e-12
# A residual has to become smaller above NEEDED times its tolerance, and above BEHIND
# times what the gap is over its own; its share of the gap above NEEDED times the
# largest of m mu and the tolerance of the gap.
NEEDED, BEHIND = 0.1, 1e-4


def regularise(m, old_mu):
    """Adapt rho and delta after a step, to its effect on mu and on the residuals."""
    if m.m == 0:
        lower(m, True, True)
        return
    factor = max(0.0, 1.0 - abs(old_mu - m.mu) / old_mu) if old_mu > 0.0 else 0.0
    if m.rho > FLOOR:
        m.rho = max(m.rho * factor, FLOOR)
    if m.delta > FLOOR:
        m.delta = max(m.delta * factor, FLOOR)
    if not m.step.error <= POOR:
        strengthen(m)
    elif m.wait > 0:
        m.wait -= 1
    elif m.step.error < (ACCURATE_FULL if m.has_full_step else ACCURATE):
        dual, primal = m.dual_norm, max(m.row_norm, m.slack_norm)
        rho_dominates: cython.bint = (
            dual > NEGLIGIBLE_RESIDUAL and m.rho * m.change_x > 0.5 * dual
        )
        delta_dominates: cython.bint = m.delta * m.change_yz > 0.5 * primal
        gap = NEEDED * max(m.mu * m.m, m.eps_abs + m.eps_rel * m.gap_size)
        needed = max(NEEDED, BEHIND * m.gap_ratio)
        lower(
            m,
            rho_dominates and (m.dual_ratio > needed or m.dual_share > gap),
            delta_dominates and (m.primal_ratio > needed or m.primal_share > gap),
        )


def lower(m, rho, delta):
    """Divide rho, delta or both by ten."""
    if rho:
        m.rho = max(0.1 * m.rho, LOWEST)
    if delta:
        m.delta = max(0.1 * m.delta, LOWEST)


def strengthen(m):
    """Raise both after a bad solve."""
    m.rho = max(m.rho, min(10.0 * m.rho, TOP))
    m.delta = max(m.delta, min(10.0 * m.delta, TOP))
    m.wait = WAIT
