from namlcp.linalg.blas cimport add_gram, cholesky, invert_lower, times_lower
from namlcp.linalg.dense cimport add_times_transposed, append_to_triangle, factor_in_place
from namlcp.linalg.dense cimport invert_triangle, remove_from_triangle
from namlcp.linalg.dense cimport times_rows, times_triangle, times_triangle_transposed
from namlcp.linalg.dense cimport triangle_solve, triangle_solve_transposed
from namlcp.linalg.vectors cimport add_scaled, copy, dot, fill, largest_entry
from namlcp.qp.active.engine cimport ActiveSet, Code, CONTRADICTION, DONE, STUCK, UNBOUNDED
from namlcp.qp.active.engine cimport UNPROVED, DEPENDENT, MOST_SORTED
from namlcp.qp.active.engine cimport claim_place, forget_responses, forget_rows, goal_of
from namlcp.qp.active.engine cimport indices, insert_place, lay_out_rows, reals, remove_place
from namlcp.qp.active.engine cimport set_base_values
from namlcp.qp.active.rounds cimport NO_WEIGHT, RHO, is_fit, refine_contradiction
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
        # Free variables in the order of L; their part of P is L L'.
        Py_ssize_t *free
        double *free_triangle
        # T, a held row every most_free numbers, and R with R R' = T T'.
        double *held_rows, *held_triangle
        # P_B x_B; right-hand sides and solutions on the face; what is left of a gradient,
        # or of a row.
        double *load, *free_part, *held_part, *slope
        # Free variables, and at most (0: no face); active rows of G, which come first.
        Py_ssize_t free_count, most_free, held
        # Whether factors are made by LAPACK; the next solve begins on the face; the face
        # is that of the last one.
        bint is_large, is_free, face_is_kept


cdef double PSD_SLACK, MOST_SPREAD, ROUNDING_UNIT, DEPENDENT_EQUATION, FIXED
cdef double CONTRADICTED, LESS_RHO, MORE_RHO
cdef enum:
    MOST_EQUATIONS = 2
    MOST_ROWS = 2
    MANY = 8

cdef bint is_sound(DenseActiveSet m) noexcept nogil
cdef bint has_factor(DenseActiveSet m, double slack) noexcept nogil
cdef bint factor_cost(DenseActiveSet m) noexcept nogil
cdef bint factor_weighted(DenseActiveSet m) noexcept nogil
cdef double reach_of(const double* row, const double* shape, Py_ssize_t n) noexcept nogil
cdef void invert_factor(DenseActiveSet m) noexcept nogil
cdef void set_unit_load(DenseActiveSet m, Py_ssize_t row, double* rhs) noexcept nogil
cdef void prepare(DenseActiveSet m) noexcept nogil
cdef Code solve_and_prove(DenseActiveSet m) noexcept nogil
cdef Code proved(DenseActiveSet m, Code found) noexcept nogil
cdef bint contradicts_equations(DenseActiveSet m) noexcept nogil
cdef bint factor_face(DenseActiveSet m) noexcept nogil
cdef const double* held_row(DenseActiveSet m, Py_ssize_t i) noexcept nogil
cdef void set_free_part(DenseActiveSet m, const double* vector, double* out) noexcept nogil
cdef bint append_free(DenseActiveSet m, Py_ssize_t j) noexcept nogil
cdef bint factor_held(DenseActiveSet m) noexcept nogil
cdef double solve_face(DenseActiveSet m, double* values) noexcept nogil
cdef void set_load(DenseActiveSet m) noexcept nogil
cdef void set_face_point(DenseActiveSet m) noexcept nogil
cdef void set_multipliers_of(DenseActiveSet m, double* multiplier) noexcept nogil
