"""A whole solve: pivots, and the point refined; proximal rounds for a P without factor.

The point is measured by the one definition of the residuals (`namlcp.residuals`), on
the arguments as given. Refinement is iterative, with these residuals and the operators
at hand, from the point of `finish`: like that, it depends on the active rows alone.

Where P has no good factor, the base problem has one with P + W in its place, W = rho D.
A round with the centre c, at first 0,

1. minimises 1/2 x'Px + q'x + 1/2 (x - c)'W(x - c) by `engine`, from the active rows of
   the round before: its base solution is K^-1 (W c - q, b); x is the next centre;
2. minimises the cost without W on the face of the active rows F, by `judge`.

If the point at hand has the right signs and violates no row, the QP is solved. Every
centre is feasible and the cost falls from round to round, so that no F comes back
(Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898). Centres that move along a
direction without curvature, in which no row is met and the cost falls, have found a
ray: the QP is unbounded.

The second step is the refinement with K_F, the operator of P + W on the face. With
r = P x + q + G'z + A'y, z the multipliers of G, and mu those of active rows, it takes

    (dx, dy) = K^-1 (-r, b - A x),   dmu = S^-1 (dx_F + s_F - d_F),   s = (G x, x, y),

mu += dmu, y += dy, x += dx - sum dmu_i w_i: a proximal step on the face, after which
the part of the error along a curvature c of P, in units of D, is rho / (rho + c) of
that before. As rho is small, there are one to three steps, mostly.

D is the diagonal of P, with the geometric mean of its positive entries in place of the
others, and rho a multiple of

    max(1, tau),   tau = max |q_j| / sqrt(D_j)  over  mean |d_i| / |D^-1/2 c_i|:

in variables scaled by sqrt(D), the largest slope over the geometric mean of the
distances of all planes c_i x = d_i from 0, that is the curvature which has its minimum
about as far away as they are. With P = 0 that is tau alone. A power of 16 in its place
lets rho be the same for most QPs with the same matrices. Norms of rows and sizes of x
are those in the scaled variables, too.
"""

import cython
from cython.cimports.libc.math import INFINITY, exp, fabs, floor, log, sqrt

from namlcp import checks

# A point is refined until its residuals over the moduli of their terms are at most
# ACCURATE, or FRESH if x was made in one go or in rounds, and within tolerance by
# ROUNDING of these moduli. Each of the CORRECTIONS has to lower them by the part GAIN.
ACCURATE, FRESH, ROUNDING, GAIN = 1e-12, 1e-14, 4e-15, 0.5
# In place of 0 where a size is divided by; what is infinite beside sides of about 1.
LEAST_DIVISOR, INFINITE = checks.LEAST_DIVISOR, checks.INFINITE
# rho over that power of 16, if no other is asked for; m.wanted without any weight.
RHO, NO_WEIGHT = 1e-6, -1.0
# Of a ray d of size 1, in scaled variables: the largest P d, and the growth of a row of
# norm 1 that is rounding.
MOST_CURVED, LEAST_GROWTH = 1e-9, 1e-11


def is_fit(m):
    """Begin a solve; False where no factor is good, or a number is not fit for it.

    That is one that is NaN, infinite or huge, or a side opposed to the other.
    """
    m.pivots, m.operations = 0, 0.0
    fine: cython.bint = True
    most = INFINITE
    for j in range(m.n):
        fine = fine and fabs(m.q[j]) < INFINITY and m.lb[j] <= m.ub[j]
        fine = fine and (-most < m.lb[j] < most or m.lb[j] == -INFINITY)
        fine = fine and (-most < m.ub[j] < most or m.ub[j] == INFINITY)
    for i in range(m.p):
        fine = fine and fabs(m.b[i]) < INFINITY
    for i in range(m.m):
        fine = fine and (-most < m.h[i] < most or m.h[i] == INFINITY)
    if fine and m.is_ready and (m.rho == 0.0 or m.rho == wanted_rho(m)):
        return True
    return fine and m.set_up()


def solve_at_hand(m):
    """Solve the QP at the pointers of m, after `is_fit`."""
    m.entering, m.level = -1, VIOLATION_ROUNDING
    if m.rho != 0.0:
        found = solve_by_rounds(m)
    elif m.begin() and drop_wrong_signs(m):
        found = pivot(m)
        if found == DONE:
            found = judge(m) if m.finish() else STUCK
    else:
        found = STUCK
    if found == LATE:
        m.set_x(m.rhs, m.multiplier, m.s)
        set_point(m)
        clip_point(m)
        m.set_products(False)
        measure_point(m)
    elif found == CONTRADICTION and not m.on_face:
        refine_contradiction(m)
    return found


