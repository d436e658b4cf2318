"""Factorisation of K~, and solution of K~ u = rhs with refinement.

Residuals are measured as max |r_i| / max(1, |K~_ii|): rows of inactive constraints have
diagonals of 1e10 and more, and would outweigh all others.

Factors of a nearly singular K~ have a few wrong directions, on which refinement does
not converge and GMRES (Y. Saad and M. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986)
needs a few steps. The factors precondition it from the right, so that the residuals
that it makes small are those above.
"""

import cython
from cython.cimports.libc.math import INFINITY, NAN, hypot, sqrt
from cython.cimports.libc.stdlib import malloc
from cython.cimports.namlcp.linalg.vectors import add_scaled, copy, dot, fill

from namlcp.linalg import LEAST_DIVISOR as TINY

# Where a refinement step did not reduce the residual, later refinements end at
# ABOVE_ATTAINED times that residual, which counts as the tolerance at most and is
# slowly forgotten. REFINEMENT_STEPS: most of them in a solve.
ABOVE_ATTAINED, FORGET = 2.0, 0.9
# Residuals are relative to the norm of the right-hand side, or to this if larger.
SMALL_RHS = 1e-8
# Relative residual after refinement above which GMRES is tried, KRYLOV_STEPS of it.
GMRES_ABOVE = 1e-6
# A new direction of this size, relative to the first residual, is rounding.
BREAKDOWN = 1e-14
LEAST_DIVISOR = TINY


def factor(m):
    """Factor K~ unless its factors are at hand; tell whether that succeeds."""
    if is_factored(m):
        return True
    succeeds = m.factors.factor_values(m.data, m)
    copy(m.data, m.factored, m.nnz)
    if not succeeds:
        m.factored[m.nnz - 1] = NAN  # unlike any values
    return succeeds


def is_factored(m):
    """Set row_size_i = max(1, |K~_ii|); tell whether K~ is the matrix last factored."""
    data, factored = m.data, m.factored
    for j in range(m.size):
        m.row_size[j] = max(1.0, abs(data[m.indptr[j + 1] - 1]))
    for t in range(m.nnz - 1, -1, -1):
        if data[t] != factored[t]:
            return False
    return True


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
        last = indptr[j + 1] - 1
        uj = u[j]
        total = data[last] * uj
        for t in range(indptr[j], last):
            i = indices[t]
            r[i] -= data[t] * uj
            total += data[t] * u[i]
        r[j] -= total
    return weighted_norm(r, m.row_size, m.size)


def solve(m):
    """Set du to the solution of K~ du = rhs, refined, and r to its residual."""
    copy(m.rhs, m.r, m.size)
    fill(m.step.du, 0.0, m.size)
    m.rhs_norm = max(SMALL_RHS, weighted_norm(m.rhs, m.row_size, m.size))
    m.step.error, m.solves = INFINITY, 0
    is_done: cython.bint = False
    while not is_done:
        m.factors.solve_into(m.r, m.answer)
        is_done = is_refined(m)
    if m.krylov_pays and not m.step.error <= GMRES_ABOVE:
        improve(m)


def is_refined(m):
    """Add `answer` to the solution du if that reduces its residual r.

    Tells whether the refinement ends: at the accuracy wanted, or where a step does not
    halve the residual.
    """
    du, trial = m.step.du, m.trial
    for j in range(m.size):
        trial[j] = du[j] + m.answer[j]
    error = set_remainder(m, m.rhs, trial, m.trial_r) / m.rhs_norm
    is_first: cython.bint = m.solves == 0
    if not (is_first or error < m.step.error):
        m.attained = min(m.step.error, m.tol)
        return True
    gained: cython.bint = is_first or error <= 0.5 * m.step.error
    m.step.error = error
    m.solves += 1
    m.step.du, m.trial = m.trial, m.step.du
    m.r, m.trial_r = m.trial_r, m.r
    if error <= m.accuracy or not gained or m.solves > REFINEMENT_STEPS:
        return True
    if error > ABOVE_ATTAINED * m.attained:
        return False
    m.attained *= FORGET
    return True


