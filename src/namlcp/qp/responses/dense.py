"""Dense QPs by responses: the base problem and its solution operator.

With P = L L', V = L^-1, T = V A' and S = T'T = M M', U = M^-1, the base problem
min 1/2 x'Px + q'x, A x = b has the solution

    y = -U'U (T'V q + b),   x = -V'(V q + T y).

V, T and U are formed once. Two products with a triangle take as long as one with P^-1,
but lose about half as many digits (Higham, Accuracy and Stability of Numerical
Algorithms, 2nd ed., chapter 14). An equation that depends on those before it has the
multiplier 0.

A singular P may be definite where A x = 0. Then P + A'WA takes its place, W diagonal:
with the equations it has the same x, and its multipliers are y - W b instead of y. Else
P + W does, with the W of `weight`, and the QP is solved by `proximal`.
"""

import numpy as np

from namlcp.compiled import floats, longs, part
from namlcp.linalg import (
    PSD_SLACK,
    add_scaled,
    cholesky,
    copy,
    dot,
    invert_lower,
    largest_entry,
)
from namlcp.qp.responses.judgement import parts_of_result
from namlcp.qp.responses.matrices import (
    factor_in_place,
    four_dots,
    invert_triangle,
    row_of,
    times_rows,
    times_triangle,
    times_triangle_transposed,
)
from namlcp.qp.responses.rows import (
    claim_place,
    forget_responses,
    has_response,
    violation_of,
)
from namlcp.qp.responses.weight import NO_WEIGHT, set_shape, wanted_rho

# Ratio of the largest to the smallest pivot of P from which on products with V are too
# inaccurate; for P + W, the ratio of a diagonal entry to its pivot.
MOST_SPREAD = 1e9
# Added to the diagonal of P, relative to its largest entry, in the test whether P is
# semidefinite.
ROUNDING_UNIT = 1e-15
# Pivot of S over its diagonal entry up to which an equation depends on others; most
# equations for a variable, and for two more.
DEPENDENT_EQUATION, MOST_EQUATIONS = 1e-11, 2
# Operations of one response from which on four are made at once.
LARGE = 5000
# Curvature of a row of norm 1, over the largest entry of P^-1, up to which the
# equations fix the row: rounding errors for the largest spread are smaller.
FIXED = 1e-12


@part
def set_up(m):
    """Factor P, or what takes its place; False where the matrices do not allow it.

    They do not if a number is NaN or infinite, or P is not symmetric or not
    semidefinite. m.wanted > 0 asks for P + W. A single QP without equations goes with L
    until a row enters, which needs V. (Not so an item of a batch: its last digits would
    depend on the items before it.)
    """
    if m.p > MOST_EQUATIONS * (m.n + 2) or not is_sound(m):
        return False
    m.pull, m.rho, m.skipped = 0.0, 0.0, 0
    is_plain = m.wanted <= 0.0 and (factor_plain(m) or factor_pulled(m))
    if not is_plain and (m.wanted == NO_WEIGHT or not factor_weighted(m)):
        return False
    forget_responses(m)
    m.is_inverted = 0
    if not (m.is_single and m.p == 0 and m.items_left == 0):
        invert_factor(m)
    return True


@part
def is_sound(m):
    """Set the norms of rows; tell whether P and G are finite, and P is symmetric."""
    n, fine = m.n, set_row_scales(m)
    for i in range(n):
        row = row_of(m.P, i, n)
        for j in range(i):
            if row[j] != row_of(m.P, j, n)[i] or not abs(row[j]) < np.inf:
                return False
        fine = fine and abs(row[i]) < np.inf
    return fine


@part
def copy_cost(m, slack):
    """Copy the lower triangle of P, its diagonal times 1 + slack; return max P_ii."""
    n, largest = m.n, 0.0
    for i in range(n):
        row, factor = row_of(m.P, i, n), row_of(m.factor, i, n)
        copy(row[: i + 1], factor)
        factor[i] *= 1.0 + slack
        largest = max(largest, row[i])
    return largest


