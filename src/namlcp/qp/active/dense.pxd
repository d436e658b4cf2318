from namlcp.linalg.blas cimport cholesky, gram, invert_lower, times_lower
from namlcp.linalg.dense cimport add_times_transposed, factor_in_place, invert_triangle
from namlcp.linalg.dense cimport times_rows, times_triangle, times_triangle_transposed
from namlcp.linalg.vectors cimport add_scaled, copy, dot, fill, largest_entry
from namlcp.qp.active.engine cimport ActiveSet, Code, CONTRADICTION, STUCK, UNBOUNDED, UNPROVED
from namlcp.qp.active.engine cimport UNSUITED, claim_place, forget_responses, forget_rows
from namlcp.qp.active.engine cimport lay_out_rows, reals, set_base_values
from namlcp.qp.active.rounds cimport NO_WEIGHT, RHO, is_faulty, refine_contradiction
from namlcp.qp.active.rounds cimport set_shape, solve_at_hand, wanted_rho
from namlcp.qp.certificates cimport Claim, prove_infeasible, prove_unbounded
from namlcp.qp.kkt cimport Matrix


cdef class DenseActiveSet(ActiveSet):
    cdef:
        # The matrices, row by row; not owned.
        const double *P, *G, *A
        # L, then V, the rows of T', U; a vector V r, one of a product with U.
        double *factor, *equations, *schur, *half, *schur_work
        # Bounds that are none.
        double *no_bound
        # Whether factors are made by LAPACK.
        bint is_large


cdef double PSD_SLACK, MOST_SPREAD, ROUNDING_UNIT, DEPENDENT_EQUATION, FIXED
cdef double CONTRADICTED, LESS_RHO, MORE_RHO
cdef enum:
    MOST_EQUATIONS = 2
    MOST_ROWS = 2
    MANY = 8

cdef bint set_up(DenseActiveSet m) noexcept nogil
cdef bint is_sound(DenseActiveSet m) noexcept nogil
cdef double copy_cost(DenseActiveSet m, double slack) noexcept nogil
cdef bint has_factor(DenseActiveSet m) noexcept nogil
cdef bint factor_cost(DenseActiveSet m) noexcept nogil
cdef bint factor_weighted(DenseActiveSet m) noexcept nogil
cdef double reach_of(const double* row, const double* shape, Py_ssize_t n) noexcept nogil
cdef void invert_factor(DenseActiveSet m) noexcept nogil
cdef void set_unit_load(DenseActiveSet m, Py_ssize_t row, double* rhs) noexcept nogil
cdef void prepare(DenseActiveSet m) noexcept nogil
cdef Code solve_dense(DenseActiveSet m) noexcept nogil
cdef Code proved(DenseActiveSet m, Code found) noexcept nogil
cdef bint contradicts_equations(DenseActiveSet m) noexcept nogil
