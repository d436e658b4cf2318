from namlcp.qp.active.state cimport ActiveSet, Code

cdef double DEPENDENT, DEPENDENT_HINT, VIOLATION_ROUNDING, NOISE, MOST_ROUNDING
cdef Py_ssize_t USUAL
cdef double ROUND_ROUNDING, MOST_ROUND_ROUNDING, BASE_ROUNDING

cdef enum:
    MOST_PIVOTS = 10
    GROWN = 3
    MOST_SORTED = 64
    MOST_AGE = 50

cdef void remove_row(ActiveSet m, Py_ssize_t i) noexcept nogil
cdef void append_row(ActiveSet m, Py_ssize_t row, Py_ssize_t side, double multiplier, double length) noexcept nogil
cdef double rest_of(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef bint is_dependent(ActiveSet m, Py_ssize_t row, double rest, double limit) noexcept nogil
cdef Py_ssize_t most_independent(ActiveSet m) noexcept nogil
cdef void recall(ActiveSet m) noexcept nogil
cdef void keep(ActiveSet m) noexcept nogil
cdef void admit_hints(ActiveSet m) noexcept nogil
cdef void set_multipliers(ActiveSet m) noexcept nogil
cdef void set_point_values(ActiveSet m) noexcept nogil
cdef void drop_wrong_signs(ActiveSet m) noexcept nogil
cdef double size_of(ActiveSet m, const double* values) noexcept nogil
cdef void choose_entering(ActiveSet m) noexcept nogil
cdef Code step(ActiveSet m) noexcept nogil
cdef bint is_noise(ActiveSet m) noexcept nogil
cdef bint has_next(ActiveSet m) noexcept nogil
cdef Code excuse(ActiveSet m) noexcept nogil
cdef Code pivot(ActiveSet m) noexcept nogil
cdef void sort_active(ActiveSet m) noexcept nogil
cdef bint factor_active(ActiveSet m) noexcept nogil
cdef bint finish(ActiveSet m) noexcept nogil
