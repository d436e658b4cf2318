"""Dense QPs: the base problem of `engine` and its solution operator.

With P = L L', V = L^-1, T = V A' and S = T'T = M M', U = M^-1, the base problem
min 1/2 x'Px + q'x, A x = b has the solution

    y = -U'U (T'V q + b),   x = -V'(V q + T y).

V, T and U are formed once. Two products with a triangle take as long as one with P^-1,
but lose about half as many digits (Higham, Accuracy and Stability of Numerical
Algorithms, 2nd ed., chapter 14). An equation that depends on those before it has the
multiplier 0.

In place of a P without a good factor is P + W, with W, and the QP is solved as in
`rounds`.

In a sequence with most variables at bounds the same steps, by the same rules and
tolerances, are taken on the *face* of the active rows: with the variables F not at
bounds (B: all others) and the *held* rows C x = d, the equations and the active rows of
G. Their multipliers r and x_F solve

    [P_FF  C_F'] [x_F]   [-q_F - P_FB x_B]
    [C_F   0   ] [ r ] = [d - C_B x_B    ]

by L L' = P_FF, T = C_F L'^-1 and R R' = T T'; the multipliers of the active bounds are
minus the gradient. An entering row c changes x_F by -t z and r by -t v, where z and v
solve the same system for (c_F, 0); the rest of the row orthogonal to the active ones is
c_F'z, and the multipliers of bounds change by -t (c - P z - C'v)_B. So a step costs
n nf operations instead of n k for k active rows, and bounds cost nothing: this pays
where nf and the held rows are fewer than k, for nf up to 2/3 n. T and R are computed
anew in every step, as few rows are held. Where too many variables are free or rows
depend on each other there is no face: code STUCK.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, NAN, fabs, isinf, sqrt

from namlcp.linalg import factors

# Ratio of the largest to the smallest pivot of P from which on products with V are too
# inaccurate; for P + W, the ratio of a diagonal entry to its pivot.
MOST_SPREAD = 1e9
# Added to the diagonal of P, relative to its largest entry and to each, in the test
# whether P is semidefinite.
ROUNDING_UNIT = 1e-15
PSD_SLACK = factors.PSD_SLACK
# Pivot of S over its diagonal entry up to which an equation depends on others.
DEPENDENT_EQUATION = 1e-11
# Curvature of a row of norm 1, over the largest entry of P^-1, up to which the
# equations fix the row: rounding errors for the largest spread are smaller.
FIXED = 1e-12
# Residual of a dependent equation over its terms from which on it contradicts others.
CONTRADICTED = 1e-9
# Other values of m.wanted, see `decide`.
LESS_RHO, MORE_RHO = 1e-2 * RHO, 1e2 * RHO
# MOST_EQUATIONS: most equations for a variable, and for two more. MOST_ROWS: most rows
# for a variable for which responses are made before they are asked for, if more than
# one of MANY is violated.


class DenseActiveSet(ActiveSet):
    """A QP with row-major matrices; a sequence has room for the face, too."""

    def lay_out(self):
        n, p = self.n, self.p
        self.most = n  # not n - p: equations may depend on others
        lay_out_rows(self)
        self.factor, self.equations = reals(self, n * n), reals(self, p * n)
        self.schur, self.schur_work = reals(self, p * p), reals(self, p)
        self.half, self.no_bound = reals(self, n), reals(self, 2 * n)
        self.most_free, self.is_free, self.face_is_kept = 0, False, False
        if self.is_single or n > self.most + p:
            return
        self.most_free = count = min(2 * n // 3, self.most)
        triangle = count * (count + 1) // 2
        self.free, self.free_triangle = indices(self, count), reals(self, triangle)
        self.held_rows = reals(self, count * count)
        self.held_triangle = reals(self, triangle)
        self.free_part, self.held_part = reals(self, count), reals(self, count)
        self.load, self.slope = reals(self, n), reals(self, n + p)

    def set_values(self, rhs, values):
        n, p, half = self.n, self.p, self.half
        x, y = values + self.m, values + self.rows
        self.since += n * self.length
        times_triangle(self.factor, n, rhs, half)
        if p > 0:
            times_rows(self.equations, p, n, n, half, y)
            add_scaled(-1.0, rhs + n, y, p)
            times_triangle(self.schur, p, y, self.schur_work)
            times_triangle_transposed(self.schur, p, self.schur_work, y)
            for i in range(p):
                add_scaled(-y[i], self.equations + i * n, half, n)
        times_triangle_transposed(self.factor, n, half, x)
        times_rows(self.G, self.m, n, n, x, values)

    def set_x(self, rhs, factor, values):
        if self.length > self.m:
            return
        n, x = self.n, values + self.m
        copy(rhs, x, n)
        for i in range(self.k):
            add_scaled(-factor[i], self.G + self.active[i] * n, x, n)
        times_triangle(self.factor, n, x, self.half)
        times_triangle_transposed(self.factor, n, self.half, x)

    def make_response(self, row):
        self.operations += self.n * self.length
        set_unit_load(self, row, self.rhs)
        self.set_values(self.rhs, claim_place(self, row))

    def set_products(self, is_base):
        n = self.n
        self.times_cost(self.x, self.Px)
        if is_base:  # another product with G would take a quarter of such a solve
            copy(self.s0, self.Gx, self.m)
        else:
            times_rows(self.G, self.m, n, n, self.x, self.Gx)
        times_rows(self.A, self.p, n, n, self.x, self.Ax)
        fill(self.Gtz, 0.0, n)
        fill(self.Aty, 0.0, n)
        add_times_transposed(self.G, self.m, n, self.z, self.Gtz)
        add_times_transposed(self.A, self.p, n, self.y, self.Aty)

    def decide(self):
        """Solve the QP at hand, in a sequence on the face where that is smaller.

        Where that fails, the active rows of the last QP are a hint for the other form,
        which has no factor of theirs. A single QP is solved with another W if need be:
        a small one leaves little to the passes of `rounds`, and lets rows contradict
        each other by rounding.
        """
        if self.is_free and self.is_ready and self.k > 0:
            self.on_face = True
            found = solve_and_prove(self)
            self.on_face, self.face_is_kept = False, found == DONE
            if found != STUCK:
                return found
            self.hints, self.k = self.k, 0
        found = solve_and_prove(self)
        if not self.is_single:
            bounds: Py_ssize_t = 0
            for i in range(self.k):
                bounds += self.active[i] >= self.m
            is_plain: cython.bint = self.rho == 0.0 and self.skipped == 0
            is_plain = is_plain and found == DONE and self.most_free > 0
            self.is_free = is_plain and self.n - bounds + self.p < bounds
            self.face_is_kept = False
            return found
        if (found != STUCK and found != UNPROVED) or self.wanted != 0.0:
            return found
        if self.pivots > self.max_iter or self.operations > self.most_operations:
            return found
        self.wanted = LESS_RHO if found == STUCK else MORE_RHO
        self.is_ready = False
        forget_rows(self)
        found = solve_and_prove(self)
        self.wanted, self.is_ready = 0.0, False  # for the next QP
        return found

    def set_up(self):
        """Factor P, or P + W, which m.wanted > 0 asks for, and what depends on that."""
        self.is_ready = False
        if self.p > MOST_EQUATIONS * (self.n + 2) or not is_sound(self):
            return False
        self.rho, self.skipped, self.length = 0.0, 0, self.rows + self.p
        is_plain: cython.bint = self.wanted <= 0.0 and factor_cost(self)
        if not is_plain and (self.wanted == NO_WEIGHT or not factor_weighted(self)):
            return False
        forget_responses(self)
        invert_factor(self)
        if self.is_large and self.is_single and self.rho == 0.0:
            prepare(self)
        self.is_ready = True
        return True

    def times_cost(self, x, Px):
        if not self.on_face:
            times_rows(self.P, self.n, self.n, self.n, x, Px)
            return
        copy(self.load, Px, self.n)
        for i in range(self.free_count):
            j = self.free[i]
            add_scaled(x[j], self.P + j * self.n, Px, self.n)

    def begin(self):
        if not self.on_face:
            return ActiveSet.begin(self)
        self.base_size = 0.0
        for i in range(self.k):
            row = self.active[i]
            if isinf(goal_of(self, row, self.side[row])):
                self.side[row], self.face_is_kept = 0, False
        if not self.face_is_kept and not factor_face(self):
            return False
        set_load(self)
        return True

    def project(self, row):
        if not self.on_face:
            return ActiveSet.project(self, row)
        direction, slope, scale = self.direction, self.slope, self.scale[row]
        set_unit_load(self, row, slope)
        set_free_part(self, slope, self.free_part)
        fill(self.held_part, 0.0, self.p + self.held)
        fill(direction, 0.0, self.rows)
        rest = solve_face(self, direction)
        if not rest * scale * scale > self.least_curvature:
            rest = 0.0
            fill(self.free_part, 0.0, self.free_count)
            fill(direction, 0.0, self.rows)
        times_rows(self.G, self.m, self.n, self.n, direction + self.m, direction)
        set_multipliers_of(self, self.ratio)
        return rest

    def append(self, row, side, multiplier, rest):
        if not self.on_face:
            return ActiveSet.append(self, row, side, multiplier, rest)
        if row < self.m:
            insert_place(self, self.held, row, side, multiplier)
            self.held += 1
        else:
            insert_place(self, self.k, row, side, multiplier)
            at: Py_ssize_t = 0
            while self.free[at] != row - self.m:
                at += 1
            triangle, count = self.free_triangle, self.free_count
            remove_from_triangle(triangle, count, at, self.coefficient, self.ratio)
            self.free_count -= 1
            for i in range(at, self.free_count):
                self.free[i] = self.free[i + 1]
            self.s[row] = goal_of(self, row, side)
            add_scaled(self.s[row], self.P + (row - self.m) * self.n, self.load, self.n)
        return factor_held(self)

    def remove(self, i):
        if not self.on_face:
            return ActiveSet.remove(self, i)
        j = self.active[i] - self.m
        remove_place(self, i)
        if j < 0:
            self.held -= 1
        elif append_free(self, j):
            add_scaled(-self.s[self.m + j], self.P + j * self.n, self.load, self.n)
        else:
            return False
        return factor_held(self)

    def set_multipliers(self):
        """Set the point on the face, too."""
        if not self.on_face:
            ActiveSet.set_multipliers(self)
            return
        set_face_point(self)
        for j in range(self.n):
            self.slope[j] = -self.q[j] - self.load[j]
        set_multipliers_of(self, self.multiplier)

    def set_point_values(self):
        """Set G x: on the face `set_multipliers` has set the rest."""
        if not self.on_face:
            ActiveSet.set_point_values(self)
            return
        times_rows(self.G, self.m, self.n, self.n, self.s + self.m, self.s)

    def finish(self):
        """On the face: the point as a function of the active rows alone."""
        if not self.on_face:
            return ActiveSet.finish(self)
        if self.changed:
            if self.free_count <= MOST_SORTED and not factor_face(self):
                return False
            set_load(self)
            set_face_point(self)
        self.changed = False
        return True


# ---- the factors


def is_sound(m):
    """Set 1 over the norms of rows; tell whether P, G and A are finite, and P = P'."""
    n, P = m.n, m.P
    fine: cython.bint = True
    for i in range(m.m):
        squares = dot(m.G + i * n, m.G + i * n, n)
        fine = fine and squares < INFINITY
        m.scale[i] = 1.0 / sqrt(squares) if squares > 0.0 else 1.0
    fill(m.scale + m.m, 1.0, n)
    for i in range(m.p):
        fine = fine and dot(m.A + i * n, m.A + i * n, n) < INFINITY
    for i in range(n):
        for j in range(i + 1):
            if P[i * n + j] != P[j * n + i] or not fabs(P[i * n + j]) < INFINITY:
                return False
    return fine


