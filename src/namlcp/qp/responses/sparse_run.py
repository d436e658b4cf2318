"""The kernels for sparse QPs: as those for dense ones, with `course`."""

from namlcp.compiled import floats, kernel, record_of
from namlcp.qp.responses.active import RESPONSE
from namlcp.qp.responses.course import PRODUCTS, VALUES, advance, begin
from namlcp.qp.responses.run import FAULTY, UNSUITED, is_faulty
from namlcp.qp.responses.sparse import (
    make_response,
    set_products,
    set_up,
    set_values_of,
)
from namlcp.qp.responses.state import lay_out, state_at


@kernel
def attach_sparse(state, sizes, triangle, vectors, rows):
    """Note the matrices of a new QP; tell whether the memory is large enough for it.

    sizes = (n, m, p); triangle: indptr, indices and values of K, and room for those of
    K~; vectors: the shifts of its diagonal, and room for a right-hand side; rows: G.
    """
    m = record_of(state)
    m.n, m.m, m.p = sizes
    m.size = m.n + m.p
    indptr, indices, base, data = triangle
    m.indptr, m.indices = indptr.ctypes.data, indices.ctypes.data
    m.base, m.data = base.ctypes.data, data.ctypes.data
    m.shift, m.rest = vectors[0].ctypes.data, vectors[1].ctypes.data
    m.g_starts, m.g_columns = rows.indptr.ctypes.data, rows.indices.ctypes.data
    m.g_values = rows.data.ctypes.data
    m.is_ready, m.k, m.kept_k, m.hints = 0, 0, 0, 0
    return lay_out(m, 0)


@kernel(error_model="numpy")
def run_sparse(address, eps_abs, eps_rel, max_iter, clock):
    """Do as `run`, for sparse matrices."""
    m = state_at(address)
    m.eps_abs, m.eps_rel, m.max_iter = eps_abs, eps_rel, max_iter
    if is_faulty(m):
        return FAULTY
    if not m.is_ready and not set_up(m):
        return UNSUITED
    m.is_ready = 1
    found = begin(m, clock)
    while True:
        if found == VALUES:
            set_values_of(m, floats(m.rhs, m.size), floats(m.target, m.length))
        elif found == RESPONSE:
            make_response(m, m.asked)
        elif found == PRODUCTS:
            set_products(m)
        else:
            return found
        found = advance(m)