@part
def has_factor(m):
    """Overwrite the lower triangle in m.factor by its Cholesky factor, if that exists.

    By LAPACK if m.is_large.
    """
    if m.is_large:
        return cholesky(floats(m.factor, (m.n, m.n))) == 0
    return factor_in_place(m.factor, m.n, 0.0) == 0


@part
def has_good_factor(m):
    """Do as `has_factor`; False, too, where the pivots differ too much."""
    if not has_factor(m):
        return False
    low, high = np.inf, 0.0
    for i in range(m.n):
        root = row_of(m.factor, i, m.n)[i]
        low, high = min(low, root), max(high, root)
    return high * high <= MOST_SPREAD * low * low


@part
def factor_plain(m):
    """Factor P; False where that has no good factor."""
    copy_cost(m, 0.0)
    return has_good_factor(m)


@part
def is_semidefinite(m):
    """Tell whether P is positive semidefinite; overwrites m.factor."""
    m.largest = copy_cost(m, PSD_SLACK)
    for i in range(m.n):
        if row_of(m.P, i, m.n)[i] < 0.0:
            return False
    if m.largest == 0.0:  # then P must be 0
        return largest_entry(floats(m.P, m.n * m.n)) == 0.0
    for i in range(m.n):  # else an empty row has the pivot 0
        row_of(m.factor, i, m.n)[i] += ROUNDING_UNIT * m.largest
    return has_factor(m)


@part
def factor_pulled(m):
    """Factor P + A'WA, W_ii = m.pull / |a_i|^2; False where that has no good factor.

    False, too, where P is not semidefinite: the equations may hide that.
    """
    n = m.n
    if m.p == 0 or not is_semidefinite(m) or m.largest == 0.0:
        return False
    m.pull = m.largest
    copy_cost(m, 0.0)
    for k in range(m.p):
        row, weight = row_of(m.A, k, n), weight_of(m, k)
        for i in range(n):
            if row[i] != 0.0:
                factor = row_of(m.factor, i, n)
                add_scaled(weight * row[i], row[: i + 1], factor[: i + 1])
    return has_good_factor(m)


@part
def factor_weighted(m):
    """Factor P + W; False where P is not semidefinite, or W is too small."""
    n = m.n
    if not is_semidefinite(m):
        return False
    set_shape(m)
    m.pull, m.rho = 0.0, wanted_rho(m)
    copy_cost(m, 0.0)
    weight, shape = floats(m.weight, n), floats(m.shape, n)
    for i in range(n):
        weight[i] = m.rho * shape[i]
        row_of(m.factor, i, n)[i] += weight[i]
    if not has_factor(m):
        return False
    for i in range(n):
        root = row_of(m.factor, i, n)[i]
        if not row_of(m.P, i, n)[i] + weight[i] <= MOST_SPREAD * root * root:
            return False
    return True


@part
def weight_of(m, k):
    """Return W_kk: the weight at which a_k a_k' is as large as P, 0 without a pull."""
    row = row_of(m.A, k, m.n)
    squares = dot(row, row)
    return m.pull / squares if squares > 0.0 else 0.0


@part
def invert_factor(m):
    """Turn L into V, and compute T and U."""
    n, p = m.n, m.p
    if m.is_large:
        V = floats(m.factor, (n, n))
        invert_lower(V)
        for i in range(n):
            for j in range(i + 1, n):
                V[i, j] = 0.0
    else:
        invert_triangle(m.factor, n)
    set_curvature(m)
    m.is_inverted = 1
    for i in range(p):
        times_triangle(m.factor, n, row_of(m.A, i, n), row_of(m.equations, i, n))
        out, column = row_of(m.schur, i, p), row_of(m.equations, i, n)
        for j in range(i + 1):
            out[j] = dot(row_of(m.equations, j, n), column)
    m.skipped = factor_in_place(m.schur, p, DEPENDENT_EQUATION)
    invert_triangle(m.schur, p)


