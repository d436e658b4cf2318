"""The KKT system of a face: its factors, products, residuals and solution.

K is held by its upper triangle in CSC, as in `qp.kkt`: the columns of P, then the rows
of A, then those of G; the diagonal is the last entry of a column. A variable at an
active bound and an inactive row are *held*: a huge diagonal entry keeps x_j or z_i.
"""

import numpy as np

from namlcp.compiled import floats_at, longs_at, part
from namlcp.linalg import LEAST_DIVISOR, factor_record, solve_record
from namlcp.qp.responses.sparse import multiply_columns, multiply_cost, triangle_of

# What is added to the diagonal of P, and subtracted for rows, in equilibrated units;
# the same for what is held.
SHIFT, HELD = 1e-9, 1e20
# Solves with the factors of a face at most; the factor by which one has to lower the
# residual.
MOST_SOLVES, GAIN = 8, 0.5
# Nothing is corrected where the residual over its terms is at most ACCURATE, and the
# residual itself at most RESERVE times the absolute tolerance.
ACCURATE, RESERVE = 1e-13, 0.05


@part
def is_held(m, side, j):
    """Tell whether unknown j of the system is held, for the sides of a face."""
    if j < m.n:
        return side[m.m + j] != 0
    return j >= m.n + m.p and side[j - m.n - m.p] == 0


@part
def factor_face(m):
    """Factor the matrix of the face, if that is not done; False if a pivot vanishes."""
    side, factored = longs_at(m.side, m.rows), longs_at(m.factored_side, m.rows)
    is_done = m.is_factored != 0
    for i in range(m.rows):
        is_done = is_done and (side[i] == 0) == (factored[i] == 0)
    if is_done:
        return True
    for i in range(m.rows):
        factored[i] = side[i]
    indptr, _, base = triangle_of(m)
    unit = floats_at(m.unit, m.size)
    data = floats_at(m.data, np.int64(indptr[m.size]))
    for j in range(m.size):
        last = indptr[j + 1] - 1
        shift = (HELD if is_held(m, side, j) else SHIFT) / (unit[j] * unit[j])
        data[last] = base[last] + shift if j < m.n else -shift
    m.is_factored = factor_record(m, data)
    return m.is_factored != 0


@part
def set_products(m):
    """Set the products of u = (x, y, z) with P, A and G."""
    n, rows, u = m.n, m.n + m.p, floats_at(m.u, m.size)
    Aty, Gtz = floats_at(m.Aty, n), floats_at(m.Gtz, n)
    for j in range(n):
        Aty[j], Gtz[j] = 0.0, 0.0
    multiply_cost(m, u, floats_at(m.Px, n))
    multiply_columns(m, n, rows, u, floats_at(m.Ax, m.p), Aty)
    multiply_columns(m, rows, m.size, u, floats_at(m.Gx, m.m), Gtz)


@part
def set_rest(m):
    """Set rest = goal - K u, 0 where held; return its norm over that of its terms.

    The norms are those of equilibrated units, m.residual is one of the user's. Needs
    the products. NaN in any number makes the result NaN.
    """
    n, rows = m.n, m.n + m.p
    side, rest = longs_at(m.side, m.rows), floats_at(m.rest, m.size)
    u, unit = floats_at(m.u, m.size), floats_at(m.unit, m.size)
    q, b, h = floats_at(m.q, n), floats_at(m.b, m.p), floats_at(m.h, m.m)
    Px, Aty, Gtz = floats_at(m.Px, n), floats_at(m.Aty, n), floats_at(m.Gtz, n)
    Ax, Gx = floats_at(m.Ax, m.p), floats_at(m.Gx, m.m)
    dual, primal, m.residual = 0.0, 0.0, 0.0
    m.dual_size, m.primal_size = LEAST_DIVISOR, LEAST_DIVISOR
    for j in range(m.size):
        rest[j] = 0.0
        if j < n:
            m.primal_size = max(m.primal_size, abs(u[j]) / unit[j])
        if is_held(m, side, j):
            continue
        if j < n:
            rest[j] = -(Px[j] + q[j] + Gtz[j] + Aty[j])
            size = max(abs(Px[j]), abs(q[j]), abs(Gtz[j]), abs(Aty[j]))
            m.dual_size = max(m.dual_size, size * unit[j])
            dual = larger(dual, abs(rest[j]) * unit[j])
        else:
            goal = b[j - n] if j < rows else h[j - rows]
            value = Ax[j - n] if j < rows else Gx[j - rows]
            rest[j] = goal - value
            m.primal_size = max(m.primal_size, abs(goal) * unit[j])
            primal = larger(primal, abs(rest[j]) * unit[j])
        m.residual = larger(m.residual, abs(rest[j]))
    return larger(primal / m.primal_size, dual / m.dual_size)


@part
def larger(a, b):
    """Return the larger number, b if that is NaN."""
    return a if b <= a else b


@part
def is_accurate(m, error):
    """Tell whether the point with this error of `set_rest` needs no correction."""
    enough = RESERVE * m.eps_abs if m.eps_abs > 0.0 else np.inf
    return error <= ACCURATE and m.residual <= enough


@part
def correct(m):
    """Add K~^-1 rest to u where nothing is held; best_u = u as it was."""
    u, best = floats_at(m.u, m.size), floats_at(m.best_u, m.size)
    rest, side = floats_at(m.rest, m.size), longs_at(m.side, m.rows)
    solve_record(m, rest, rest)
    for j in range(m.size):
        best[j] = u[j]
        if not is_held(m, side, j):
            u[j] += rest[j]
