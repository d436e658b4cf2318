"""Tridiagonal box LCPs by elimination, from a start that is nearly right.

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0); a
"face" is the states of all. Each iteration solves the free system of one face by the
Thomas algorithm; then every unknown with a wrong sign changes its state: for an
M-matrix this is policy iteration. From a good start (the previous time step of an
American option) one or two faces suffice.

A segment of free unknowns begins an elimination of its own, but if A is dominant, the
pivots equal those of A to rounding after a few rows. The pivots of A are stored, so
that no divisions are needed from there on.
"""

import cython
import numpy as np
from cython.cimports.libc.math import NAN, fabs, sqrt

from namlcp.status import Status

# Violation of a sign, relative to Res(clip(0)), that counts as 0; relative difference
# up to which two pivots count as equal.
SIGN_ROUNDING, SAME_PIVOT = 1e-15, 4.0 * np.finfo(float).eps


class Faces:
    """A tridiagonal LCP, the face, and the point that it gives."""


def read_rows(indptr, indices, data, rows):
    """Write the rows of a canonical CSR matrix; tell if it is tridiagonal, a_ii > 0.

    The entries of INVERSE are NaN from the first pivot that is not positive.
    """
    coupling = 0.0
    for i in range(indptr.shape[0] - 1):
        rows[BELOW, i] = rows[DIAGONAL, i] = rows[ABOVE, i] = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k] - i
            if j < -1 or j > 1:
                return False
            rows[j + 1, i] = data[k]
        if not rows[DIAGONAL, i] > 0.0:
            return False
        pivot = rows[DIAGONAL, i] - rows[BELOW, i] * coupling
        rows[INVERSE, i] = 1.0 / pivot if pivot > 0.0 else NAN
        coupling = rows[ABOVE, i] * rows[INVERSE, i]
        rows[ROOT, i] = 1.0 / sqrt(rows[DIAGONAL, i])
    return True


def eliminate(m):
    """Write z and w of a face, change the states with a wrong sign; return how many.

    Returns -1 if a pivot is not positive; sets m.inside, whether z is in the box. The
    elimination gives z_i = t_i - c_i z_{i+1}, of bounded unknowns t_i = bound, c_i = 0.
    This recurrence limits the speed, so all else is done in its loops.
    """
    below, diagonal, above, inverses = m.below, m.diagonal, m.above, m.inverse
    root, q, lower, upper = m.root, m.q, m.lower, m.upper
    state, z, w, coupling = m.state, m.z, m.w, m.coupling
    n, slack, t, c = m.n, m.slack, 0.0, 0.0
    same: cython.bint = True  # c is that of the elimination of A itself
    positive: cython.bint = True
    inside: cython.bint = True
    for i in range(n):
        if state[i] != 0:
            t = lower[i] if state[i] < 0 else upper[i]
            c = 0.0
            same = False
        elif same:
            inverse = inverses[i]
            t = -q[i] * inverse - (below[i] * inverse) * t
            c = above[i] * inverse
        else:
            pivot = diagonal[i] - below[i] * c
            positive &= pivot > 0.0
            inverse = 1.0 / pivot
            t = (-q[i] - below[i] * t) * inverse
            c = above[i] * inverse
            same = fabs(pivot * inverses[i] - 1.0) <= SAME_PIVOT
        z[i] = t
        coupling[i] = c
    wrong: cython.Py_ssize_t = 0
    left, here, right = z[n - 1], 0.0, 0.0
    for j in range(n - 1, -1, -1):
        right, here = here, left
        left = 0.0
        if j > 0:
            left = z[j - 1]
            if state[j - 1] == 0:
                left -= coupling[j - 1] * here
                z[j - 1] = left
        r = below[j] * left + diagonal[j] * here
        r = r + above[j] * right + q[j]
        w[j] = r
        if state[j] != 0:
            if state[j] * r * root[j] > slack and lower[j] < upper[j]:
                state[j] = 0
                wrong += 1
        elif not lower[j] <= here <= upper[j]:
            inside = False
            tolerance = slack * root[j]
            if here < lower[j] - tolerance or here > upper[j] + tolerance:
                state[j] = -1 if here < lower[j] else 1
                wrong += 1
            positive &= here == here  # stored pivots that are not positive are NaN
    m.inside = inside
    return wrong if positive else -1