def has_factor(m, slack):
    """Factor P, its diagonal times 1 + slack plus m.weight; tell if that can be."""
    n = m.n
    for i in range(n):
        row = m.factor + i * n
        copy(m.P + i * n, row, i + 1)
        row[i] = row[i] * (1.0 + slack) + m.weight[i]
    return (
        cholesky(m.factor, n) if m.is_large else factor_in_place(m.factor, n, 0.0) == 0
    )


def factor_cost(m):
    """Factor P; False where it has no factor, or pivots that differ too much."""
    low, high = INFINITY, 0.0
    fill(m.weight, 0.0, m.n)
    if not has_factor(m, 0.0):
        return False
    for i in range(m.n):
        root = m.factor[i * m.n + i]
        low, high = min(low, root), max(high, root)
    return high * high <= MOST_SPREAD * low * low


def factor_weighted(m):
    """Factor P + W; False where P is not semidefinite, or W is too small."""
    n, m.largest = m.n, 0.0
    for i in range(n):
        m.shape[i] = m.P[i * n + i]
        m.largest = max(m.largest, m.shape[i])
        if m.shape[i] < 0.0:
            return False
    fill(m.weight, ROUNDING_UNIT * m.largest, n)  # else an empty row has 0
    if m.largest == 0.0:  # then P must be 0
        if largest_entry(m.P, n * n) > 0.0:
            return False
    elif not has_factor(m, PSD_SLACK):
        return False
    set_shape(m)
    for i in range(m.m):
        m.scale[i] = reach_of(m.G + i * n, m.shape, n)
    for i in range(m.p):
        m.reach[i] = reach_of(m.A + i * n, m.shape, n)
    m.rho = wanted_rho(m)
    for i in range(n):
        m.weight[i] = m.rho * m.shape[i]
    if not has_factor(m, 0.0):
        return False
    for i in range(n):
        root = m.factor[i * n + i]
        if not m.P[i * n + i] + m.weight[i] <= MOST_SPREAD * root * root:
            return False
    return True


