"""The point of the active rows as the user sees it, measured and refined on the data.

The residuals are those of the arguments as given, by their one definition. Refinement
is iterative, with these residuals and the operators at hand, from the point that
`finish` computed: like that, it depends on the active rows alone.
"""

from namlcp.compiled import floats, longs, part
from namlcp.linalg import LEAST_DIVISOR
from namlcp.qp.responses.rows import goal_of, subtract_active
from namlcp.residuals import qp_residuals_of_products

# Nothing is refined where residuals over the moduli of their terms are at most
# ACCURATE, and the residuals themselves at most RESERVE times the absolute tolerance;
# or no more than their own rounding error, which is ROUNDING over these moduli, and at
# most MOST_RESERVE times: for the primal and dual residual and for the gap, which
# refinement hardly changes.
ACCURATE, RESERVE, ROUNDING = 1e-12, 0.05, 4e-15
MOST_RESERVE = 0.1, 0.1, 0.5
# Passes of refinement at most; the factor by which one has to lower the error.
PASSES, GAIN = 3, 0.5
# Numbers of `Residuals`, the last entries of the result.
NUMBERS = 7


@part
def vectors_of(m):
    """Return q, h, b, lb, ub."""
    q, h, b = floats(m.q, m.n), floats(m.h, m.m), floats(m.b, m.p)
    return q, h, b, floats(m.lb, m.n), floats(m.ub, m.n)


@part
def parts_of_result(m):
    """Return x, y, z, z_box of the result."""
    x = floats(m.out, m.n)
    y = floats(m.out + 8 * m.n, m.p)
    z = floats(m.out + 8 * (m.n + m.p), m.m)
    z_box = floats(m.out + 8 * (m.n + m.p + m.m), m.n)
    return x, y, z, z_box


@part
def residuals_of_result(m):
    """Return the numbers of `Residuals` of the result."""
    return floats(m.out + 8 * (2 * m.n + m.p + m.m), NUMBERS)


@part
def set_result(m):
    """Set x, y and z from the values and multipliers, x to active bounds exactly."""
    x, y, z, z_box = parts_of_result(m)
    s = floats(m.s, m.length)
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    multiplier = floats(m.multiplier, m.most + 1)
    for j in range(m.n):
        x[j], z_box[j] = s[m.m + j], 0.0
    for i in range(m.p):
        y[i] = s[m.rows + i]
    for i in range(m.m):
        z[i] = 0.0
    for i in range(m.k):
        row = active[i]
        if row < m.m:
            z[row] = max(multiplier[i], 0.0)
        else:
            x[row - m.m] = goal_of(m, row, side[row])


@part
def measure(m):
    """Set z_box to minus the gradient at active bounds; measure the point.

    Needs the products Px, Gx, Ax, Gtz, Aty of the result. Returns the largest residual
    over the moduli of its terms, with the active rows as equations.
    """
    z_box = parts_of_result(m)[3]
    q, h, Gx = floats(m.q, m.n), floats(m.h, m.m), floats(m.Gx, m.m)
    Px, Gtz, Aty = floats(m.Px, m.n), floats(m.Gtz, m.n), floats(m.Aty, m.n)
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    primal = 0.0
    for i in range(m.k):
        row = active[i]
        if row < m.m:
            primal = max(primal, abs(Gx[row] - h[row]))
        else:
            j = row - m.m
            gradient = Px[j] + q[j] + Gtz[j] + Aty[j]
            sign = side[row]
            z_box[j] = sign * max(-sign * gradient, 0.0)
    measure_result(m)
    found = residuals_of_result(m)
    return max(
        max(primal, found[0]) / max(found[3], LEAST_DIVISOR),
        found[1] / max(found[4], LEAST_DIVISOR),
    )


@part
def measure_result(m):
    """Set the numbers of `Residuals` of the result from its products."""
    Px, Gx, Ax = floats(m.Px, m.n), floats(m.Gx, m.m), floats(m.Ax, m.p)
    Gtz, Aty = floats(m.Gtz, m.n), floats(m.Aty, m.n)
    numbers = qp_residuals_of_products(
        vectors_of(m), parts_of_result(m), (Px, Gx, Ax, Gtz, Aty)
    )
    found = residuals_of_result(m)
    for i in range(NUMBERS):
        found[i] = numbers[i]


