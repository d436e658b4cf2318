from namlcp.qp.active.dense cimport DenseActiveSet
from namlcp.qp.active.state cimport Code

cdef double MOST_WORK

cdef enum:
    LEAST_FREE = 32


cdef class NullSpace(DenseActiveSet):
    cdef:
        # Free variables in the order of L; their part of P is L L'.
        Py_ssize_t *free
        double *free_triangle
        # T, a held row every most_free numbers, and R with R R' = T T'.
        double *held_rows
        double *held_triangle
        # P_B x_B; right-hand sides and solutions of the system of the face.
        double *load
        double *free_part
        double *held_part
        # Multipliers of active rows by row, and their change, with room for a right-hand
        # side after those of G.
        double *row_multiplier
        double *row_ratio
        # Free variables, and at most (0: never this form); active rows of G; changes of
        # L since it was computed anew.
        Py_ssize_t free_count, most_free, held, face_age
        # Whether the next solve has this form; whether the face is that of the last
        # solved QP.
        readonly bint is_free, face_is_kept


cdef Code solve_next(NullSpace m) noexcept nogil
cdef Code solve_on_face(NullSpace m) noexcept nogil
cdef Code find_face(NullSpace m) noexcept nogil
cdef bint are_most_at_bounds(NullSpace m) noexcept nogil
cdef const double* held_row(NullSpace m, Py_ssize_t i) noexcept nogil
cdef void set_free_part(NullSpace m, const double* vector, double* out) noexcept nogil
cdef bint append_free(NullSpace m, Py_ssize_t j) noexcept nogil
cdef bint factor_held(NullSpace m) noexcept nogil
cdef bint factor_face(NullSpace m) noexcept nogil
cdef bint factor_changed(NullSpace m) noexcept nogil
cdef Py_ssize_t remove_index(Py_ssize_t* order, Py_ssize_t count, Py_ssize_t index) noexcept nogil
cdef bint leave(NullSpace m, Py_ssize_t row) noexcept nogil
cdef bint enter(NullSpace m, Py_ssize_t row, Py_ssize_t sign) noexcept nogil
cdef double solve_face(NullSpace m, double* values) noexcept nogil
cdef void set_load(NullSpace m) noexcept nogil
cdef void set_face_point(NullSpace m) noexcept nogil
cdef void subtract_gradient(NullSpace m, double* out) noexcept nogil
cdef bint recall_face(NullSpace m) noexcept nogil
cdef bint leave_wrong_signs(NullSpace m) noexcept nogil
cdef Code step_on_face(NullSpace m) noexcept nogil
cdef double set_direction(NullSpace m, Py_ssize_t row) noexcept nogil
cdef void list_active(NullSpace m) noexcept nogil
