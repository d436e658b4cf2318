"""BLAS and LAPACK in compiled code, sparse columns, orderings, factorisations.

Functions that take the arrays of a compressed matrix take them in the order indptr,
indices, data; where a dense form goes with them it stands first.
"""

from namlcp.linalg.columns import LEAST_DIVISOR
from namlcp.linalg.csc import (
    add_transposed,
    arrays_of,
    as_dense,
    by_rows,
    submatrix,
    times,
    unit_triangle,
    with_squares,
    without_zeros,
)
from namlcp.linalg.definite import (
    PSD_SLACK,
    asymmetry,
    has_positive_pivots,
    is_symmetric,
)
from namlcp.linalg.factors import plan_factors, plan_lu
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.ordering import supernodes
from namlcp.linalg.sparse_ldl import Factors, SparseFactors
from namlcp.linalg.threads import blas_threads