def reach_of(row, shape, n):
    """Return 1 / |D^-1/2 c| for a row c, 1 for an empty one."""
    squares = 0.0
    for j in range(n):
        squares += row[j] * row[j] / shape[j]
    return 1.0 / sqrt(squares) if squares > 0.0 else 1.0


def invert_factor(m):
    """Turn L into V, and compute T and U.

    Sets m.least_curvature from the largest diagonal entry of P^-1 = V'V, scaled.
    """
    n, p, half, unit = m.n, m.p, m.half, m.scale + m.m
    if m.is_large:
        invert_lower(m.factor, n)
        for i in range(n):
            fill(m.factor + i * n + i + 1, 0.0, n - i - 1)
    else:
        invert_triangle(m.factor, n)
    fill(half, 0.0, n)
    for i in range(n):
        row = m.factor + i * n
        for j in range(i + 1):
            half[j] += row[j] * row[j]
    largest = 0.0
    for j in range(n):
        largest = max(largest, half[j] * unit[j] * unit[j])
    m.least_curvature = FIXED * largest
    for i in range(p):
        column = m.equations + i * n
        times_triangle(m.factor, n, m.A + i * n, column)
        for j in range(i + 1):
            m.schur[i * p + j] = dot(m.equations + j * n, column, n)
    m.skipped = factor_in_place(m.schur, p, DEPENDENT_EQUATION)
    invert_triangle(m.schur, p)


