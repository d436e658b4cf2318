"""The kernels for sparse QPs: as those for dense ones, with `course`."""

from namlcp.compiled import floats, kernel, record_of
from namlcp.linalg import copy
from namlcp.qp.responses.active import RESPONSE
from namlcp.qp.responses.course import PRODUCTS, VALUES, advance, begin
from namlcp.qp.responses.rows import forget_responses
from namlcp.qp.responses.run import FAULTY, UNSUITED, attach_vectors, is_faulty
from namlcp.qp.responses.sparse import (
    make_response,
    set_products,
    set_values_of,
)
from namlcp.qp.responses.state import lay_out, state_at


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
    return lay_out(m, False)


@kernel
def begin_anew(state, scale):
    """Note 1 over the norms of the rows; forget all responses to these."""
    m = record_of(state)
    copy(scale, floats(m.scale, m.rows))
    forget_responses(m)


@kernel(error_model="numpy")
def run_sparse(address, vectors, out, clock):
    """Do as `run`, for sparse matrices."""
    m = state_at(address)
    attach_vectors(m, vectors, out)
    if not m.is_ready:
        return UNSUITED
    if is_faulty(m):
        return FAULTY
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
