"""The base problem and products with the matrices, dense or sparse."""

from namlcp.compiled import part
from namlcp.qp.responses import dense, sparse
from namlcp.qp.responses.matrices import times_rows

set_dense_values, set_sparse_values = dense.set_values_of, sparse.set_values_of
make_dense, make_sparse = dense.make_responses, sparse.make_response
set_dense_products, set_sparse_products = dense.set_products, sparse.set_products
set_others, multiply_cost = dense.set_other_products, sparse.multiply_cost


@part
def set_values_of(m, rhs, values):
    """Set values = (G x, x, y) for (x, y) = K^-1 rhs."""
    if m.is_sparse:
        set_sparse_values(m, rhs, values)
    else:
        set_dense_values(m, rhs, values)


@part
def make_responses(m):
    """Make the response to row m.asked, perhaps others."""
    if m.is_sparse:
        make_sparse(m, m.asked)
    else:
        make_dense(m)


@part
def set_products(m):
    """Set the products of the result with P, G and A."""
    if m.is_sparse:
        set_sparse_products(m)
    else:
        set_dense_products(m)


@part
def set_other_products(m):
    """Set A x, G'z and A'y of the result, perhaps others."""
    if m.is_sparse:
        set_sparse_products(m)
    else:
        set_others(m)


@part
def times_cost(m, x, Px):
    """Set Px = P x."""
    if m.is_sparse:
        multiply_cost(m, x, Px)
    else:
        times_rows(m.P, m.n, m.n, x, Px)
