"""Sparse QPs by responses: the base problem by the factors of its KKT matrix.

The base problem min 1/2 x'Px + q'x, A x = b is the system K u = (-q, b) with

    K = [P  A'],    K~ = K + [R   0],    u = (x, y).
        [A  0 ]              [0  -D]

K~ = L D L' is factored once, with small diagonal matrices R and D (`sparse_solve`), so
that it needs no pivoting. A solve with K is a solve with K~ and `passes` of iterative
refinement. K is held by its upper triangle in CSC, as in `qp.kkt`: column n + i is row
i of A, and the diagonal is the last entry of a column. G is held by rows.
"""

import numpy as np

from namlcp.compiled import entries, floats, floats_at, ints, ints_at, part
from namlcp.linalg import solve_record
from namlcp.qp.responses.judgement import parts_of_result
from namlcp.qp.responses.rows import claim_place


@part
def set_rest(m, rhs, u, r):
    """Set r = rhs - K u."""
    indptr, indices, base = triangle_of(m)
    for j in range(m.size):
        last = np.uint64(indptr[j + 1] - 1)
        uj = u[j]
        total = rhs[j] - base[last] * uj
        for t in range(np.uint64(indptr[j]), last):
            i = np.uint32(indices[t])
            r[i] -= base[t] * uj
            total -= base[t] * u[i]
        r[j] = total


@part
def solve_shifted(m, rhs, u):
    """Set u = K~^-1 rhs; u may be rhs."""
    solve_record(m, entries(rhs), entries(u))


@part
def refine(m, u, r):
    """Add K~^-1 r to u; r is overwritten."""
    solve_shifted(m, r, r)
    for j in range(m.size):
        u[j] += r[j]


@part
def solve_base(m, rhs, u, passes):
    """Set u = K^-1 rhs, with so many passes of refinement."""
    r = floats(m.rest, m.size)
    solve_shifted(m, rhs, u)
    for _ in range(passes):
        set_rest(m, rhs, u, r)
        refine(m, u, r)


@part
def set_values_of(m, rhs, values):
    """Set values = (G x, x, y) for (x, y) = K^-1 rhs."""
    solve_base(m, rhs, values[m.m :], m.passes)
    multiply_rows(m, values[m.m : m.rows], values)


@part
def rows_of(m):
    """Return columns, values and starts of the rows of G."""
    starts = ints(m.g_starts, m.m + 1)
    entries = np.int64(starts[m.m])
    return ints(m.g_columns, entries), floats(m.g_values, entries), starts


@part
def triangle_of(m):
    """Return the arrays indptr, indices and base of the triangle of K."""
    indptr = ints_at(m.indptr, m.size + 1)
    nnz = np.int64(indptr[m.size])
    return indptr, ints_at(m.indices, nnz), floats_at(m.base, nnz)


@part
def multiply_cost(m, x, Px):
    """Set Px = P x."""
    indptr, indices, base = triangle_of(m)
    for j in range(m.n):
        last = np.uint64(indptr[j + 1] - 1)
        total = base[last] * x[j]
        for t in range(np.uint64(indptr[j]), last):
            i = np.uint32(indices[t])
            Px[i] += base[t] * x[j]
            total += base[t] * x[i]
        Px[j] = total
    if m.rho > 0.0:  # the triangle is that of P + W
        weight = floats(m.weight, m.n)
        for j in range(m.n):
            Px[j] -= weight[j] * x[j]


@part
def multiply_columns(m, first, end, u, Cx, Ctv):
    """Set Cx = C x and add C'v to Ctv, for the rows C that are columns first : end.

    u = (x, ..., v, ...) has the layout of K.
    """
    indptr, indices, base = triangle_of(m)
    for j in range(first, end):
        v, total = u[j], 0.0
        for t in range(np.uint64(indptr[j]), np.uint64(indptr[j + 1] - 1)):
            i = np.uint32(indices[t])
            Ctv[i] += base[t] * v
            total += base[t] * u[i]
        Cx[j - first] = total


@part
def multiply_rows(m, x, Gx):
    """Set Gx = G x."""
    columns, values, starts = rows_of(m)
    for i in range(m.m):
        total = 0.0
        for t in range(np.uint64(starts[i]), np.uint64(starts[i + 1])):
            total += values[t] * x[np.uint32(columns[t])]
        Gx[i] = total


@part
def make_response(m, row):
    """Make the response to a row, one pass more accurate than what changes."""
    m.operations += m.response_operations
    rhs = floats(m.rhs, m.size)
    for j in range(m.size):
        rhs[j] = 0.0
    if row < m.m:
        columns, values, starts = rows_of(m)
        for t in range(starts[row], starts[row + 1]):
            rhs[columns[t]] = values[t]
    else:
        rhs[row - m.m] = 1.0
    response = claim_place(m, row)
    solve_base(m, rhs, response[m.m :], m.passes + 1)
    multiply_rows(m, response[m.m : m.rows], response)


@part
def set_products(m):
    """Set the products of the result's x, y and z."""
    x, _, z, _ = parts_of_result(m)
    Gx, Gtz, Aty = floats(m.Gx, m.m), floats(m.Gtz, m.n), floats_at(m.Aty, m.n)
    multiply_cost(m, x, floats_at(m.Px, m.n))
    for j in range(m.n):
        Gtz[j], Aty[j] = 0.0, 0.0
    u = floats(m.out, m.size)  # x, then y
    multiply_columns(m, m.n, m.size, u, floats_at(m.Ax, m.p), Aty)
    multiply_rows(m, x, Gx)
    columns, values, starts = rows_of(m)
    for i in range(m.m):
        if z[i] != 0.0:
            for t in range(np.uint64(starts[i]), np.uint64(starts[i + 1])):
                Gtz[np.uint32(columns[t])] += values[t] * z[i]
