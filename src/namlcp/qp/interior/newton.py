"""The linear systems: factors of K~, solutions with refinement, regularisation.

Residuals are measured as max |r_i| / max(1, |K~_ii|): rows of inactive constraints have
diagonals of 1e10 and more, and would outweigh all others.

Factors of a nearly singular K~ have a few wrong directions, on which refinement does
not converge and GMRES (Y. Saad and M. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986)
needs a few steps. The factors precondition it from the right, so that the residuals
that it makes small are those above.

rho and delta, on the diagonal of K~, belong to proximal terms around the current point:
they shorten the steps but do not move the solution. They fall with mu to FLOOR. From
there inaccurate solves raise them, and accurate solves lower the one that dominates its
residual, if that residual or its share of the gap has to become smaller: below 1e-7
factorisations of K~ begin to fail.
"""

import cython
from cython.cimports.libc.math import INFINITY, NAN, sqrt
from cython.cimports.libc.stdlib import malloc
from cython.cimports.namlcp.linalg.vectors import (
    add_line,
    add_scaled,
    copy,
    dot,
    fill,
)

# Where a refinement step did not reduce the residual, later refinements end at
# ABOVE_ATTAINED times that residual, which counts as the tolerance at most and is
# slowly forgotten. REFINEMENT_STEPS: most of them in a solve.
ABOVE_ATTAINED, FORGET = 2.0, 0.9
# Residuals are relative to the norm of the right-hand side, or to this if larger.
SMALL_RHS = 1e-8
# Relative residual after refinement above which GMRES is tried, KRYLOV_STEPS of it.
GMRES_ABOVE = 1e-6
# A new product of this size, relative to what it was before others were taken out, is
# rounding.
BREAKDOWN = 1e-14
# rho and delta at the start.
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


def factor(m):
    """Set row_size; factor K~ unless its factors are at hand; tell if that succeeds."""
    is_known: cython.bint = True
    for j in range(m.size):
        m.row_size[j] = max(1.0, abs(m.data[m.indptr[j + 1] - 1]))
    for t in range(m.nnz - 1, -1, -1):
        if m.data[t] != m.factored[t]:
            is_known = False
            break
    if is_known:
        return True
    succeeds = m.factors.factor_values(m.data, m)
    copy(m.data, m.factored, m.nnz)
    if not succeeds:
        m.factored[m.nnz - 1] = NAN  # unlike any values
    return succeeds


def weighted_norm(r, weight, size):
    """Return max |r_i| / weight_i, NaN if an entry is."""
    worst = 0.0
    for i in range(size):
        value = abs(r[i]) / weight[i]
        if not value <= worst:
            worst = value
            if value != value:
                break
    return worst


def set_remainder(m, b, u, r):
    """Set r = b - K~ u; return its norm max |r_i| / row_size_i."""
    indptr, indices, data = m.indptr, m.indices, m.data
    copy(b, r, m.size)
    for j in range(m.size):
        k, last = indptr[j], indptr[j + 1] - 1
        total = data[last] * u[j]
        r[j] -= add_line(total, data + k, indices + k, last - k, u, -u[j], r)
    return weighted_norm(r, m.row_size, m.size)


def solve(m):
    """Set du to the solution of K~ du = rhs, refined, and r to its residual.

    The refinement ends at the accuracy wanted, or where a step does not halve the
    residual.
    """
    copy(m.rhs, m.r, m.size)
    fill(m.step.du, 0.0, m.size)
    m.rhs_norm = max(SMALL_RHS, weighted_norm(m.rhs, m.row_size, m.size))
    m.step.error = INFINITY
    for k in range(REFINEMENT_STEPS + 1):
        m.factors.solve_into(m.r, m.answer)
        for j in range(m.size):
            m.trial[j] = m.step.du[j] + m.answer[j]
        error = set_remainder(m, m.rhs, m.trial, m.trial_r) / m.rhs_norm
        if k > 0 and not error < m.step.error:
            m.attained = min(m.step.error, m.tol)
            break
        gained: cython.bint = k == 0 or error <= 0.5 * m.step.error
        accept(m, error)
        if error <= m.accuracy or not gained or k == REFINEMENT_STEPS:
            break
        if error <= ABOVE_ATTAINED * m.attained:
            m.attained *= FORGET
            break
    if m.krylov_pays and not m.step.error <= GMRES_ABOVE:
        improve(m)


def accept(m, error):
    """Take the trial point, whose residual is trial_r."""
    m.step.error = error
    m.step.du, m.trial = m.trial, m.step.du
    m.r, m.trial_r = m.trial_r, m.r


def improve(m):
    """Reduce the residual r of du by GMRES, where it can be halved.

    It has the form of generalised conjugate residuals (S.C. Eisenstat, H.C. Elman and
    M.H. Schultz, SIAM J. Numer. Anal. 20, 1983): each step solves for what is left, and
    the products of K~ with all corrections, over row_size, are made orthonormal.
    """
    size, weight, trial, r = m.size, m.row_size, m.trial, m.trial_r
    if m.krylov == cython.NULL:
        count = 2 * KRYLOV_STEPS * size
        m.krylov = cython.cast(cython.p_double, malloc(8 * count))
        if m.krylov == cython.NULL:
            return
    copy(m.step.du, trial, size)
    copy(m.r, r, size)
    for k in range(KRYLOV_STEPS):
        correction = m.krylov + 2 * k * size
        product = correction + size
        m.factors.solve_into(r, correction)
        fill(m.dt, 0.0, size)
        set_remainder(m, m.dt, correction, product)
        for j in range(size):
            product[j] /= -weight[j]
        first = sqrt(dot(product, product, size))
        for _ in range(2):  # orthogonalised twice against rounding
            for i in range(k):
                earlier = m.krylov + 2 * i * size
                part = dot(earlier + size, product, size)
                add_scaled(-part, earlier, correction, 2 * size)
        norm = sqrt(dot(product, product, size))
        if not BREAKDOWN * first < norm < INFINITY:
            break
        part = 0.0
        for j in range(size):
            correction[j] /= norm
            product[j] /= norm
            part += product[j] * r[j] / weight[j]
        add_scaled(part, correction, trial, size)
        for j in range(size):
            r[j] -= part * weight[j] * product[j]
    error = set_remainder(m, m.rhs, trial, m.trial_r) / m.rhs_norm
    m.krylov_pays = error <= 0.5 * m.step.error
    if error < m.step.error:
        accept(m, error)


# ---- regularisation


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
    if rho:
        m.rho = max(0.1 * m.rho, LOWEST)
    if delta:
        m.delta = max(0.1 * m.delta, LOWEST)


def strengthen(m):
    m.rho = max(m.rho, min(10.0 * m.rho, TOP))
    m.delta = max(m.delta, min(10.0 * m.delta, TOP))
    m.wait = WAIT
