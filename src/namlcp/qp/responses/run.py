"""The kernels: addresses in, one solve, the active rows kept.

`run` solves the QP with the matrices of `attach_matrices`: it checks them, computes V
if that is missing, and follows `course`, or `proximal` where P has no good factor.
`address` is that of a `ResponseState`. Codes are those of `active`, and those below.
"""

import numpy as np

from namlcp.checks import INFINITE
from namlcp.compiled import floats, kernel, longs, part, record_of
from namlcp.linalg import add_scaled, blas_times, blas_times_transposed, copy
from namlcp.qp.problem import stamp_of_parts
from namlcp.qp.responses.active import CONTRADICTION, DONE, RESPONSE, STUCK
from namlcp.qp.responses.course import (
    PRODUCTS,
    SUMMED,
    VALUES,
    advance,
    begin,
    is_base_solution,
)
from namlcp.qp.responses.dense import (
    make_responses,
    set_products,
    set_products_of_base,
    set_up,
    set_values_of,
)
from namlcp.qp.responses.judgement import (
    is_solved,
    measure_result,
    parts_of_result,
    residuals_of_result,
    vectors_of,
)
from namlcp.qp.responses.matrices import triangle_solve, triangle_solve_transposed
from namlcp.qp.responses.proximal import (
    contradicts_equations,
    leaves_equations,
    refine_contradiction,
    solve_by_rounds,
)
from namlcp.qp.responses.rows import (
    are_most_at_bounds,
    forget_responses,
    response_of,
)
from namlcp.qp.responses.sparse import make_response, set_rest, solve_shifted
from namlcp.qp.responses.sparse import set_products as set_sparse_products
from namlcp.qp.responses.sparse import set_values_of as set_sparse_values
from namlcp.qp.responses.state import lay_out, state_at
from namlcp.qp.responses.weight import wanted_rho
from namlcp.residuals import signed_gap

# Further codes of `run`. UNSUITED: this form does not take these matrices, or their
# numbers are not allowed. FAULTY: nor are those of a vector; or a side of h, lb or ub
# is finite, but means none, or contradicts another one.
# ROOMLESS: see `run_once`; OTHER_WEIGHT: `run_sparse`.
UNSUITED, FAULTY, ROOMLESS, OTHER_WEIGHT = 5, 6, 8, 9
# Operations of pivots from which on the interior-point method is quicker, for each one
# of n^2 (n + m + p); and a number, some tens of milliseconds, that is never too large.
# (Linear programs take 10 to 30 of these units, other QPs 1 to 4.)
MOST_OPERATIONS, FEW_OPERATIONS = 4.0, 2e8
# Residual of a solve with a sparse K, over the right-hand side, at which it is not
# refined further. Passes of refinement at most, and the gain of one below which it was
# not worth it.
ACCURATE, MOST_PASSES, GAIN = 1e-11, 4, 0.5


@kernel
def attach_matrices(address, P, G, A):
    """Note the matrices of a new QP; tell whether the memory is large enough for it."""
    m = state_at(address)
    m.n, m.m, m.p = P.shape[0], G.shape[0], A.shape[0]
    m.P, m.G, m.A = P.ctypes.data, G.ctypes.data, A.ctypes.data
    m.is_ready, m.k, m.kept_k, m.hints = 0, 0, 0, 0
    unit = 1.0 * m.n * m.n * (m.n + m.m + m.p)
    m.most_operations = max(FEW_OPERATIONS, MOST_OPERATIONS * unit)
    m.items_left, m.is_free = 0, 0
    m.face_is_kept, m.is_large, m.skipped = 0, 0, 0
    return lay_out(m, True)


@part
def attach_vectors(m, vectors, out):
    """Note q, h, b, lb and ub, one after another, and where the result is to be."""
    m.q, m.out = vectors.ctypes.data, out.ctypes.data
    m.h = m.q + 8 * m.n
    m.b = m.h + 8 * m.m
    m.lb = m.b + 8 * m.p
    m.ub = m.lb + 8 * m.n


@kernel
def take_hint(address, active):
    """Note rows that are probably active, as `Guess.active` has them, to start from.

    None are noted if there are too many of them.
    """
    m = state_at(address)
    kept, kept_side = longs(m.kept_active, m.most + 1), longs(m.kept_side, m.most + 1)
    m.kept_k, m.hints, m.is_free = 0, 0, 0
    for i in range(m.m + 2 * m.n):
        if active[i]:
            if m.hints == m.most:
                m.hints = 0
                break
            kept[m.hints] = i if i < m.rows else i - m.n
            kept_side[m.hints] = -1 if m.m <= i < m.rows else 1
            m.hints += 1


@part
def are_allowed(q, h, b, lb, ub):
    """Tell whether all numbers in the vectors are allowed, and mean what they are.

    Not so NaN, infinite entries of q and b, and sides beyond `INFINITE`.
    """
    fine = True
    for j in range(q.size):
        fine = fine and abs(q[j]) < np.inf
    for i in range(b.size):
        fine = fine and abs(b[i]) < np.inf
    for i in range(h.size):
        fine = fine and (-INFINITE < h[i] < INFINITE or h[i] == np.inf)
    for j in range(q.size):
        fine = fine and (-INFINITE < lb[j] < INFINITE or lb[j] == -np.inf)
        fine = fine and (-INFINITE < ub[j] < INFINITE or ub[j] == np.inf)
    return fine


