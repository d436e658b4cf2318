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
"""

import cython
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, NAN, fabs, sqrt
from cython.cimports.namlcp.linalg.blas import (
    add_gram,
    cholesky,
    invert_lower,
    times_lower,
)
from cython.cimports.namlcp.linalg.dense import (
    add_times_transposed,
    factor_in_place,
    invert_triangle,
    times_rows,
    times_triangle,
    times_triangle_transposed,
)
from cython.cimports.namlcp.linalg.vectors import (
    add_scaled,
    copy,
    dot,
    fill,
    largest_entry,
)
from cython.cimports.namlcp.qp.active.engine import (
    CONTRADICTION,
    STUCK,
    UNBOUNDED,
    UNPROVED,
    UNSUITED,
    claim_place,
    forget_responses,
    forget_rows,
    lay_out_rows,
    reals,
    set_base_values,
)
from cython.cimports.namlcp.qp.active.rounds import (
    NO_WEIGHT,
    RHO,
    is_faulty,
    refine_contradiction,
    set_shape,
    solve_at_hand,
    wanted_rho,
)
from cython.cimports.namlcp.qp.certificates import (
    Claim,
    Matrix,
    prove_infeasible,
    prove_unbounded,
)

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
    """A QP with row-major matrices."""

    def lay_out(self):
        n, p = self.n, self.p
        self.most = n  # not n - p: equations may depend on others
        lay_out_rows(self)
        self.factor, self.equations = reals(self, n * n), reals(self, p * n)
        self.schur, self.schur_work = reals(self, p * p), reals(self, p)
        self.half, self.no_bound = reals(self, n), reals(self, 2 * n)

    def set_values(self, rhs, values):
        n, p, half = self.n, self.p, self.half
        x, y = values + self.m, values + self.rows
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

    def times_cost(self, x, Px):
        times_rows(self.P, self.n, self.n, self.n, x, Px)

    def decide(self):
        """Solve the QP at hand, if need be with another W, see `rounds`.

        A small W leaves little to the passes, and lets rows contradict each other by
        rounding.
        """
        found = solve_dense(self)
        if (found != STUCK and found != UNPROVED) or self.wanted != 0.0:
            return found
        if self.pivots > self.max_iter or self.operations > self.most_operations:
            return found
        self.wanted = LESS_RHO if found == STUCK else MORE_RHO
        self.is_ready = False
        forget_rows(self)
        found = solve_dense(self)
        self.wanted, self.is_ready = 0.0, False  # for the next QP
        return found


# ---- the factors


def set_up(m):
    """Factor P, or what takes its place; False where the matrices do not allow it.

    m.wanted > 0 asks for P + W.
    """
    if m.p > MOST_EQUATIONS * (m.n + 2) or not is_sound(m):
        return False
    m.rho, m.skipped = 0.0, 0
    is_plain: cython.bint = m.wanted <= 0.0 and factor_cost(m)
    if not is_plain and (m.wanted == NO_WEIGHT or not factor_weighted(m)):
        return False
    forget_responses(m)
    invert_factor(m)
    return True


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
        for j in range(i):
            if P[i * n + j] != P[j * n + i] or not fabs(P[i * n + j]) < INFINITY:
                return False
        fine = fine and fabs(P[i * n + i]) < INFINITY
    return fine


def copy_cost(m, slack):
    """Copy the lower triangle of P, its diagonal times 1 + slack; return max P_ii."""
    n, largest = m.n, 0.0
    for i in range(n):
        row = m.factor + i * n
        copy(m.P + i * n, row, i + 1)
        largest = max(largest, row[i])
        row[i] *= 1.0 + slack
    return largest


def has_factor(m):
    """Overwrite the lower triangle in m.factor by its Cholesky factor, if any."""
    if m.is_large:
        return cholesky(m.factor, m.n)
    return factor_in_place(m.factor, m.n, 0.0) == 0


def factor_cost(m):
    """Factor P; False where it has no factor, or pivots that differ too much."""
    n, low, high = m.n, INFINITY, 0.0
    copy_cost(m, 0.0)
    if not has_factor(m):
        return False
    for i in range(n):
        root = m.factor[i * n + i]
        low, high = min(low, root), max(high, root)
    return high * high <= MOST_SPREAD * low * low


def factor_weighted(m):
    """Factor P + W; False where P is not semidefinite, or W is too small."""
    n = m.n
    m.largest = copy_cost(m, PSD_SLACK)
    for i in range(n):
        m.shape[i] = m.P[i * n + i]
        if m.shape[i] < 0.0:
            return False
        m.factor[i * n + i] += ROUNDING_UNIT * m.largest  # else an empty row has 0
    if m.largest == 0.0:  # then P must be 0
        if largest_entry(m.P, n * n) > 0.0:
            return False
    elif not has_factor(m):
        return False
    set_shape(m)
    for i in range(m.m):
        m.scale[i] = reach_of(m.G + i * n, m.shape, n)
    for i in range(m.p):
        m.reach[i] = reach_of(m.A + i * n, m.shape, n)
    m.rho = wanted_rho(m)
    copy_cost(m, 0.0)
    for i in range(n):
        m.weight[i] = m.rho * m.shape[i]
        m.factor[i * n + i] += m.weight[i]
    if not has_factor(m):
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
    """
    n, rows, length = m.n, m.m, m.length
    if m.p > 0 or rows > min(MOST_ROWS * n, m.capacity):
        return
    set_base_values(m)
    violated: Py_ssize_t = 0
    for i in range(rows):
        violated += m.s0[i] > m.h[i]
    if MANY * violated <= rows:
        return
    for i in range(rows):
        copy(m.G + i * n, claim_place(m, i) + rows, n)
    W, U = m.responses, m.responses + rows  # G P^-1 G' and G P^-1, side by side
    times_lower(U, rows, length, m.factor, n, b"T")
    add_gram(U, rows, n, length, b"T", 0.0, W, length)
    times_lower(U, rows, length, m.factor, n, b"N")
    for i in range(rows):
        for j in range(i):
            W[j * length + i] = W[i * length + j]


# ---- a whole solve


def solve_dense(m):
    m.pivots = 0
    if is_faulty(m):
        return UNSUITED
    if not m.is_ready:
        if not set_up(m):
            return UNSUITED
        m.is_ready = True
        if m.is_large and m.is_single and m.rho == 0.0:
            prepare(m)
    if m.rho != 0.0 and m.rho != wanted_rho(m) and not set_up(m):
        return UNSUITED
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
    c.units, c.largest, c.r = m.best, m.change, m.direction
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
    """Tell whether the solution of the other equations violates a dependent one.

    y is the candidate then.
    """
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