@part
def is_accurate(m, error):
    """Tell whether a point with this error of `measure` needs no refinement."""
    found = residuals_of_result(m)
    if not error <= ACCURATE:
        return False
    for i in range(3):
        rounding = min(ROUNDING * found[3 + i], MOST_RESERVE[i] * m.eps_abs)
        if m.eps_abs > 0.0 and found[i] > max(RESERVE * m.eps_abs, rounding):
            return False
    return True


@part
def is_solved(m):
    """Tell whether the residuals of the result are within tolerance."""
    return are_within_tolerance(m, 0.0)


@part
def is_certain(m):
    """Tell whether they are so in whatever order their sums are taken."""
    return are_within_tolerance(m, ROUNDING)


@part
def are_within_tolerance(m, rounding):
    """Tell whether residuals are within tolerance with that much of their terms."""
    found = residuals_of_result(m)
    for i in range(3):
        size = found[3 + i]
        if not found[i] + rounding * size <= m.eps_abs + m.eps_rel * size:
            return False
    return True


@part
def set_correction(m):
    """Set m.rhs = -(dual residual, A x - b), and s to the values of the result."""
    x, y, _, z_box = parts_of_result(m)
    rhs, s = floats(m.rhs, m.n + m.p), floats(m.s, m.length)
    q, b = floats(m.q, m.n), floats(m.b, m.p)
    Px, Gx, Ax = floats(m.Px, m.n), floats(m.Gx, m.m), floats(m.Ax, m.p)
    Gtz, Aty = floats(m.Gtz, m.n), floats(m.Aty, m.n)
    for j in range(m.n):
        rhs[j] = -(Px[j] + q[j] + Gtz[j] + Aty[j] + z_box[j])
        s[m.m + j] = x[j]
    for i in range(m.p):
        rhs[m.n + i] = b[i] - Ax[i]
        s[m.rows + i] = y[i]
    for i in range(m.m):
        s[i] = Gx[i]


@part
def set_step(m):
    """Let m.change lead to the active sides: less sum dmu_i w_i, with dmu in m.work.

    It holds the values of K^-1 m.rhs before.
    """
    s, change = floats(m.s, m.length), floats(m.change, m.length)
    active, side = longs(m.active, m.most + 1), longs(m.side, m.rows)
    work = floats(m.work, m.most + 1)
    for i in range(m.k):
        row = active[i]
        work[i] = change[row] + s[row] - goal_of(m, row, side[row])
    subtract_active(m, change)


@part
def take_step(m):
    """Add m.change to s and m.work to mu."""
    s, change = floats(m.s, m.length), floats(m.change, m.length)
    multiplier, work = floats(m.multiplier, m.most + 1), floats(m.work, m.most + 1)
    for i in range(m.length):
        s[i] += change[i]
    for i in range(m.k):
        multiplier[i] += work[i]


@part
def correct(m):
    """Add a correction to s and mu; m.change are the values of K^-1 m.rhs."""
    set_step(m)
    take_step(m)


@part
def exchange_best(m):
    """Exchange s and mu with the copies of `note_best`."""
    m.s, m.best = m.best, m.s
    m.multiplier, m.best_multiplier = m.best_multiplier, m.multiplier


@part
def note_best(m):
    """Copy s and mu."""
    s, best = floats(m.s, m.length), floats(m.best, m.length)
    multiplier = floats(m.multiplier, m.most + 1)
    best_multiplier = floats(m.best_multiplier, m.most + 1)
    for i in range(m.length):
        best[i] = s[i]
    for i in range(m.k):
        best_multiplier[i] = multiplier[i]


@part
def set_contradiction(m):
    """Set y and z to the multipliers that `step` found to contradict the rows."""
    x, y, z, z_box = parts_of_result(m)
    s, direction = floats(m.s, m.length), floats(m.direction, m.length)
    active, ratio = longs(m.active, m.most + 1), floats(m.ratio, m.most + 1)
    sign = m.entering_side
    for j in range(m.n):
        x[j], z_box[j] = s[m.m + j], 0.0
    for i in range(m.m):
        z[i] = 0.0
    for i in range(m.p):
        y[i] = -sign * direction[m.rows + i]
    for i in range(m.k):
        if active[i] < m.m:
            z[active[i]] = -sign * ratio[i]
    if m.entering < m.m:
        z[m.entering] = 1.0