# ---- GMRES


def improve(m):
    """Reduce the residual r of du by GMRES, where it can be halved."""
    size, trial = m.size, m.trial
    if m.krylov == cython.NULL:
        count = (2 * KRYLOV_STEPS + 1) * size + (KRYLOV_STEPS + 1) * (KRYLOV_STEPS + 1)
        m.krylov = cython.cast(cython.p_double, malloc(8 * count))
        if m.krylov == cython.NULL:
            return
    basis = m.krylov
    corrections = basis + (KRYLOV_STEPS + 1) * size
    H = corrections + KRYLOV_STEPS * size
    g = H + KRYLOV_STEPS * (KRYLOV_STEPS + 1)
    steps = krylov_steps(m, basis, corrections, H, g)
    if steps < 0:
        return
    copy(m.step.du, trial, size)
    for k in range(steps - 1, -1, -1):
        for i in range(k + 1, steps):
            g[k] -= H[i * (KRYLOV_STEPS + 1) + k] * g[i]
        g[k] /= H[k * (KRYLOV_STEPS + 1) + k]
        add_scaled(g[k], corrections + k * size, trial, size)
    error = set_remainder(m, m.rhs, trial, m.trial_r) / m.rhs_norm
    m.krylov_pays = error <= 0.5 * m.step.error
    if error < m.step.error:
        m.step.error = error
        m.step.du, m.trial = trial, m.step.du
        m.r, m.trial_r = m.trial_r, m.r


def krylov_steps(m, basis, corrections, H, g):
    """Make up to KRYLOV_STEPS corrections of du; return how many, -1 without a start.

    Column k of H has the products of K~ times correction k with the directions of the
    basis, made triangular by rotations, and g the first residual, rotated.
    """
    size, weight, w, zero = m.size, m.row_size, m.trial_r, m.dt
    rotations = cython.declare(cython.double[16])
    for j in range(size):
        basis[j] = m.r[j] / weight[j]
    first = sqrt(dot(basis, basis, size))
    if not 0.0 < first < INFINITY:
        return -1
    for j in range(size):
        basis[j] /= first
    g[0] = first
    fill(zero, 0.0, size)
    for k in range(KRYLOV_STEPS):
        direction = basis + k * size
        correction, column = corrections + k * size, H + k * (KRYLOV_STEPS + 1)
        for j in range(size):
            m.trial[j] = direction[j] * weight[j]
        m.factors.solve_into(m.trial, correction)
        set_remainder(m, zero, correction, w)
        for j in range(size):
            w[j] /= -weight[j]
        fill(column, 0.0, k + 1)
        for _ in range(2):  # orthogonalised twice against rounding
            for i in range(k + 1):
                part = dot(basis + i * size, w, size)
                column[i] += part
                add_scaled(-part, basis + i * size, w, size)
        norm = sqrt(dot(w, w, size))
        if not norm < INFINITY:
            return k
        rotate(k, norm, column, g, rotations)
        if norm <= BREAKDOWN * first:
            return k + 1
        for j in range(size):
            basis[(k + 1) * size + j] = w[j] / norm
    return KRYLOV_STEPS


def rotate(k, norm, column, g, rotations):
    """Make column k of H, with `norm` below its diagonal, triangular by rotations."""
    for i in range(k):
        cosine, sine = rotations[2 * i], rotations[2 * i + 1]
        a, b = column[i], column[i + 1]
        column[i] = cosine * a + sine * b
        column[i + 1] = cosine * b - sine * a
    length = max(hypot(column[k], norm), LEAST_DIVISOR)
    cosine, sine = column[k] / length, norm / length
    column[k] = length
    g[k + 1] = -sine * g[k]
    g[k] *= cosine
    rotations[2 * k], rotations[2 * k + 1] = cosine, sine