@part
def set_curvature(m):
    """Set m.least_curvature from the largest diagonal entry of P^-1 = V'V, scaled."""
    n, half, unit = m.n, floats(m.halves, m.n), floats(m.scale, m.rows)[m.m :]
    for j in range(n):
        half[j] = 0.0
    for i in range(n):
        row = row_of(m.factor, i, n)
        for j in range(i + 1):
            half[j] += row[j] * row[j]
    largest = 0.0
    for j in range(n):
        largest = max(largest, half[j] * unit[j] * unit[j])
    m.least_curvature = FIXED * largest


@part
def set_row_scales(m):
    """Set 1 over the norms of the rows; tell whether those of G and A are finite."""
    scale = floats(m.scale, m.rows)
    fine = True
    for i in range(m.m):
        row = row_of(m.G, i, m.n)
        squares = dot(row, row)
        fine = fine and squares < np.inf
        scale[i] = 1.0 / np.sqrt(squares) if squares > 0.0 else 1.0
    for i in range(m.m, m.rows):
        scale[i] = 1.0
    for i in range(m.p):
        row = row_of(m.A, i, m.n)
        fine = fine and dot(row, row) < np.inf
    return fine


# ---- the operator


@part
def set_values_of(m, rhs, values):
    """Set values = (G x, x, y) for (x, y) = K^-1 rhs, see `active`."""
    if m.is_inverted:
        half = floats(m.halves, m.n)
        times_triangle(m.factor, m.n, rhs[: m.n], half)
        finish_values(m, rhs, half, values)
    else:
        solve_with_factor(m, rhs, values[m.m : m.rows])
    times_rows(m.G, m.m, m.n, values[m.m : m.rows], values)


@part
def finish_values(m, rhs, half, values):
    """Set x and y in values = (G x, x, y) from half = V r; overwrites `half`."""
    n, p = m.n, m.p
    y, work = values[m.rows :], floats(m.schur_work, p)
    if p > 0:
        times_rows(m.equations, p, n, half, y)
        for i in range(p):
            y[i] -= rhs[n + i]
        times_triangle(m.schur, p, y, work)
        times_triangle_transposed(m.schur, p, work, y)
        for i in range(p):
            add_scaled(-y[i], row_of(m.equations, i, n), half)
            if m.pull > 0.0:
                y[i] += weight_of(m, i) * rhs[n + i]
    times_triangle_transposed(m.factor, n, half, values[m.m : m.rows])


@part
def solve_with_factor(m, rhs, x):
    """Set x to the solution of P x = rhs by the factor L of P."""
    n = m.n
    for i in range(n):
        row = row_of(m.factor, i, n)
        x[i] = (rhs[i] - dot(row[:i], x[:i])) / row[i]
    for i in range(n - 1, -1, -1):
        row = row_of(m.factor, i, n)
        x[i] /= row[i]
        add_scaled(-x[i], row[:i], x[:i])


@part
def make_responses(m):
    """Make the response to row m.asked, and of a large QP those to three more rows.

    To read V and G takes longer than to multiply with them.
    """
    if not m.is_inverted:
        invert_factor(m)
    size = m.n + m.p
    set_unit_load(m, m.asked, floats(m.rhs, size))
    if m.n * (m.n + m.m) < LARGE:
        set_values_of(m, floats(m.rhs, size), claim_place(m, m.asked))
        return
    first, second, third = companions(m)
    set_unit_load(m, first, floats(m.rhs + 8 * size, size))
    set_unit_load(m, second, floats(m.rhs + 16 * size, size))
    set_unit_load(m, third, floats(m.rhs + 24 * size, size))
    spare = floats(m.change, m.length)
    outs = (
        claim_place(m, m.asked),
        claim_place(m, first) if first >= 0 else spare,
        claim_place(m, second) if second >= 0 else spare,
        claim_place(m, third) if third >= 0 else spare,
    )
    set_four_values(m, outs)


