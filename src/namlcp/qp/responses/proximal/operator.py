"""The base problem and products with the matrices, dense or sparse."""

from namlcp.compiled import part
from namlcp.qp.responses.dense import make_responses as make_dense
from namlcp.qp.responses.dense import set_other_products as set_others
from namlcp.qp.responses.dense import set_products as set_dense_products
from namlcp.qp.responses.dense import set_values_of as set_dense_values
from namlcp.qp.responses.matrices import times_rows
from namlcp.qp.responses.sparse import make_response as make_sparse
from namlcp.qp.responses.sparse import multiply_cost
from namlcp.qp.responses.sparse import set_products as set_sparse_products
from namlcp.qp.responses.sparse import set_values_of as set_sparse_values


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