def set_unit_load(m, row, rhs):
    """Set rhs = (c, 0) for the coefficients c of a row."""
    fill(rhs, 0.0, m.n + m.p)
    if row >= m.m:
        rhs[row - m.m] = 1.0
    else:
        copy(m.G + row * m.n, rhs, m.n)


def prepare(m):
    """Make the responses to all rows of G at once, if many are violated at the base.

    Most of those enter sooner or later; one by one the speed of memory limits them.
    Without bounds they hold G u alone: steps need no x, but for the rounding of it.
    """
    n, rows = m.n, m.m
    if m.p > 0 or rows > min(MOST_ROWS * n, m.capacity):
        return
    set_base_values(m)
    violated: Py_ssize_t = 0
    for i in range(rows):
        violated += m.s0[i] > m.h[i]
    if MANY * violated <= rows:
        return
    has_bounds: cython.bint = False
    for j in range(n):
        has_bounds = has_bounds or not (isinf(m.lb[j]) and isinf(m.ub[j]))
    W, U, width = m.responses, m.responses + rows, m.length  # G P^-1 G' beside G P^-1
    if not has_bounds:
        m.length, width, U = rows, n, W + rows * rows
    for i in range(rows):
        claim_place(m, i)
        copy(m.G + i * n, U + i * width, n)
    times_lower(U, rows, width, m.factor, n, b"T")
    add_gram(U, rows, n, width, b"T", 0.0, W, m.length)
    if has_bounds:
        times_lower(U, rows, width, m.factor, n, b"N")
    for i in range(rows):
        for j in range(i):
            W[j * m.length + i] = W[i * m.length + j]


