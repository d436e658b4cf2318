from namlcp.qp.active.state cimport ActiveSet

cdef double goal_of(ActiveSet m, Py_ssize_t row, Py_ssize_t side) noexcept nogil
cdef double* response_of(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef double* claim_place(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef void forget_responses(ActiveSet m) noexcept nogil
cdef bint is_pinned(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef void subtract_responses(ActiveSet m, const double* factor, Py_ssize_t k, double* s) noexcept nogil
cdef void solve_active(ActiveSet m, double* v) noexcept nogil
cdef void subtract_active(ActiveSet m, double* values) noexcept nogil
cdef void hold_active(ActiveSet m, double* values) noexcept nogil