def clip_into_box(m, z, w):
    """Clip z to the bounds and write w = A z + q, summed as SciPy sums it."""
    below, diagonal, above, q = m.below, m.diagonal, m.above, m.q
    for i in range(m.n):
        z[i] = clip(z[i], m.lower[i], m.upper[i])
    left, here, last = 0.0, z[0], m.n - 1
    for i in range(last):
        right = z[i + 1]
        w[i] = below[i] * left + diagonal[i] * here + above[i] * right + q[i]
        left, here = here, right
    w[last] = below[last] * left + diagonal[last] * here + q[last]


def set_residuals(m, z, w):
    plain, scaled = 0.0, 0.0
    for i in range(m.n):
        x, low, high = z[i], z[i] - m.lower[i], z[i] - m.upper[i]
        r = max(min(w[i], low), high) + 0.0 * x
        plain += r * r
        b = m.root[i]  # before squaring, or low may underflow
        a = m.diagonal[i] * b
        r = max(min(w[i] * b, low * a), high * a) + 0.0 * x
        scaled += r * r
    m.plain, m.scaled = sqrt(plain), sqrt(scaled)


def begin(m):
    """Take clip(0) as best point, and the states after a step of Jacobi from z."""
    fill(m.best_z, 0.0, m.n)
    clip_into_box(m, m.best_z, m.best_w)
    set_residuals(m, m.best_z, m.best_w)
    m.size = m.least = m.scaled
    m.slack = max(SIGN_ROUNDING, 0.01 * m.eps_rel / sqrt(m.n)) * m.size
    if m.size == 0.0:
        return SOLVED
    clip_into_box(m, m.z, m.w)
    for i in range(m.n):
        s = m.z[i] - m.w[i] * (m.root[i] * m.root[i])
        m.state[i] = (s >= m.upper[i]) - (s <= m.lower[i])
    return MORE


def solve_face(m):
    """Solve the face, keep the best point; return MORE where there is a next face."""
    wrong = eliminate(m)
    if wrong < 0:
        return STUCK
    if not m.inside:
        clip_into_box(m, m.z, m.w)
    set_residuals(m, m.z, m.w)
    if wrong == 0 or m.scaled < m.least:
        m.least = m.scaled
        copy(m.z, m.best_z, m.n)
        copy(m.w, m.best_w, m.n)
    if wrong > 0:
        return MORE
    is_solved = are_met(m.eps_abs, m.eps_rel, m.size, m.plain, m.scaled)
    return SOLVED if is_solved else ROUNDED


def solve_tridiagonal(lcp, z0, limits):
    """Solve a box LCP with a tridiagonal matrix; iterations are faces.

    STALLED: every sign is right, but rounding keeps Res above the tolerance.
    DIVERGED: this method makes no progress; another one may go on from z.
    """
    n: cython.Py_ssize_t = lcp.q.size
    deadline, most = limits.deadline, min(limits.max_iter or MOST_FACES, MOST_FACES)
    # z and w of the face, c_i of the elimination; the best point so far.
    state, face, best = np.empty(n, np.int8), np.empty((3, n)), np.empty((2, n))
    face[0] = 0.0 if z0 is None else z0
    m: Faces = Faces()
    m.n, rows, m.state = n, numbers(lcp.matrix.tridiagonal, 5 * n), signs(state, n)
    m.below, m.diagonal = rows + BELOW * n, rows + DIAGONAL * n
    m.above, m.inverse, m.root = rows + ABOVE * n, rows + INVERSE * n, rows + ROOT * n
    m.q, m.lower = numbers(lcp.q, n), numbers(lcp.lower, n)
    m.upper, m.z = numbers(lcp.upper, n), numbers(face, 3 * n)
    m.w, m.coupling, m.best_z = m.z + n, m.z + 2 * n, numbers(best, 2 * n)
    m.best_w = m.best_z + n
    m.eps_abs, m.eps_rel = limits.tolerances
    faces = 0
    with cython.nogil:
        code: cython.int = begin(m)
    while code == MORE and faces < most and not (faces and deadline.reached()):
        with cython.nogil:
            code = solve_face(m)
        faces += 1
        if limits.report is not None:
            limits.report(faces, lcp.residual(*best), np.count_nonzero(state))
    status = (Status.SOLVED, Status.DIVERGED, Status.DIVERGED, Status.STALLED)[code]
    if code == MORE and faces == limits.max_iter:
        status = Status.MAX_ITER
    elif code == MORE and deadline.reached():
        status = Status.TIME_LIMIT
    return lcp.outcome(status, *best, faces, "tridiagonal")