# ---- a whole solve


def solve_and_prove(m):
    if not is_fit(m):
        return STUCK
    if m.skipped > 0 and contradicts_equations(m):
        return proved(m, CONTRADICTION)
    found = solve_at_hand(m)
    return proved(m, found) if found == CONTRADICTION or found == UNBOUNDED else found


def proved(m, found):
    """Turn a candidate for a certificate into one; UNPROVED where it is none."""
    P: Matrix
    G: Matrix
    A: Matrix
    c: Claim
    numbers, claim = cython.address(m.found), cython.address(c)
    P.lines, P.width, P.values, P.starts = m.n, m.n, m.P, cython.NULL
    G.lines, G.width, G.values, G.starts = m.m, m.n, m.G, cython.NULL
    A.lines, A.width, A.values, A.starts = m.p, m.n, m.A, cython.NULL
    c.P, c.G, c.A = cython.address(P), cython.address(G), cython.address(A)
    c.n, c.m, c.p, c.tol = m.n, m.m, m.p, m.eps_abs
    c.q, c.h, c.b, c.lb, c.ub = m.q, m.h, m.b, m.lb, m.ub
    c.units, c.largest, c.r = m.s, m.change, m.direction
    c.primal, c.dual = NAN, NAN
    if found == CONTRADICTION:
        done = prove_infeasible(claim, m.x, m.y, m.z, m.z_box)
        fill(m.x, NAN, m.n)
    else:
        done = prove_unbounded(claim, m.x, m.y, m.z, m.z_box)
        copy(m.z_box, m.x, m.n)
        fill(m.z_box, NAN, m.n)
        fill(m.y, NAN, m.p)
        fill(m.z, NAN, m.m)
    numbers.primal, numbers.dual, numbers.gap = c.primal, c.dual, NAN
    numbers.primal_size, numbers.dual_size, numbers.gap_size = NAN, NAN, NAN
    numbers.objective = NAN
    return found if done else UNPROVED


def contradicts_equations(m):
    """Tell whether a dependent equation contradicts others, by the candidate y then."""
    x = m.s + m.m
    at: Py_ssize_t = -1
    worst: cython.double = CONTRADICTED
    fill(m.rhs, 0.0, m.n)
    copy(m.b, m.rhs + m.n, m.p)
    m.set_values(m.rhs, m.s)
    for i in range(m.p):
        row = m.A + i * m.n
        rest, size = -m.b[i], fabs(m.b[i])
        for j in range(m.n):
            rest += row[j] * x[j]
            size += fabs(row[j] * x[j])
        if fabs(rest) > worst * size:
            worst, at = fabs(rest) / size, i
    if at < 0:
        return False
    copy(x, m.x, m.n)
    fill(m.y, 0.0, m.p)
    fill(m.z, 0.0, m.m)
    m.y[at] = 1.0
    k, m.k, m.entering = m.k, 0, -1
    refine_contradiction(m)
    m.k = k
    if dot(m.b, m.y, m.p) > 0.0:
        for i in range(m.p):
            m.y[i] = -m.y[i]
    return True


# ---- the face


def factor_face(m):
    """Compute all factors from the sides of the rows, in sorted order."""
    m.k, m.held, m.free_count = 0, 0, 0
    for row in range(m.rows):
        if m.side[row] != 0:
            m.active[m.k] = row
            m.k += 1
            m.held += row < m.m
    for j in range(m.n):
        if m.side[m.m + j] == 0 and not append_free(m, j):
            return False
    return factor_held(m)