@kernel
def accepts(vectors, n, m, p):
    """Tell whether q, h, b, lb and ub, one after another, `are_allowed`."""
    h, b, lb, ub = n, n + m, n + m + p, 2 * n + m + p
    return are_allowed(
        vectors[:h], vectors[h:b], vectors[b:lb], vectors[lb:ub], vectors[ub:]
    )


@part
def is_faulty(m):
    """Tell whether a number in the vectors is not allowed, or two sides are opposed."""
    q, b = floats(m.q, m.n), floats(m.b, m.p)
    h, lb, ub = floats(m.h, m.m), floats(m.lb, m.n), floats(m.ub, m.n)
    if not are_allowed(q, h, b, lb, ub):
        return True
    opposed = False
    for j in range(m.n):
        opposed = opposed or not lb[j] <= ub[j]
    return opposed


@kernel(error_model="numpy")
def run_once(address, P, G, A, vectors, out, clock):
    """Solve a single QP with these matrices and (q, h, b, lb, ub), as `run`.

    Sets m.stamp, see `stamp_of_parts`.
    ROOMLESS where the memory is not large enough.
    """
    if not attach_matrices(address, P, G, A):
        return ROOMLESS
    m = state_at(address)
    q, h, b, lb, ub = vectors
    m.q, m.h, m.b = q.ctypes.data, h.ctypes.data, b.ctypes.data
    m.lb, m.ub, m.out = lb.ctypes.data, ub.ctypes.data, out.ctypes.data
    m.stamp = stamp_of_parts(P, G, A, vectors)
    return solve_attached(m, clock)


@kernel(error_model="numpy")
def run(address, vectors, out, clock):
    """Solve the QP, or all items of a batch; clock: see `Deadline.run`.

    vectors: q, h, b, lb and ub, one after another; those of items are known.

    The result is complete after DONE; after LATE it is the best point, after
    CONTRADICTION it has x and the multipliers y and z of a candidate for a certificate.
    The codes of a batch and its pivots are written to m.codes, item by item.
    """
    m = state_at(address)
    if m.items_left == 0:
        attach_vectors(m, vectors, out)
    while True:
        found = solve_attached(m, clock)
        if m.items_left == 0:
            return found
        ended = longs(m.codes, 2)
        ended[0], ended[1] = found, m.pivots
        go_to_next_item(m)
        if m.items_left == 0:
            return found


@part
def solve_attached(m, clock):
    """Solve the QP at the addresses of m."""
    m.pivots = 0
    if is_faulty(m):
        return FAULTY
    if not m.is_ready and not set_up(m):
        return UNSUITED
    m.is_ready = 1
    if m.skipped > 0 and contradicts_equations(m):
        return CONTRADICTION
    if m.rho == 0.0:
        found = follow_course(m, clock)
    elif m.rho == wanted_rho(m) or set_up(m):
        found = solve_by_rounds(m, clock)
    else:
        return UNSUITED
    if found == CONTRADICTION:
        refine_contradiction(m)
    elif found == SUMMED:
        found = sum_anew(m)
    if found == DONE and m.skipped > 0 and leaves_equations(m):
        return UNSUITED
    m.is_free = m.rho == 0.0 and found == DONE and are_most_at_bounds(m)
    m.face_is_kept = 0
    return found


@part
def follow_course(m, clock):
    """Do what `course` asks for, from its beginning to its end."""
    found = begin(m, clock)
    while True:
        if found == VALUES:
            set_values_of(m, floats(m.rhs, m.n + m.p), floats(m.target, m.length))
        elif found == RESPONSE:
            make_responses(m)
        elif found == PRODUCTS and is_base_solution(m):
            set_products_of_base(m)
        elif found == PRODUCTS:
            set_products(m)
        else:
            return found
        found = advance(m)


@part
def sum_anew(m):
    """Measure the result with sums in the order of the data: DONE or STUCK.

    They are those of `qp_residuals`, which takes them from NumPy and thus from BLAS.
    """
    n, P, G, A = m.n, m.P, m.G, m.A
    x, y, z, _ = parts_of_result(m)
    blas_times(floats(P, (n, n)), x, floats(m.Px, n))
    blas_times(floats(G, (m.m, n)), x, floats(m.Gx, m.m))
    blas_times(floats(A, (m.p, n)), x, floats(m.Ax, m.p))
    blas_times_transposed(floats(G, (m.m, n)), z, floats(m.Gtz, n))
    blas_times_transposed(floats(A, (m.p, n)), y, floats(m.Aty, n))
    measure_result(m)
    Px = floats(m.Px, n)
    gap = signed_gap(vectors_of(m), parts_of_result(m), Px)
    residuals_of_result(m)[2] = abs(gap)
    return DONE if is_solved(m) else STUCK


