"""The KKT system of an active set for dense matrices, by Cholesky factors.

For P_FF = L L' and V = C_F L^-T the Schur complement is S = V V', and

    [P_FF C_F'; C_F 0] (u, v) = (r, s):   S v = V L^-1 r - s,
                                          u = L^-T (L^-1 r - V'v).

Each solve ends with a step of refinement: the derivative is exact to rounding.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.stdlib import free, malloc
from cython.cimports.namlcp.linalg.arrays import indices, numbers
from cython.cimports.namlcp.linalg.blas import (
    cholesky,
    cholesky_solve,
    solve_rows,
    times_transposed,
)
from cython.cimports.namlcp.linalg.dense import (
    add_times_transposed,
    backward_solve,
    forward_solve,
)
from cython.cimports.namlcp.linalg.vectors import add_scaled, copy, dot, fill

# Factors are used if no pivot is below this multiple of its diagonal entry; a single
# step of refinement then removes the error of the Schur complement.
LEAST_PIVOT = 1e-8
# SOLVES: solves with the factors for one right-hand side; the second refines the first.


class CholeskySystem:
    """The system of an active set of a QP with n variables, m rows of G and p of A.

    Solves share its work space: they keep the GIL.
    """

    def __cinit__(self, n: Py_ssize_t, m: Py_ssize_t, p: Py_ssize_t,
                  most_free: Py_ssize_t, most_held: Py_ssize_t):  # fmt: skip
        self.n, self.m, self.p = n, m, p
        f, k = most_free, min(most_held, most_free)
        count = n + m + p + f * f + k * (f + k) + f + most_held + 1
        self.memory = cython.cast(cython.p_char, malloc(8 * count))
        if self.memory == cython.NULL:
            raise MemoryError("the KKT system needs more memory than there is")
        self.equalities = cython.cast(cython.p_Py_ssize_t, self.memory)
        self.rows = self.equalities + p
        self.free = self.rows + m
        self.t = cython.cast(cython.p_double, self.free + n)
        self.s = self.t + f
        self.L = self.s + most_held

    def __dealloc__(self):
        free(self.memory)

    def hold(self, matrices, places):
        """Hold equations and rows; places: their numbers, those of free variables."""
        (P, G, A), (equalities, rows, variables) = matrices, places
        self.matrices = matrices
        self.P = numbers(P, self.n * self.n)
        self.G, self.A = numbers(G, self.m * self.n), numbers(A, self.p * self.n)
        self.held_p, self.held_m = equalities.size, rows.size
        self.free_n = variables.size
        copy_indices(equalities, self.equalities)
        copy_indices(rows, self.rows)
        copy_indices(variables, self.free)

    def factor(self):
        """Factor the matrix; tell whether it has good factors."""
        found: cython.bint = False
        with cython.nogil:
            found = factor_held(self)
        return found

    def solve(self, *vectors):
        """Write u_F, lam, nu and rest; vectors: (r, d, e, u, lam, nu, rest).

        On entry u is 0 on F, lam and nu are 0.
        """
        eq: Equations
        set_equations(self, vectors, cython.address(eq))
        solve_held(self, cython.address(eq))

    def remainder(self, *vectors):
        """Write rest = r - P u - G'lam - A'nu; return (e - A u, d - G u)_held."""
        eq: Equations
        set_equations(self, vectors, cython.address(eq))
        set_remainder(self, cython.address(eq))
        held = self.held_p + self.held_m
        s = np.empty(held)
        copy(self.s, numbers(s, held), held)
        return s


def copy_indices(array, out):
    """Copy the numbers of rows or variables."""
    count: Py_ssize_t = array.size
    own = indices(array, count)
    for i in range(count):
        out[i] = own[i]
    return 0


def set_equations(m, vectors, eq):
    """Note where the vectors of `CholeskySystem.solve` are."""
    r, d, e, u, lam, nu, rest = vectors
    eq.r, eq.d, eq.e = numbers(r, m.n), numbers(d, m.m), numbers(e, m.p)
    eq.u, eq.lam, eq.nu = numbers(u, m.n), numbers(lam, m.m), numbers(nu, m.p)
    eq.rest = numbers(rest, m.n)
    return 0


def hold_strict(m, qp, strict):
    """Hold all equations of a QP and its strictly active constraints, see `marks`."""
    m.P, m.G, m.A = qp.P, qp.G, qp.A
    m.held_p, m.held_m, m.free_n = m.p, 0, 0
    for i in range(m.p):
        m.equalities[i] = i
    for i in range(m.m):
        if strict[i] != 0:
            m.rows[m.held_m] = i
            m.held_m += 1
    for j in range(m.n):
        if strict[m.m + j] == 0:
            m.free[m.free_n] = j
            m.free_n += 1


def factor_held(m):
    """Compute L, V and the factor of S; tell whether they exist.

    What is above the diagonal of L and of that factor has no meaning.
    """
    n, p, k = m.free_n, m.held_p, m.held_p + m.held_m
    if k > n:
        return False
    m.V = m.L + n * n
    m.S = m.V + k * n
    for a in range(n):
        row = m.P + m.free[a] * m.n
        for c in range(a + 1):
            m.L[a * n + c] = row[m.free[c]]
    for i in range(k):
        row = m.A + m.equalities[i] * m.n if i < p else m.G + m.rows[i - p] * m.n
        for c in range(n):
            m.V[i * n + c] = row[m.free[c]]
    if not has_factor(m.L, n, m.t):
        return False
    solve_rows(m.L, n, m.V, k)
    times_transposed(m.V, m.V, m.S, k, k, n)
    return has_factor(m.S, k, m.s)


def has_factor(M, n, diagonal):
    """Overwrite the lower triangle of M by its Cholesky factor; False if M is singular.

    That is where a pivot is too small a part of its diagonal entry.
    """
    for i in range(n):
        diagonal[i] = M[i * n + i]
    if not cholesky(M, n):
        return False
    for i in range(n):
        root = M[i * n + i]
        if not root * root >= LEAST_PIVOT * diagonal[i]:
            return False
    return True


def set_remainder(m, eq):
    """Set rest = r - P u - G'lam - A'nu, and m.s = (e - A u, d - G u)_held."""
    n, rest, s = m.n, eq.rest, m.s + m.held_p
    fill(rest, 0.0, n)
    add_times_transposed(m.P, n, n, eq.u, rest)  # P = P'
    add_times_transposed(m.G, m.m, n, eq.lam, rest)
    add_times_transposed(m.A, m.p, n, eq.nu, rest)
    for j in range(n):
        rest[j] = eq.r[j] - rest[j]
    for i in range(m.held_p):
        k = m.equalities[i]
        m.s[i] = eq.e[k] - dot(m.A + k * n, eq.u, n)
    for i in range(m.held_m):
        k = m.rows[i]
        s[i] = eq.d[k] - dot(m.G + k * n, eq.u, n)


def solve_held(m, eq):
    """Solve with the factors; on entry u is 0 on F, lam and nu are 0."""
    n, p, t, s = m.free_n, m.held_p, m.t, m.s
    held = p + m.held_m
    for _ in range(SOLVES):
        set_remainder(m, eq)
        for a in range(n):
            t[a] = eq.rest[m.free[a]]
        forward_solve(m.L, n, t)
        for i in range(held):
            s[i] = dot(m.V + i * n, t, n) - s[i]
        cholesky_solve(m.S, held, s)
        for i in range(held):
            add_scaled(-s[i], m.V + i * n, t, n)
        backward_solve(m.L, n, t)
        for a in range(n):
            eq.u[m.free[a]] += t[a]
        for i in range(p):
            eq.nu[m.equalities[i]] += s[i]
        for i in range(m.held_m):
            eq.lam[m.rows[i]] += s[p + i]
    set_remainder(m, eq)
