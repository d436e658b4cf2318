"""The KKT system of the strictly active constraints, by the factors of a dense solve.

They are those of the whole P with active bounds as rows, see `namlcp.qp.active.steps`.
"""

import cython
from cython import Py_ssize_t
from cython.cimports.namlcp.derivatives.systems.cholesky import LEAST_PIVOT, SOLVES
from cython.cimports.namlcp.linalg.dense import (
    triangle_solve,
    triangle_solve_transposed,
)
from cython.cimports.namlcp.linalg.vectors import add_scaled, dot
from cython.cimports.namlcp.qp.active.rows import response_of


def serves(m, strict):
    """Tell whether the factors are those of the strictly active ones, and good."""
    return holds(m, strict) and least_pivot(m) >= LEAST_PIVOT


def holds(m, strict):
    """Tell whether the active rows of the solve are the strictly active constraints."""
    count: Py_ssize_t = 0
    for i in range(m.rows):
        count += strict[i] != 0
    same: cython.bint = count == m.kept_k
    for i in range(m.kept_k):
        same = same and strict[m.kept_active[i]] != 0
    return same


def least_pivot(m):
    """Return the least pivot of S over its diagonal entry; 1 if there is none."""
    least, last = 1.0, -1
    for i in range(m.kept_k):
        row = m.kept_active[i]
        last += i + 1
        root = m.kept_triangle[last]
        least = min(least, root * root / response_of(m, row)[row])
    return least


def solve_kept(m, eq, of_box, goals, values):
    """Write u, lam, nu and mu = eq.rest, all of which are 0 on entry.

    u = of_box at active bounds. goals (most), values (length): work space.
    """
    for _ in range(SOLVES):
        set_load(m, eq)
        for i in range(m.kept_k):
            k = m.kept_active[i]
            if k < m.m:
                goals[i] = eq.d[k] - dot(m.G + k * m.n, eq.u, m.n)
            else:
                goals[i] = of_box[k - m.m] - eq.u[k - m.m]
        solve_active(m, goals, values)
        add_scaled(1.0, values + m.m, eq.u, m.n)
        add_scaled(1.0, values + m.rows, eq.nu, m.p)
        for i in range(m.kept_k):
            k = m.kept_active[i]
            if k < m.m:
                eq.lam[k] += goals[i]
            else:
                eq.rest[k - m.m] += goals[i]


def set_load(m, eq):
    """Set m.rhs = (r - P u - G'lam - A'nu - mu, e - A u)."""
    n, load = m.n, m.rhs
    for j in range(n):
        load[j] = eq.r[j] - dot(m.P + j * n, eq.u, n) - eq.rest[j]
    for i in range(m.m):
        if eq.lam[i] != 0.0:
            add_scaled(-eq.lam[i], m.G + i * n, load, n)
    for i in range(m.p):
        add_scaled(-eq.nu[i], m.A + i * n, load, n)
        load[n + i] = eq.e[i] - dot(m.A + i * n, eq.u, n)


def solve_active(m, goals, values):
    """Set values = (G u, u, v), and goals = mu, for the active rows C.

    They solve P u + A'v + C'mu = r, A u = e and C u = goals; (r, e) is in m.rhs.
    """
    m.set_values(m.rhs, values)
    for i in range(m.kept_k):
        goals[i] = values[m.kept_active[i]] - goals[i]
    triangle_solve(m.kept_triangle, m.kept_k, goals)
    triangle_solve_transposed(m.kept_triangle, m.kept_k, goals)
    for i in range(m.kept_k):
        row = m.kept_active[i]
        add_scaled(-goals[i], response_of(m, row), values, m.length)