@part
def solve_held(m, goals, values):
    """Set values = (G u, u, v), and goals = mu, for the active rows C of the last QP.

    They solve P u + A'v + C'mu = r, A u = e and C u = goals; (r, e) is in m.rhs.
    """
    size = m.n + m.p
    set_values_of(m, floats(m.rhs, size), values)
    active = longs(m.kept_active, m.most + 1)
    triangle = floats(m.kept_triangle, m.most * (m.most + 1) // 2)
    for i in range(m.kept_k):
        goals[i] = values[active[i]] - goals[i]
    triangle_solve(triangle, m.kept_k, goals)
    triangle_solve_transposed(triangle, m.kept_k, goals)
    for i in range(m.kept_k):
        add_scaled(-goals[i], response_of(m, active[i]), values)


@part
def least_pivot(m):
    """Return the least pivot of their S over its diagonal entry; 1 if there is none."""
    active = longs(m.kept_active, m.most + 1)
    triangle = floats(m.kept_triangle, m.most * (m.most + 1) // 2)
    least, last = 1.0, -1
    for i in range(m.kept_k):
        last += i + 1
        pivot = triangle[last] * triangle[last]
        least = min(least, pivot / response_of(m, active[i])[active[i]])
    return least


@part
def go_to_next_item(m):
    """Let the addresses be those of the next item, which starts from nothing."""
    m.items_left -= 1
    m.codes += 16
    m.P += m.P_step
    m.q += m.q_step
    m.G += m.G_step
    m.h += m.h_step
    m.A += m.A_step
    m.b += m.b_step
    m.lb += m.lb_step
    m.ub += m.ub_step
    m.out += m.out_step
    m.kept_k, m.hints = 0, 0
    if m.P_step + m.G_step + m.A_step > 0:
        m.is_ready = 0


# ---- sparse matrices


@kernel
def attach_sparse(state, sizes, triangle, rows):
    """Note the matrices of a new QP; tell whether the memory is large enough for it.

    sizes = (n, m, p); triangle: indptr, indices and values of K, and a vector of its
    order; rows: G.
    """
    m = record_of(state)
    m.n, m.m, m.p = sizes
    m.size = m.n + m.p
    indptr, indices, base, rest = triangle
    m.indptr, m.indices = indptr.ctypes.data, indices.ctypes.data
    m.base, m.rest = base.ctypes.data, rest.ctypes.data
    m.g_starts, m.g_columns = rows.indptr.ctypes.data, rows.indices.ctypes.data
    m.g_values = rows.data.ctypes.data
    m.is_ready, m.k, m.kept_k, m.hints = 0, 0, 0, 0
    m.is_sparse, m.rho = 1, 0.0
    return lay_out(m, False)


@kernel
def begin_anew(state, scale, reach, weight):
    """Note 1 over the norms of rows, and W; forget all responses to rows of G."""
    m = record_of(state)
    copy(scale, floats(m.scale, m.rows))
    copy(reach, floats(m.reach, m.p))
    copy(weight, floats(m.weight, m.n))
    forget_responses(m)


@kernel
def try_factors(state, rhs, size):
    """Choose the passes of refinement by a solve of K u = rhs.

    size: those of the entries of rhs and 1 / u. Returns the largest entry of the
    residual, and that of u in x.
    """
    m = record_of(state)
    u, other, rest = np.zeros(m.size), np.zeros(m.size), rhs.copy()
    error, passes = 1.0, -1
    while error > ACCURATE and passes < MOST_PASSES:
        solve_shifted(m, rest, other)
        for j in range(m.size):
            other[j] += u[j]
        set_rest(m, rhs, other, rest)
        new = 0.0
        for j in range(m.size):
            new = max(new, abs(rest[j] / size[j]))
        if not new < GAIN * error:
            break
        copy(other, u)
        error, passes = new, passes + 1
    m.passes = max(passes, 0)
    largest = 0.0
    for j in range(m.n):
        largest = max(largest, abs(u[j] * size[j]))
    return error, largest


@kernel(error_model="numpy")
def run_sparse(address, vectors, out, clock):
    """Do as `run`, for sparse matrices. OTHER_WEIGHT: with W for m.rho, call again."""
    m = state_at(address)
    attach_vectors(m, vectors, out)
    if not m.is_ready:
        return UNSUITED
    if is_faulty(m):
        return FAULTY
    if m.rho > 0.0:
        rho = wanted_rho(m)
        if m.rho != rho:
            m.rho = rho
            return OTHER_WEIGHT
        found = solve_by_rounds(m, clock)
        if found == CONTRADICTION:
            refine_contradiction(m)
        return found
    found = begin(m, clock)
    while True:
        if found == VALUES:
            set_sparse_values(m, floats(m.rhs, m.size), floats(m.target, m.length))
        elif found == RESPONSE:
            make_response(m, m.asked)
        elif found == PRODUCTS:
            set_sparse_products(m)
        else:
            return found
        found = advance(m)
