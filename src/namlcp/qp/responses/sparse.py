"""Sparse QPs by responses: the base problem by the factors of its KKT matrix.

The base problem min 1/2 x'Px + q'x, A x = b is the system K u = (-q, b) with

    K = [P  A'],    K~ = K + [R   0],    u = (x, y).
        [A  0 ]              [0  -D]

K~ = L D L' is factored once, with small diagonal matrices R and D in units of the rows
(`SHIFT`), so that it needs no pivoting. A solve with K is a solve with K~ and `passes`
of iterative refinement, as many as a solve with all signs alike needs at `set_up`. R is
zero where P alone gives pivots that are not small.

K is held by its upper triangle in CSC, as in `qp.kkt`: column n + i is row i of A, and
the diagonal is the last entry of a column. G is held by rows.
"""

import numpy as np

from namlcp.compiled import floats, ints, longs, part
from namlcp.linalg import ldl_factor, ldl_solve_into, pattern_of
from namlcp.qp.responses.judgement import parts_of_result
from namlcp.qp.responses.rows import claim_place, forget_responses

# Entries of R and D for rows equilibrated to a largest entry of 1.
SHIFT = 1e-9
# Pivot of a variable, over the diagonal entry of P, below which P alone is too small.
LEAST_PIVOT = 1e-7
# Residual, over the right-hand side, that a solve with K has to reach; the one at which
# it needs no further refinement; passes at most.
REACHED, ACCURATE, MOST_PASSES = 1e-9, 1e-11, 4
# Gain of a pass of refinement below which it was the last.
GAIN = 0.5
# Curvature of a row, in equilibrated units, over the largest one found at `set_up`, up
# to which the equations fix the row.
FIXED = 1e-11
# Operations of the pivots for each entry of K, G, L and a vector from which on another
# method is quicker: the interior-point method takes a microsecond for an entry.
MOST_OPERATIONS = 2000.0


@part
def set_up(m):
    """Factor K~; False where P or A does not allow it.

    Sets the passes of refinement, the norms of the rows, and limits.
    """
    m.is_shifted = 0
    if not (factor(m) and has_good_pivots(m)):
        m.is_shifted = 1
        if not (factor(m) and has_right_signs(m)):
            return False
    if not choose_passes(m):
        return False
    scale, shift = floats(m.scale, m.rows), floats(m.shift, m.size)
    for j in range(m.n):
        scale[m.m + j] = np.sqrt(shift[j] / SHIFT)
    pattern = pattern_of(m)
    entries = pattern.below.size + pattern.rows.size + m.size
    columns, values, starts = rows_of(m)
    for i in range(m.m):
        squares = 0.0
        for t in range(starts[i], starts[i + 1]):
            entry = values[t] / scale[m.m + columns[t]]
            squares += entry * entry
        scale[i] = 1.0 / np.sqrt(squares) if squares > 0.0 else 1.0
    m.most_operations = MOST_OPERATIONS * (entries + values.size + m.length)
    forget_responses(m)
    return True


@part
def factor(m):
    """Compute K~ and its factors; tell whether that succeeds."""
    indptr, _, base = triangle_of(m)
    shift, data = floats(m.shift, m.size), floats(m.data, base.size)
    for t in range(base.size):
        data[t] = base[t]
    for j in range(m.size):
        last = indptr[j + 1] - 1
        if j >= m.n:
            data[last] -= shift[j]
        elif m.is_shifted:
            data[last] += shift[j]
    pattern = pattern_of(m)
    values = floats(m.l_values, pattern.below.size)
    inverse, work = floats(m.l_inverse, m.size), floats(m.l_work, m.size)
    return ldl_factor(pattern, data, values, inverse, work)


@part
def has_right_signs(m):
    """Tell whether n pivots are positive, those of the variables, and p negative."""
    place, inverse = ints(m.l_place, m.size), floats(m.l_inverse, m.size)
    for j in range(m.size):
        if (inverse[place[j]] > 0.0) != (j < m.n):
            return False
    return True


@part
def has_good_pivots(m):
    """Tell whether all pivots have their signs, and none of a variable is small."""
    if not has_right_signs(m):
        return False
    place, inverse = ints(m.l_place, m.size), floats(m.l_inverse, m.size)
    indptr = ints(m.indptr, m.size + 1)
    data = floats(m.data, np.int64(indptr[m.size]))
    for j in range(m.n):
        if inverse[place[j]] * data[indptr[j + 1] - 1] * LEAST_PIVOT > 1.0:
            return False
    return True


@part
def choose_passes(m):
    """Set m.passes and m.least_curvature by a solve; False if that is not accurate.

    The right-hand side has entries of size 1 in units of the rows, with the signs of
    cos(j): without a pattern, and always the same.
    """
    shift = floats(m.shift, m.size)
    rhs, u, r = floats(m.rhs, m.size), floats(m.change, m.size), floats(m.rest, m.size)
    for j in range(m.size):
        rhs[j] = np.sqrt(shift[j]) * (1.0 if np.cos(j) > 0.0 else -1.0)
        u[j] = 0.0
    m.passes = -1
    before = np.inf
    while m.passes < MOST_PASSES:
        set_rest(m, rhs, u, r)
        worst = 0.0
        for j in range(m.size):
            worst = max(worst, abs(r[j] / rhs[j]))
        if not worst < GAIN * before:
            m.passes = max(m.passes - 1, 0)
            worst = before
            break
        if worst <= ACCURATE:
            break
        before = worst
        m.passes += 1
        refine(m, u, r)
    largest = 0.0
    for j in range(m.n):
        largest = max(largest, abs(u[j] * rhs[j]) / SHIFT)
    m.least_curvature = FIXED * largest
    return worst <= REACHED


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
    pattern = pattern_of(m)
    values = floats(m.l_values, pattern.below.size)
    inverse, work = floats(m.l_inverse, m.size), floats(m.l_work, m.size)
    ldl_solve_into(pattern, values, inverse, rhs, u, work)


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
    indptr = ints(m.indptr, m.size + 1)
    nnz = np.int64(indptr[m.size])
    return indptr, ints(m.indices, nnz), floats(m.base, nnz)


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
    x, y, z, _ = parts_of_result(m)
    Px, Gx, Ax = floats(m.Px, m.n), floats(m.Gx, m.m), floats(m.Ax, m.p)
    Gtz, Aty = floats(m.Gtz, m.n), floats(m.Aty, m.n)
    indptr, indices, base = triangle_of(m)
    for j in range(m.n):
        last = np.uint64(indptr[j + 1] - 1)
        total = base[last] * x[j]
        for t in range(np.uint64(indptr[j]), last):
            i = np.uint32(indices[t])
            Px[i] += base[t] * x[j]
            total += base[t] * x[i]
        Px[j] = total
        Gtz[j], Aty[j] = 0.0, 0.0
    for k in range(m.p):
        j = m.n + k
        total = 0.0
        for t in range(np.uint64(indptr[j]), np.uint64(indptr[j + 1] - 1)):
            i = np.uint32(indices[t])
            total += base[t] * x[i]
            Aty[i] += base[t] * y[k]
        Ax[k] = total
    multiply_rows(m, x, Gx)
    active = longs(m.active, m.most + 1)
    columns, values, starts = rows_of(m)
    for a in range(m.k):
        i = active[a]
        if i < m.m:
            for t in range(np.uint64(starts[i]), np.uint64(starts[i + 1])):
                Gtz[np.uint32(columns[t])] += values[t] * z[i]
