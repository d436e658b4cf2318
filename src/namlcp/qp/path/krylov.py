"""GMRES for K~ u = rhs where refinement ends early, compiled; m is the record.

Factors of a nearly singular K~ have a few wrong directions, on which refinement does
not converge and GMRES (Y. Saad and M. Schultz, SIAM J. Sci. Stat. Comput. 7, 1986)
needs a few steps. The factors precondition it from the right, so that the residuals
r / row_size that it makes small are those of `newton`; their basis is `basis`, the
corrections of u are the rows of `corrections`.
"""

import numpy as np

from namlcp.compiled import floats_at, kernel, part, record_of
from namlcp.linalg import LEAST_DIVISOR
from namlcp.qp.path.advance import KRYLOV, SOLVE
from namlcp.qp.path.newton import set_remainder
from namlcp.qp.path.steps import WIDTH, put

# Most steps.
KRYLOV_STEPS = 8
# A new direction of this size, relative to the first residual, is rounding.
BREAKDOWN = 1e-14


@kernel(error_model="numpy")
def step_krylov(state):
    """Do what `advance` asks for at the stage KRYLOV, and set the next stage.

    That is to begin, where krylov_step is -1, or to take `answer` as a correction.
    """
    m = record_of(state)
    if m.krylov_step < 0:
        goes_on = begin_krylov(m)
    else:
        goes_on = not is_krylov_done(m)
        if not goes_on:
            end_krylov(m)
    m.stage, m.after = SOLVE if goes_on else m.then, KRYLOV


# Any order of the sum is allowed, so that it vectorises.
@part(fastmath={"reassoc"})
def product(a, b, size):
    """Return a'b."""
    total = 0.0
    for j in range(size):
        total += a[j] * b[j]
    return total


@part
def begin_krylov(m):
    """Set the first direction, from the residual r of du; False if there is none."""
    r, weight = floats_at(m.r, m.size), floats_at(m.row_size, m.size)
    basis, g = floats_at(m.basis, m.size), floats_at(m.g, KRYLOV_STEPS + 1)
    for j in range(m.size):
        basis[j] = r[j] / weight[j]
    beta = np.sqrt(product(basis, basis, m.size))
    if not 0.0 < beta < np.inf:
        return False
    for j in range(m.size):
        basis[j] /= beta
        r[j] = basis[j] * weight[j]
    g[0] = beta
    m.krylov_step, m.krylov_size = 0, beta
    return True


@part
def is_krylov_done(m):
    """Take `answer` as a correction; tell whether it was the last one.

    If not, r is the right-hand side for the next.
    """
    k, size, width = m.krylov_step, m.size, KRYLOV_STEPS + 1
    answer, w = floats_at(m.answer, size), floats_at(m.trial_r, size)
    zero, weight = floats_at(m.dt, size), floats_at(m.row_size, size)
    basis, corrections = (
        floats_at(m.basis, width * size), floats_at(m.corrections, KRYLOV_STEPS * size)
    )  # fmt: skip
    H, g = floats_at(m.H, KRYLOV_STEPS * width), floats_at(m.g, width)
    for j in range(size):
        corrections[k * size + j] = answer[j]
        zero[j] = 0.0
    set_remainder(m, zero, answer, w)
    for j in range(size):
        w[j] /= -weight[j]
    column = k * width
    for i in range(k + 1):
        H[column + i] = 0.0
    for _ in range(2):  # orthogonalised twice against rounding
        for i in range(k + 1):
            direction = floats_at(m.basis + i * size * WIDTH, size)
            part_of_w = product(direction, w, size)
            H[column + i] += part_of_w
            for j in range(size):
                w[j] -= part_of_w * direction[j]
    norm = np.sqrt(product(w, w, size))
    if not norm < np.inf:
        return True
    rotate(k, norm, H, g, floats_at(m.rotations, 2 * KRYLOV_STEPS))
    m.krylov_step = k + 1
    if m.krylov_step == KRYLOV_STEPS or norm <= BREAKDOWN * m.krylov_size:
        return True
    r = floats_at(m.r, size)
    for j in range(size):
        basis[(k + 1) * size + j] = w[j] / norm
        r[j] = basis[(k + 1) * size + j] * weight[j]
    return False


@part
def rotate(k, norm, H, g, rotations):
    """Make column k of H, with `norm` below its diagonal, triangular by rotations."""
    column = k * (KRYLOV_STEPS + 1)
    for i in range(k):
        cosine, sine = rotations[2 * i], rotations[2 * i + 1]
        a, b = H[column + i], H[column + i + 1]
        H[column + i] = cosine * a + sine * b
        H[column + i + 1] = cosine * b - sine * a
    length = max(np.hypot(H[column + k], norm), LEAST_DIVISOR)
    cosine, sine = H[column + k] / length, norm / length
    H[column + k] = length
    g[k + 1] = -sine * g[k]
    g[k] *= cosine
    rotations[2 * k], rotations[2 * k + 1] = cosine, sine


@part
def end_krylov(m):
    """Add the best combination of the corrections to du if that is better."""
    steps, size, width = m.krylov_step, m.size, KRYLOV_STEPS + 1
    H, g = floats_at(m.H, KRYLOV_STEPS * width), floats_at(m.g, width)
    corrections = floats_at(m.corrections, KRYLOV_STEPS * size)
    du, trial = floats_at(m.du, size), floats_at(m.trial, size)
    put(du, size, trial)
    for k in range(steps - 1, -1, -1):
        for i in range(k + 1, steps):
            g[k] -= H[i * width + k] * g[i]
        g[k] /= H[k * width + k]
        for j in range(size):
            trial[j] += g[k] * corrections[k * size + j]
    error = set_remainder(m, floats_at(m.rhs, size), trial, floats_at(m.trial_r, size))
    error /= m.rhs_norm
    m.krylov_pays = error <= 0.5 * m.error
    if error < m.error:
        m.error = error
        m.du, m.trial = m.trial, m.du
