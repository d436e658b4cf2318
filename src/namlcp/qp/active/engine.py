"""The dual active-set method on responses: a dual Schur-complement method.

The inequalities c x <= d and the bounds of the variables are rows: row i < m is row i
of G, row m + j the unit row e_j with two sides, lb_j and ub_j. The base problem is the
QP without them; with its solution operator, (x, y) = K^-1 (-q, b). A multiplier mu of
row c changes the values s = (G x, x, y) by -mu w_c, where w_c, the *response* to the
row, is (G u, u, v) for (u, v) = K^-1 (c, 0). Responses depend on the matrices alone,
and are kept from solve to solve. With the active rows F, S = (w_i)_j, i, j in F, L L' =
S, and s0 the values of the base solution:

1. mu = S^-1 (s0_F - d_F); while one has the wrong sign, the row of the worst is removed
   from F. s = s0 - sum mu_i w_i.
2. The row violated most enters: t, its multiplier, grows, mu_F -= t r with
   r = S^-1 w_F, and s -= t (w - sum r_i w_i), until the row holds with equality (full
   step) or an active multiplier is zero, whose row is removed (partial step). If
   neither ends the step, the multipliers (-r, 1) contradict the rows.
3. Once no row is violated, F is sorted and mu and s are computed anew from s0
   (`finish`): the answer depends on F alone, not on the way to it.

This is the method of Goldfarb and Idnani (Math. Programming 27 (1983) 1-33) in the form
of Bartlett and Biegler (QPSchur, Optim. Eng. 7 (2006) 5-32). Signs: multipliers mu
are >= 0 for a row at h or ub (side 1) and <= 0 for one at lb (side -1).
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs, isinf, sqrt
from cython.cimports.libc.stdlib import free, malloc

# A row depends on the active ones if the squared length of its part orthogonal to them,
# in the metric of the responses, over its own is at most DEPENDENT.
DEPENDENT = 1e-11
# Violations over the moduli of their terms up to which they count as rounding at first.
# This `level` grows tenfold where a violation below NOISE * level contradicts the
# active rows; above MOST_ROUNDING the method gives up. The larger numbers are for a P
# without a factor, whose base point is far away.
VIOLATION_ROUNDING, NOISE, MOST_ROUNDING = 1e-13, 1e3, 1e-9
ROUND_ROUNDING, MOST_ROUND_ROUNDING = 1e-12, 1e-7
# Rounding of s over the largest entry of s0 from which it was subtracted: what is left
# at a vertex x = 0. Rows that are active are allowed `level` of it.
BASE_ROUNDING = 4e-16
# Violation over its terms that is none of rounding, whatever x has become.
CERTAIN = 1e-6
# MOST_NUMBERS: most numbers that all responses may take, 64 MB; there are no more
# active rows. MOST_SORTED: most active rows for which L is computed anew at the end,
# which takes k^3 / 6 operations.


class ActiveSet(Watched):
    """A QP, its active rows, and what is kept from solve to solve, in one allocation.

    A subclass has the operators, the first methods, and vectors of its own; one with
    another form of the active rows has the others, too.
    """

    def __dealloc__(self):
        free(self.memory)

    def lay_out(self):
        """Give every vector its place, for the sizes n, m, p and `most`."""

    def decide(self):
        """Solve the QP at the pointers; return how that ended."""
        return STUCK

    def set_up(self):
        """Make the factors for `rounds.wanted_rho`; False if they are not good."""
        return False

    def set_values(self, rhs, values):
        """Set values = (G x, x, y) for (x, y) = K^-1 rhs."""

    def make_response(self, row):
        """Make the response to a row."""

    def set_products(self, is_base):
        """Set the products of the point with P, G and A; is_base: s0 has G x."""

    def times_cost(self, x, Px):
        """Set Px = P x."""

    def begin(self):
        """Set the base solution; keep the active rows of the last QP, or of a hint.

        Less those without a side now, and rows of a hint that depend on others. False
        if the factors do not allow it.
        """
        set_base_values(self)
        for i in range(self.k - 1, -1, -1):
            row = self.active[i]
            if isinf(goal_of(self, row, self.side[row])):
                self.remove(i)
        hints, self.hints = self.hints, 0
        for i in range(hints):
            row = self.active[i]
            side, self.side[row] = self.side[row], 0
            if self.k < self.most and not isinf(goal_of(self, row, side)):
                rest = rest_of(self, row)
                if is_independent(self, row, rest):
                    self.append(row, side, 0.0, rest)
        return True

    def project(self, row):
        """Set m.direction and m.ratio, the changes for the multiplier of a row.

        Returns the squared length of the part of the row orthogonal to the active ones:
        0.0, with no change of (G x, x), if it depends on them.
        """
        k, rest = self.k, rest_of(self, row)
        is_new: cython.bint = is_independent(self, row, rest)
        copy(self.coefficient, self.ratio, k)
        triangle_solve_transposed(self.triangle, k, self.ratio)
        copy(response_of(self, row), self.direction, self.length)
        subtract_responses(self, self.ratio, k, self.direction)
        if not is_new:
            fill(self.direction, 0.0, self.rows)
            return 0.0
        return rest

    def append(self, row, side, multiplier, rest):
        """Make a row with this `project` active; False if the factors forbid it."""
        append_to_triangle(self.triangle, self.k, self.coefficient, sqrt(rest))
        insert_place(self, self.k, row, side, multiplier)
        return True

    def remove(self, i):
        """Remove the active row number i; False if the factors forbid it."""
        remove_from_triangle(self.triangle, self.k, i, self.coefficient, self.ratio)
        remove_place(self, i)
        return True

    def set_multipliers(self):
        for i in range(self.k):
            row = self.active[i]
            self.multiplier[i] = self.s0[row] - goal_of(self, row, self.side[row])
        triangle_solve(self.triangle, self.k, self.multiplier)
        triangle_solve_transposed(self.triangle, self.k, self.multiplier)

    def finish(self):
        """Step 3: mu and s as functions of the active rows alone; False if these fail.

        A single solve goes without, as no other could give another answer; one with
        many active rows takes mu and s of the L at hand.
        """
        fine: cython.bint = True
        if self.changed and not self.is_single:
            if self.k <= MOST_SORTED:
                self.k = 0
                for row in range(self.rows):
                    if self.side[row] != 0:
                        rest = rest_of(self, row)
                        self.append(row, self.side[row], 0.0, rest)
                        fine = fine and rest > 0.0
            self.set_multipliers()
            self.set_point_values()
        self.changed = not fine
        return fine

    def set_point_values(self):
        copy(self.s0, self.s, self.rows + self.p)
        subtract_responses(self, self.multiplier, self.k, self.s)

    def set_x(self, rhs, factor, values):
        """Set x in values to that of K^-1 rhs less factor_i w_i for all active rows.

        That is nothing to do where responses hold x, which has changed with G x.
        """


def reals(m, count):
    """Return the place of the next `count` numbers; without memory, only count them.

    All begin a multiple of 32 bytes after the first ones: loops take longer else.
    """
    found = cython.cast(cython.p_double, m.memory + m.memory_end)
    m.memory_end += (8 * count + 39) // 32 * 32
    return found


def indices(m, count):
    return cython.cast(cython.p_Py_ssize_t, reals(m, count))


def lay_out_rows(m):
    n, p = m.n, m.p
    rows = m.m + n
    length = rows + p
    m.rows, m.length = rows, length
    places = MOST_NUMBERS // max(length, 1)
    m.most = most = max(min(m.most, min(rows, places)), 0)
    m.capacity = min(rows, max(most + 4, places))
    m.s0, m.s, m.direction = reals(m, length), reals(m, length), reals(m, length)
    m.change, m.scale, m.side = reals(m, length), reals(m, rows), indices(m, rows)
    m.active, m.multiplier = indices(m, most + 1), reals(m, most + 1)
    m.triangle = reals(m, most * (most + 1) // 2)
    m.coefficient, m.ratio = reals(m, most + 1), reals(m, most + 1)
    m.place, m.owner = indices(m, rows), indices(m, m.capacity)
    m.Px, m.Gx, m.Ax = reals(m, n), reals(m, m.m), reals(m, p)
    m.Gtz, m.Aty, m.rhs = reals(m, n), reals(m, n), reals(m, n + p)
    m.weight, m.shape, m.reach = reals(m, n), reals(m, n), reals(m, p)
    m.centre, m.responses = reals(m, rows), reals(m, m.capacity * length)


def make_room(m):
    """Give all vectors their places, at first in new memory, and forget the factors."""
    is_new: cython.bint = m.memory == cython.NULL
    m.memory_end = 0
    m.lay_out()
    if is_new:
        m.memory = cython.cast(cython.p_char, malloc(m.memory_end))
        if m.memory == cython.NULL:
            raise MemoryError("a QP of this size needs more memory than there is")
        m.memory_end = 0
        m.lay_out()
        for row in range(m.rows):
            m.side[row] = 0
    m.is_ready, m.skipped, m.rho = False, 0, 0.0
    return 0


# ---- rows and responses


def goal_of(m, row, side):
    if row < m.m:
        return m.h[row]
    return m.lb[row - m.m] if side < 0 else m.ub[row - m.m]


def is_pinned(m, row):
    """Tell whether the two sides of a row are one, so that its multiplier is free."""
    j = row - m.m
    return j >= 0 and m.lb[j] == m.ub[j]


def response_of(m, row):
    return m.responses + m.length * m.place[row]


def claim_place(m, row):
    """Return where the response to `row` is to be written to, at once.

    With all places taken, that of a row that is not active is forgotten.
    """
    at = m.next_place
    while m.owner[at] >= 0 and (m.side[m.owner[at]] != 0 or m.owner[at] == m.entering):
        at = (at + 1) % m.capacity
    if m.owner[at] >= 0:
        m.place[m.owner[at]] = -1
    m.owner[at], m.place[row] = row, at
    m.next_place = (at + 1) % m.capacity
    return m.responses + m.length * at


def forget_responses(m):
    """Forget all responses; active rows become a hint."""
    for i in range(m.capacity):
        m.owner[i] = -1
    for i in range(m.rows):
        m.place[i] = -1
    m.next_place = 0
    m.hints += m.k
    m.k = 0


def forget_rows(m):
    for i in range(m.k + m.hints):
        m.side[m.active[i]] = 0
    m.k, m.hints = 0, 0


def subtract_responses(m, factor, k, s):
    """Set s -= sum over i < k of factor[i] times the response to active row i.

    Four rows at a time, because reading and writing s would take most of the time.
    """
    active = m.active
    i: Py_ssize_t = 0
    while i + 4 <= k:
        add_four(
            -factor[i], response_of(m, active[i]),
            -factor[i + 1], response_of(m, active[i + 1]),
            -factor[i + 2], response_of(m, active[i + 2]),
            -factor[i + 3], response_of(m, active[i + 3]), s, m.length,
        )  # fmt: skip
        i += 4
    while i < k:
        add_scaled(-factor[i], response_of(m, active[i]), s, m.length)
        i += 1


def rest_of(m, row):
    """Return the squared length of w_row orthogonal to the active rows.

    Sets m.coefficient = L^-1 w_F; negative or 0 where rounding is all that is left.
    """
    if m.place[row] < 0:
        m.make_response(row)
    w, coefficient = response_of(m, row), m.coefficient
    for i in range(m.k):
        coefficient[i] = w[m.active[i]]
    triangle_solve(m.triangle, m.k, coefficient)
    return w[row] - dot(coefficient, coefficient, m.k)


def is_independent(m, row, rest):
    """Tell whether a row with this `rest_of` can join equations and active rows."""
    scale, whole = m.scale[row], response_of(m, row)[row]
    if m.k == m.most or m.k >= m.n - m.p + m.skipped:
        return False
    return rest > DEPENDENT * whole and rest * scale * scale > m.least_curvature


def insert_place(m, at, row, side, multiplier):
    for j in range(m.k, at, -1):
        m.active[j], m.multiplier[j] = m.active[j - 1], m.multiplier[j - 1]
    m.active[at], m.multiplier[at] = row, multiplier
    m.side[row] = side
    m.k += 1
    m.changed = True


def remove_place(m, i):
    m.side[m.active[i]] = 0
    for j in range(i, m.k - 1):
        m.active[j], m.multiplier[j] = m.active[j + 1], m.multiplier[j + 1]
    m.k -= 1
    m.changed = True


# ---- step 1


def set_base_values(m):
    for j in range(m.n):
        m.rhs[j] = -m.q[j]
    if m.rho != 0.0:
        for j in range(m.n):
            m.rhs[j] += m.weight[j] * m.centre[m.m + j]
    copy(m.b, m.rhs + m.n, m.p)
    m.set_values(m.rhs, m.s0)
    m.base_size = size_of(m, m.s0)


def drop_wrong_signs(m):
    """Step 1: remove active rows until all multipliers have the sign of their side.

    False where the factors do not allow it.
    """
    while True:
        m.set_multipliers()
        leaving: Py_ssize_t = -1
        least = 0.0
        for i in range(m.k):
            signed = m.side[m.active[i]] * m.multiplier[i]
            if signed < least and not is_pinned(m, m.active[i]):
                leaving, least = i, signed
        if leaving < 0:
            break
        if not m.remove(leaving):
            return False
    m.set_point_values()
    return True


# ---- step 2


def size_of(m, values):
    """Return the largest |x_j| over the norm of its row, for values (G x, x, ...)."""
    size = 0.0
    for i in range(m.m, m.rows):
        size = max(size, fabs(values[i]) * m.scale[i])
    return size


def choose_entering(m):
    """Set m.entering and its side: the row violated most for its norm, -1 for none."""
    s, scale, h, lb, ub, side = m.s, m.scale, m.h, m.lb, m.ub, m.side
    x, unit = s + m.m, scale + m.m
    level, rounding = m.level, m.level * size_of(m, s)
    held = max(rounding, level * m.base_size)
    rounding = max(rounding, BASE_ROUNDING * m.base_size)
    entering: Py_ssize_t = -1
    at: Py_ssize_t = 1
    worst = 0.0
    for i in range(m.m):
        violation = (s[i] - h[i]) * scale[i]
        if violation > worst:
            least = held if side[i] != 0 else rounding
            if violation > level * fabs(h[i]) * scale[i] + least:
                entering, worst = i, violation
    for j in range(m.n):
        least = held if side[m.m + j] != 0 else rounding
        violation = (x[j] - ub[j]) * unit[j]
        if violation > worst:
            if violation > level * fabs(ub[j]) * unit[j] + least:
                entering, worst, at = m.m + j, violation, 1
        violation = (lb[j] - x[j]) * unit[j]
        if violation > worst:
            if violation > level * fabs(lb[j]) * unit[j] + least:
                entering, worst, at = m.m + j, violation, -1
    m.entering, m.entering_side, m.own = entering, at, 0.0


def is_beyond(m, share, size):
    """Tell if the entering row is violated by more than a share of its side and x."""
    row = m.entering
    goal, scale = goal_of(m, row, m.entering_side), m.scale[row]
    return not fabs(m.s[row] - goal) * scale <= share * (fabs(goal) * scale + size)


def step(m):
    """Let the multiplier of the entering row grow until a step ends: DONE if it can.

    After a full step m.entering = -1. STUCK: the factors do not allow the change.
    """
    row, sign, k = m.entering, m.entering_side, m.k
    rest = m.project(row)
    leaving: Py_ssize_t = -1
    t = INFINITY
    for i in range(k):
        side = m.side[m.active[i]]
        falls, signed = sign * side * m.ratio[i], side * m.multiplier[i]
        if falls > 0.0 and signed < t * falls and not is_pinned(m, m.active[i]):
            leaving, t = i, signed / falls
    t = max(t, 0.0)
    if rest > 0.0:
        full = sign * (m.s[row] - goal_of(m, row, sign)) / rest
        if full <= t:
            leaving, t = -1, full
    elif leaving < 0:
        return CONTRADICTION
    add_scaled(-sign * t, m.direction, m.s, m.length)
    add_scaled(-sign * t, m.ratio, m.multiplier, k)
    m.own += t
    if leaving >= 0:
        return DONE if m.remove(leaving) else STUCK
    m.entering = -1
    return DONE if m.append(row, sign, sign * m.own, rest) else STUCK


def excuse(m):
    """Leave a row that contradicts the active ones, if that may be due to rounding.

    CONTRADICTION if it cannot; STUCK if the rounding errors would be too large, or the
    multipliers cannot be had without the partial steps.
    """
    m.set_x(m.rhs, m.multiplier, m.s)
    if is_beyond(m, NOISE * m.level, size_of(m, m.s)):
        set_contradiction(m)
        return CONTRADICTION
    m.level *= 10.0
    m.entering = -1
    most = MOST_ROUND_ROUNDING if m.rho > 0.0 else MOST_ROUNDING
    return DONE if m.level <= most and drop_wrong_signs(m) else STUCK


def pivot(m):
    """Step 2, as often as a row is violated: DONE, or why it ended before."""
    while True:
        if m.entering < 0:
            choose_entering(m)
            if m.length < m.rows:  # s has an x of before
                size = max(m.base_size, size_of(m, m.s))
                if m.entering < 0 or not is_beyond(m, CERTAIN, size):
                    m.set_x(m.rhs, m.multiplier, m.s)
                    choose_entering(m)
            if m.entering < 0:
                return DONE
            m.pivots += 1
            if m.pivots > m.max_iter:
                return STUCK
        operations = (m.k + 2) * (m.length + m.k)
        if is_over(m, operations):
            return LATE
        m.operations += operations
        is_full: cython.bint = m.k == m.most < min(m.n - m.p + m.skipped, m.rows)
        if is_full or m.operations > m.most_operations:
            return STUCK
        found = step(m)
        if found == CONTRADICTION:
            found = excuse(m)
        if found != DONE:
            return found


def set_contradiction(m):
    """Set y and z to the multipliers that `step` found to contradict the rows."""
    sign = m.entering_side
    copy(m.s + m.m, m.x, m.n)
    fill(m.z_box, 0.0, m.n)
    fill(m.z, 0.0, m.m)
    for i in range(m.p):
        m.y[i] = -sign * m.direction[m.rows + i]
    for i in range(m.k):
        if m.active[i] < m.m:
            m.z[m.active[i]] = -sign * m.ratio[i]
    if m.entering < m.m:
        m.z[m.entering] = 1.0
