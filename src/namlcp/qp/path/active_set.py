"""The KKT system of an active set, compiled; m is the record of `Workspace`.

The system is that of `refinement`, for the constraints in `set_active`. Its unknowns
are set_x and set_v = (0, y, net z); `held` marks the variables at active bounds and the
inactive rows, which do not change. Proximal iterations with the factors of its
regularised matrix solve it, dependent active rows or not.
"""

import numpy as np

from namlcp.compiled import floats_at, ints_at, part
from namlcp.qp.path.steps import multiply, put

# Modulus of a diagonal entry of K~ that fixes a variable or drops a row.
OFF = 1e20
# Unscaled residual that ends the iterations.
RESIDUAL_GOAL = 1e-14
# A first residual below this counts as this in the demand for a tenfold reduction.
SMALL_ENOUGH = 1e-11
# A scaled multiplier or slack below minus this has the wrong sign.
WRONG_SIGN = 1e-12


@part
def hold(m):
    """Set the diagonal of K~, `held`, the right-hand side `goal` and the first point.

    That is set_x, moved to its active bounds, and v = (0, set_y, set_Z where active).
    """
    n, p = m.n, m.p
    held, active = ints_at(m.held, m.size), ints_at(m.set_active, m.m)
    goal, v = floats_at(m.goal, m.size), floats_at(m.set_v, m.size)
    x, y, Z = floats_at(m.set_x, n), floats_at(m.set_y, p), floats_at(m.set_Z, m.m)
    b, c = floats_at(m.goal_b, p), floats_at(m.goal_c, m.m)
    place, sign = ints_at(m.place, m.m), floats_at(m.sign, m.m)
    for j in range(m.size):
        held[j] = j >= n + p
        v[j] = 0.0
    for i in range(p):
        v[n + i] = y[i]
        goal[n + i] = b[i]
    for k in range(m.m):
        if active[k]:
            j = place[k]
            held[j] = j < n
            goal[j] = sign[k] * c[k]
            if j < n:
                x[j] = goal[j]
            else:
                v[j] = sign[k] * Z[k]
    indptr = ints_at(m.indptr, m.size + 1)
    nnz = np.int64(indptr[m.size])
    base, data = floats_at(m.base, nnz), floats_at(m.data, nnz)
    for j in range(n):
        last = indptr[j + 1] - 1
        data[last] = OFF if held[j] else base[last] + m.regularisation
    for j in range(n, m.size):
        data[indptr[j + 1] - 1] = -OFF if held[j] else -m.regularisation
    m.first_error = m.least_error = np.inf
    m.failures = m.solves = 0


@part
def set_residual(m):
    """Set r to minus the residual of the system; return its unscaled max norm."""
    n = m.n
    x, v = floats_at(m.set_x, n), floats_at(m.set_v, m.size)
    held = ints_at(m.held, m.size)
    Px, Ctv, t = floats_at(m.Pdx, n), floats_at(m.Ctdv, n), floats_at(m.dv, m.size)
    r, q, goal = floats_at(m.r, m.size), floats_at(m.cost, n), floats_at(m.goal, m.size)
    unit = floats_at(m.unit, m.size)
    multiply(m, x, v, Px, Ctv, t)
    worst = 0.0
    for j in range(m.size):
        r[j] = 0.0
        if not held[j]:
            if j < n:
                r[j] = -(Px[j] + q[j] + Ctv[j])
                size = abs(r[j]) / unit[j]
            else:
                r[j] = goal[j] - t[j]
                size = abs(r[j]) * unit[j]
            if not size <= worst:
                worst = size
    return worst


@part
def is_set_solved(m):
    """Measure the point; tell whether the iterations end, with the best point kept.

    They end when the residual is rounding, or twice in a row not halved. `converged`
    tells whether it fell tenfold, or below a tenth of SMALL_ENOUGH.
    """
    error = set_residual(m)
    if m.solves == 0:
        m.first_error = max(error, SMALL_ENOUGH)
    m.failures = 0 if error < 0.5 * m.least_error else m.failures + 1
    x, v = floats_at(m.set_x, m.n), floats_at(m.set_v, m.size)
    kept_x, kept_v = floats_at(m.kept_x, m.n), floats_at(m.kept_v, m.size)
    if error < m.least_error or m.solves == 0:
        m.least_error = error
        put(x, m.n, kept_x)
        put(v, m.size, kept_v)
    goes_on = error > RESIDUAL_GOAL and m.failures < 2 and error < np.inf
    if goes_on and m.solves < m.most_solves:
        return False
    put(kept_x, m.n, x)
    put(kept_v, m.size, v)
    m.converged = m.least_error <= 0.1 * m.first_error
    return True


@part
def correct_set(m):
    """Add `answer` to what is not held."""
    x, v = floats_at(m.set_x, m.n), floats_at(m.set_v, m.size)
    answer = floats_at(m.answer, m.size)
    held = ints_at(m.held, m.size)
    for j in range(m.size):
        if not held[j]:
            if j < m.n:
                x[j] += answer[j]
            else:
                v[j] += answer[j]
    m.solves += 1


@part
def choose_next_set(m):
    """Set set_y, set_Z, the largest violation, and the next active set.

    That has the active constraints with multipliers >= 0 and the violated ones. The
    multiplier of a bound follows from stationarity.
    """
    n = m.n
    x, v = floats_at(m.set_x, n), floats_at(m.set_v, m.size)
    Px, Ctv, t = floats_at(m.Pdx, n), floats_at(m.Ctdv, n), floats_at(m.dv, m.size)
    multiply(m, x, v, Px, Ctv, t)
    q, y, c = floats_at(m.cost, n), floats_at(m.set_y, m.p), floats_at(m.goal_c, m.m)
    place, sign = ints_at(m.place, m.m), floats_at(m.sign, m.m)
    active, chosen = ints_at(m.set_active, m.m), ints_at(m.next_active, m.m)
    Z = floats_at(m.set_Z, m.m)
    for i in range(m.p):
        y[i] = v[n + i]
    unit = floats_at(m.unit, m.size)
    m.set_changed = False
    violation = 0.0
    for k in range(m.m):
        j = place[k]
        if active[k]:
            gradient = v[j] if j >= n else -(Px[j] + q[j] + Ctv[j])
            multiplier = sign[k] * gradient
            violation = max(violation, -multiplier / unit[j])
            chosen[k] = multiplier > -WRONG_SIGN
            Z[k] = max(multiplier, 0.0)
        else:
            slack = c[k] - sign[k] * t[j]
            violation = max(violation, -slack * unit[j])
            chosen[k] = slack < -WRONG_SIGN
            Z[k] = 0.0
        if chosen[k] != active[k]:
            m.set_changed = True
    m.set_violation = violation