def solve_by_rounds(m):
    """Solve a QP with W; with UNBOUNDED z_box is a ray.

    First on the active rows of the last QP, or a hint, which the proximal term would
    leave for others: a start at a degenerate solution takes fewer pivots like that.
    """
    found = STUCK
    m.level = ROUND_ROUNDING
    fill(m.centre, 0.0, m.rows)
    m.begin()
    if m.k > 0:
        m.set_multipliers()
        m.set_point_values()
        found = judge(m)
    for turn in range(MOST_ROUNDS):
        if found != STUCK:
            return found
        drop_wrong_signs(m)
        found = pivot(m)
        if found != DONE:
            return found
        for i in range(m.rows):
            m.direction[i], m.centre[i] = m.s[i] - m.centre[i], m.s[i]
        found = judge(m)
        if found == STUCK:
            if turn > 0 and is_ray(m):  # 0, the first centre, need not be feasible
                return UNBOUNDED
            set_base_values(m)
    return found


# ---- the point


def set_point(m):
    """Set x, y and z from the values and multipliers, x to active bounds exactly."""
    copy(m.s + m.m, m.x, m.n)
    copy(m.s + m.rows, m.y, m.p)
    fill(m.z_box, 0.0, m.n)
    fill(m.z, 0.0, m.m)
    for i in range(m.k):
        row = m.active[i]
        if row < m.m:
            m.z[row] = m.multiplier[i]
        else:
            m.x[row - m.m] = goal_of(m, row, m.side[row])


def clip_point(m):
    """Move x and z into their bounds; tell whether one was out."""
    x, lb, ub = m.x, m.lb, m.ub
    was_out: cython.bint = False
    for i in range(m.m):
        if m.z[i] < 0.0:
            m.z[i], was_out = 0.0, True
    for j in range(m.n):
        if x[j] < lb[j] or x[j] > ub[j]:
            x[j] = clip(x[j], lb[j], ub[j])
            was_out = True
    return was_out


def measure_point(m):
    """Set z_box to minus the gradient at active bounds; measure a point with products.

    Returns the largest residual over its terms, with the active rows as equations.
    """
    t: Terms
    primal = 0.0
    for i in range(m.k):
        row = m.active[i]
        if row < m.m:
            primal = max(primal, fabs(m.Gx[row] - m.h[row]))
        else:
            j = row - m.m
            gradient = m.Px[j] + m.q[j] + m.Gtz[j] + m.Aty[j]
            sign, m.z_box[j] = m.side[row], -gradient
            if sign * gradient > 0.0 and not is_pinned(m, row):
                m.z_box[j] = 0.0
    t.n, t.m, t.p = m.n, m.m, m.p
    t.q, t.h, t.b, t.lb, t.ub = m.q, m.h, m.b, m.lb, m.ub
    t.x, t.y, t.z, t.z_box = m.x, m.y, m.z, m.z_box
    t.Px, t.Gx, t.Ax, t.Gtz, t.Aty = m.Px, m.Gx, m.Ax, m.Gtz, m.Aty
    found = cython.address(m.found)
    measure(cython.address(t), found)
    return max(
        max(primal, found.primal) / max(found.primal_size, LEAST_DIVISOR),
        found.dual / max(found.dual_size, LEAST_DIVISOR),
    )


def are_within(m, rounding):
    """Tell whether the residuals are within tolerance with that much of their terms."""
    found, eps = cython.address(m.found), m.eps_abs
    relative = m.eps_rel - rounding
    return (
        found.primal <= eps + relative * found.primal_size
        and found.dual <= eps + relative * found.dual_size
        and found.gap <= eps + relative * found.gap_size
    )


def verdict(m):
    is_far: cython.bint = m.found.primal_size >= INFINITE  # any rows seem to hold
    if not are_within(m, 0.0) or (is_far and m.found.primal > m.eps_abs):
        return STUCK
    return DONE if are_within(m, ROUNDING) else SUMMED


# ---- refinement


def set_correction(m):
    """Set m.rhs = -(dual residual, A x - b), and s to the values of the point."""
    for j in range(m.n):
        m.rhs[j] = -(m.Px[j] + m.q[j] + m.Gtz[j] + m.Aty[j] + m.z_box[j])
        m.s[m.m + j] = m.x[j]
    for i in range(m.p):
        m.rhs[m.n + i] = m.b[i] - m.Ax[i]
        m.s[m.rows + i] = m.y[i]
    copy(m.Gx, m.s, m.m)