def held_row(m, i):
    return m.A + i * m.n if i < m.p else m.G + m.active[i - m.p] * m.n


def set_free_part(m, vector, out):
    for i in range(m.free_count):
        out[i] = vector[m.free[i]]


def append_free(m, j):
    """Append variable j to L, if there is room and P allows it."""
    count, row, b = m.free_count, m.P + j * m.n, m.free_part
    if count == m.most_free:
        return False
    set_free_part(m, row, b)
    triangle_solve(m.free_triangle, count, b)
    rest = row[j] - dot(b, b, count)
    if not rest > 0.0:
        return False
    append_to_triangle(m.free_triangle, count, b, sqrt(rest))
    m.free[count] = j
    m.free_count += 1
    return True


def factor_held(m):
    """Compute T and R from L; tell whether the held rows are independent."""
    count, held, b = m.free_count, m.p + m.held, m.held_part
    if held > count:
        return False
    for i in range(held):
        t = m.held_rows + i * m.most_free
        set_free_part(m, held_row(m, i), t)
        triangle_solve(m.free_triangle, count, t)
        times_rows(m.held_rows, i, m.most_free, count, t, b)
        triangle_solve(m.held_triangle, i, b)
        rest = dot(t, t, count) - dot(b, b, i)
        if not rest > 0.0:
            return False
        append_to_triangle(m.held_triangle, i, b, sqrt(rest))
    return True


def solve_face(m, values):
    """Solve P_FF x + C_F' r = f, C_F x = g: f is in m.free_part, g in m.held_part.

    x and r take their places, and go to values, without G x. Returns the squared length
    of the part of L^-1 f orthogonal to T; 0.0 where it depends on T.
    """
    count, held, f, r = m.free_count, m.p + m.held, m.free_part, m.held_part
    triangle_solve(m.free_triangle, count, f)
    whole = dot(f, f, count)
    for i in range(held):
        r[i] = dot(m.held_rows + i * m.most_free, f, count) - r[i]
    triangle_solve(m.held_triangle, held, r)
    triangle_solve_transposed(m.held_triangle, held, r)
    for i in range(held):
        add_scaled(-r[i], m.held_rows + i * m.most_free, f, count)
    rest = dot(f, f, count)
    triangle_solve_transposed(m.free_triangle, count, f)
    for i in range(count):
        values[m.m + m.free[i]] = f[i]
    copy(r, values + m.rows, m.p)
    return rest if rest > DEPENDENT * whole else 0.0


def set_load(m):
    """Put the active bounds into x, and set the load P_B x_B."""
    fill(m.load, 0.0, m.n)
    for j in range(m.n):
        row = m.m + j
        if m.side[row] != 0:
            m.s[row] = goal_of(m, row, m.side[row])
            if m.s[row] != 0.0:
                add_scaled(m.s[row], m.P + j * m.n, m.load, m.n)


def set_face_point(m):
    """Set x_F, and r in m.held_part."""
    x = m.s + m.m
    for i in range(m.free_count):
        j = m.free[i]
        m.free_part[i], x[j] = -m.q[j] - m.load[j], 0.0
    for i in range(m.p + m.held):
        goal = m.b[i] if i < m.p else m.h[m.active[i - m.p]]
        m.held_part[i] = goal - dot(held_row(m, i), x, m.n)
    solve_face(m, m.s)
    copy(m.held_part + m.p, m.multiplier, m.held)


def set_multipliers_of(m, multiplier):
    """Set those of the active rows for x_F in m.free_part and r in m.held_part.

    m.slope has what P_F x_F + C'r is subtracted from.
    """
    for i in range(m.free_count):
        add_scaled(-m.free_part[i], m.P + m.free[i] * m.n, m.slope, m.n)
    for i in range(m.p + m.held):
        add_scaled(-m.held_part[i], held_row(m, i), m.slope, m.n)
    copy(m.held_part + m.p, multiplier, m.held)
    for i in range(m.held, m.k):
        multiplier[i] = m.slope[m.active[i] - m.m]
