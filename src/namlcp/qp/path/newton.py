"""Solution of K~ u = rhs with refinement, compiled; m is the record of `Workspace`.

Residuals are measured as max |r_i| / max(1, |K~_ii|): rows of inactive constraints have
diagonals of 1e10 and more, and would outweigh all others. The solution of every system
K~ answer = r comes from outside, so that a caller may factor K~ in its own way.
"""

import numpy as np

from namlcp.compiled import floats_at, ints_at, part

# Most refinement steps of a solve.
REFINEMENT_STEPS = 11
# Where a step did not reduce the residual, later refinements end at ABOVE_ATTAINED
# times that residual, which counts as the tolerance at most and is slowly forgotten.
ABOVE_ATTAINED, FORGET = 2.0, 0.9
# Residuals are relative to the norm of the right-hand side, or to this if larger.
SMALL_RHS = 1e-8


@part
def is_factored(m):
    """Set row_size_i = max(1, |K~_ii|); tell whether K~ is the matrix last factored."""
    indptr, row_size = ints_at(m.indptr, m.size + 1), floats_at(m.row_size, m.size)
    nnz = np.int64(indptr[m.size])
    data, factored = floats_at(m.data, nnz), floats_at(m.factored, nnz)
    for j in range(m.size):
        row_size[j] = max(1.0, abs(data[indptr[j + 1] - 1]))
    for t in range(nnz - 1, -1, -1):
        if data[t] != factored[t]:
            return False
    return True


@part
def keep_factored(m):
    """Remember the values of K~ that are factored now."""
    nnz = np.int64(ints_at(m.indptr, m.size + 1)[m.size])
    data, factored = floats_at(m.data, nnz), floats_at(m.factored, nnz)
    for t in range(nnz):
        factored[t] = data[t]
    if not m.is_factored:
        factored[nnz - 1] = np.nan  # unlike any values


@part
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


@part
def set_remainder(m, b, u, r):
    """Set r = b - K~ u; return its norm max |r_i| / row_size_i."""
    indptr = ints_at(m.indptr, m.size + 1)
    nnz = np.int64(indptr[m.size])
    indices, data = ints_at(m.indices, nnz), floats_at(m.data, nnz)
    for i in range(m.size):
        r[i] = b[i]
    for j in range(m.size):
        last = indptr[j + 1] - 1
        uj = u[j]
        total = data[last] * uj
        for t in range(indptr[j], last):
            i = indices[t]
            r[i] -= data[t] * uj
            total += data[t] * u[i]
        r[j] -= total
    return weighted_norm(r, floats_at(m.row_size, m.size), m.size)


@part
def begin_solve(m):
    """Let the first system to solve be K~ answer = rhs."""
    r, rhs = floats_at(m.r, m.size), floats_at(m.rhs, m.size)
    du = floats_at(m.du, m.size)
    for j in range(m.size):
        r[j] = rhs[j]
        du[j] = 0.0
    norm = weighted_norm(rhs, floats_at(m.row_size, m.size), m.size)
    m.rhs_norm = max(SMALL_RHS, norm)
    m.error, m.solves = np.inf, 0


@part
def is_refined(m):
    """Add `answer` to the solution du if that reduces its residual r.

    Tells whether the refinement ends: at the accuracy wanted, or where a step does not
    halve the residual.
    """
    du, answer = floats_at(m.du, m.size), floats_at(m.answer, m.size)
    trial, trial_r = floats_at(m.trial, m.size), floats_at(m.trial_r, m.size)
    for j in range(m.size):
        trial[j] = du[j] + answer[j]
    error = set_remainder(m, floats_at(m.rhs, m.size), trial, trial_r) / m.rhs_norm
    first = m.solves == 0
    if not (first or error < m.error):
        m.attained = min(m.error, m.tol)
        return True
    gained = first or error <= 0.5 * m.error
    m.error = error
    m.solves += 1
    m.du, m.trial = m.trial, m.du
    m.r, m.trial_r = m.trial_r, m.r
    if error <= m.accuracy or not gained or m.solves > REFINEMENT_STEPS:
        return True
    if error > ABOVE_ATTAINED * m.attained:
        return False
    m.attained *= FORGET
    return True