def set_change(m, to_sides):
    """Set m.change to K^-1 m.rhs less the sum of m.ratio_i w_i of the active rows.

    It leads these rows to their sides, or else is 0 there.
    """
    m.set_values(m.rhs, m.change)
    for i in range(m.k):
        row = m.active[i]
        m.ratio[i] = m.change[row]
        if to_sides:
            m.ratio[i] = m.change[row] + m.s[row] - goal_of(m, row, m.side[row])
    triangle_solve(m.triangle, m.k, m.ratio)
    triangle_solve_transposed(m.triangle, m.k, m.ratio)
    subtract_responses(m, m.ratio, m.k, m.change)
    m.set_x(m.rhs, m.ratio, m.change)


def judge(m):
    """Measure the point; refine it as long as that is needed and pays.

    With W a correction is a proximal step on the face of the active rows.
    """
    error = INFINITY
    least = ACCURATE if m.length > m.m and m.rho == 0.0 else FRESH
    for turn in range(CORRECTIONS + 1):
        set_point(m)
        m.set_products(not clip_point(m) and m.k + m.pivots + turn == 0)
        before, error = error, measure_point(m)
        is_fine: cython.bint = error <= least and are_within(m, ROUNDING)
        if is_fine or turn == CORRECTIONS or not error <= GAIN * before:
            break
        if m.on_face:  # which the other form refines
            return STUCK
        if is_over(m, 0.0):  # `set_values` counts
            return LATE
        set_correction(m)
        set_change(m, True)
        add_scaled(1.0, m.change, m.s, m.rows + m.p)
        add_scaled(1.0, m.ratio, m.multiplier, m.k)
    return verdict(m)


def is_ray(m):
    """Tell whether a d near m.direction is a ray; it is in z_box then.

    Inverse iteration on the face, d = K_F^-1 W d, takes away what is curved.
    """
    n, along = m.n, m.direction
    fill(m.rhs + n, 0.0, m.p)
    for _ in range(RAY_PASSES):
        for j in range(n):
            m.rhs[j] = m.weight[j] * along[m.m + j]
        set_change(m, False)
        copy(m.change, along, m.rows)
    size, curved = size_of(m, along), 0.0
    for i in range(m.rows):
        growth = along[i] * m.scale[i]
        if fabs(growth) > LEAST_GROWTH * size:
            if growth > 0.0 and goal_of(m, i, 1) < INFINITY:
                return False
            if growth < 0.0 and i >= m.m and goal_of(m, i, -1) > -INFINITY:
                return False
    m.times_cost(along + m.m, m.Px)
    for j in range(n):
        curved = max(curved, fabs(m.Px[j]) / m.scale[m.m + j])
    if not dot(m.q, along + m.m, n) < 0.0 or not curved <= MOST_CURVED * size:
        return False
    copy(along + m.m, m.z_box, n)
    return True


# ---- certificates


def refine_contradiction(m):
    """Refine y and z, which contradict the rows: G'z + A'y = 0 off bounds."""
    for _ in range(REFINEMENTS):
        m.set_products(False)
        for j in range(m.n):
            m.rhs[j] = -(m.Gtz[j] + m.Aty[j])
        fill(m.rhs + m.n, 0.0, m.p)
        for i in range(m.k):
            if m.active[i] >= m.m:
                m.rhs[m.active[i] - m.m] = 0.0
        if m.entering >= m.m:
            m.rhs[m.entering - m.m] = 0.0
        set_change(m, False)
        for i in range(m.k):
            if m.active[i] < m.m:
                m.z[m.active[i]] += m.ratio[i]
        add_scaled(1.0, m.change + m.rows, m.y, m.p)


# ---- the weights


def set_shape(m):
    """Make m.shape, the diagonal of P in it, that of D; set the norms of x."""
    total, count = 0.0, 0
    for j in range(m.n):
        if m.shape[j] > 0.0:
            total += log(m.shape[j])
            count += 1
    mean = exp(total / max(count, 1))
    for j in range(m.n):
        if not m.shape[j] > 0.0:
            m.shape[j] = mean
        m.scale[m.m + j] = sqrt(m.shape[j])


def wanted_rho(m):
    total, count, largest = 0.0, 0, 0.0
    for i in range(m.p + m.m + 2 * m.n):
        row = i - m.p
        if row < 0:
            distance = m.b[i] * m.reach[i]
        elif row < m.m:
            distance = m.h[row] * m.scale[row]
        elif row < m.rows:
            distance = m.lb[row - m.m] * m.scale[row]
        else:
            distance = m.ub[row - m.rows] * m.scale[row - m.n]
        if 0.0 < fabs(distance) < INFINITY:
            total += log(fabs(distance))
            count += 1
    for j in range(m.n):
        largest = max(largest, fabs(m.q[j]) / m.scale[m.m + j])
    tau = largest / exp(total / max(count, 1))
    if m.largest > 0.0 or not tau > 0.0:
        tau = max(1.0, tau)
    factor = m.wanted if m.wanted > 0.0 else RHO
    return factor * 16.0 ** floor(log(tau) / log(16.0))