@part
def set_unit_load(m, row, rhs):
    """Set rhs = (c, 0) for the coefficients c of a row, 0 for row -1."""
    for j in range(rhs.size):
        rhs[j] = 0.0
    if row >= m.m:
        rhs[row - m.m] = 1.0
    elif row >= 0:
        copy(row_of(m.G, row, m.n), rhs)


@part
def companions(m):
    """Return three rows whose responses may be asked for next, -1 for none.

    They are the rows violated most, most of which enter later, or those of a hint.
    """
    s, scale = floats(m.s, m.length), floats(m.scale, m.rows)
    kept = longs(m.kept_active, m.most + 1)
    first, second, third = -1, -1, -1
    most, less, least = 0.0, 0.0, 0.0
    is_hint = m.entering < 0
    for i in range(m.hinted if is_hint else 0, m.hints if is_hint else m.rows):
        row = kept[i] if is_hint else i
        if row == m.asked or has_response(m, row):
            continue
        weight = 1.0 / (1 + i) if is_hint else violation_of(m, row, s[row]) * scale[row]
        if weight > most:
            first, second, third = row, first, second
            most, less, least = weight, most, less
        elif weight > less:
            second, third = row, second
            less, least = weight, less
        elif weight > least:
            third, least = row, weight
    return first, second, third


@part
def set_four_values(m, outs):
    """Do what `set_values_of` does for four right-hand sides in m.rhs.

    The sums for one of them do not depend on the others.
    """
    n, size = m.n, m.n + m.p
    first, second, third, fourth = outs
    a, b = floats(m.rhs, size), floats(m.rhs + 8 * size, size)
    c, d = floats(m.rhs + 16 * size, size), floats(m.rhs + 24 * size, size)
    va, vb = floats(m.halves, n), floats(m.halves + 8 * n, n)
    vc, vd = floats(m.halves + 16 * n, n), floats(m.halves + 24 * n, n)
    for i in range(n):
        row = row_of(m.factor, i, n)[: i + 1]
        va[i], vb[i], vc[i], vd[i] = four_dots(row, a, b, c, d)
    finish_values(m, a, va, first)
    finish_values(m, b, vb, second)
    finish_values(m, c, vc, third)
    finish_values(m, d, vd, fourth)
    a, b = first[m.m : m.rows], second[m.m : m.rows]
    c, d = third[m.m : m.rows], fourth[m.m : m.rows]
    for i in range(m.m):
        first[i], second[i], third[i], fourth[i] = four_dots(
            row_of(m.G, i, m.n), a, b, c, d
        )


@part
def set_products(m):
    """Set the products of the result with P, G and A."""
    times_rows(m.P, m.n, m.n, floats(m.out, m.n), floats(m.Px, m.n))
    set_products_of_rows(m)


@part
def set_products_of_base(m):
    """Do as `set_products` where x is that of the base problem, whose values have G x.

    To multiply with G once more would take a quarter of such a solve.
    """
    times_rows(m.P, m.n, m.n, floats(m.out, m.n), floats(m.Px, m.n))
    copy(floats(m.s0, m.m), floats(m.Gx, m.m))
    set_other_products(m)


@part
def set_products_of_rows(m):
    """Set the products of the result with G and A."""
    times_rows(m.G, m.m, m.n, floats(m.out, m.n), floats(m.Gx, m.m))
    set_other_products(m)


@part
def set_other_products(m):
    """Set A x, G'z and A'y of the result."""
    x, y, z, _ = parts_of_result(m)
    times_rows(m.A, m.p, m.n, x, floats(m.Ax, m.p))
    Gtz, Aty = floats(m.Gtz, m.n), floats(m.Aty, m.n)
    for j in range(m.n):
        Gtz[j], Aty[j] = 0.0, 0.0
    for i in range(m.m):
        if z[i] != 0.0:
            add_scaled(z[i], row_of(m.G, i, m.n), Gtz)
    for i in range(m.p):
        add_scaled(y[i], row_of(m.A, i, m.n), Aty)
