"""BLAS and LAPACK in compiled code, sparse columns, orderings, factorisations.

Functions that take the arrays of a compressed matrix take them in the order indptr,
indices, data; where a dense form goes with them it stands first.
"""

from namlcp.linalg.columns import (
    LEAST_DIVISOR,
    SMALL_ORDER,
    Columns,
    add_product,
    all_finite,
    columns_of,
    largest_entry,
    scale_columns,
    write_diagonal,
)
from namlcp.linalg.csc import (
    Compressed,
    add_column_sums,
    add_columns,
    add_transposed,
    arrays_of,
    as_dense,
    by_rows,
    compiled_form,
    submatrix,
    times,
    with_squares,
    without_zeros,
)
from namlcp.linalg.definite import (
    PSD_SLACK,
    curvature,
    has_positive_pivots,
    is_positive_semidefinite,
    is_symmetric,
    positive_factors,
)
from namlcp.linalg.factors import (
    FACTORS,
    Factors,
    SparseFactors,
    attach_factors,
    better_order,
    factor_record,
    factor_triangle,
    plan_factors,
    solve_record,
)
from namlcp.linalg.lapack import (
    add_rmatvec,
    add_scaled,
    backward_solve,
    blas_dot,
    blas_times,
    blas_times_transposed,
    cholesky,
    cholesky_solve,
    copy,
    dot,
    forward_solve,
    invert_lower,
    lu,
    lu_solve,
    matvec,
    multiply,
    product,
    solve_rows,
)
from namlcp.linalg.ldl import (
    Triangle,
    bitset_minimum_degree,
    ldl_numeric,
    ldl_solve,
    ldl_symbolic,
)
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.multifrontal import (
    panel_of,
    rows_below,
    solve_unit_lower,
    stack_size,
)
from namlcp.linalg.ordering import Supernodes, supernodes
from namlcp.linalg.symmetry import asymmetry, dense_asymmetry, sparse_asymmetry
from namlcp.linalg.threads import blas_threads
