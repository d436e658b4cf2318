from namlcp.linalg.dense cimport append_to_triangle, remove_from_triangle, times_rows
from namlcp.linalg.dense cimport triangle_solve, triangle_solve_transposed
from namlcp.linalg.vectors cimport add_scaled, copy, dot, fill
from namlcp.qp.active.dense cimport DenseActiveSet, set_unit_load, solve_dense
from namlcp.qp.active.engine cimport DEPENDENT, DONE, MOST_SORTED, STUCK, goal_of
from namlcp.qp.active.engine cimport indices, insert_place, reals, remove_place

cdef enum:
    LEAST_FREE = 32


cdef class NullSpace(DenseActiveSet):
    cdef:
        # Free variables in the order of L; their part of P is L L'.
        Py_ssize_t *free
        double *free_triangle
        # T, a held row every most_free numbers, and R with R R' = T T'.
        double *held_rows, *held_triangle
        # P_B x_B; right-hand sides and solutions on the face; what is left of a gradient,
        # or of a row.
        double *load, *free_part, *held_part, *slope
        # Free variables, and at most (0: never this form); active rows of G, which come
        # first.
        Py_ssize_t free_count, most_free, held
        # Whether the next solve has this form; whether the face is that of the last.
        readonly bint is_free, face_is_kept


cdef bint factor_face(NullSpace m) noexcept nogil
cdef const double* held_row(NullSpace m, Py_ssize_t i) noexcept nogil
cdef void set_free_part(NullSpace m, const double* vector, double* out) noexcept nogil
cdef bint append_free(NullSpace m, Py_ssize_t j) noexcept nogil
cdef void fix(NullSpace m, Py_ssize_t j) noexcept nogil
cdef bint factor_held(NullSpace m) noexcept nogil
cdef double solve_face(NullSpace m, double* values) noexcept nogil
cdef void set_load(NullSpace m) noexcept nogil
cdef void set_face_point(NullSpace m) noexcept nogil
cdef void set_multipliers_of(NullSpace m, double* multiplier) noexcept nogil
