from namlcp.qp.active.engine cimport ActiveSet, Code

cdef double ACCURATE, RESERVE, ROUNDING, GAIN, LEAST_DIVISOR, INFINITE
cdef enum:
    PASSES = 3

cdef void set_point(ActiveSet m) noexcept nogil
cdef bint clip_point(ActiveSet m) noexcept nogil
cdef double measure(ActiveSet m) noexcept nogil
cdef bint is_low(ActiveSet m, double residual, double size, double most_reserve) noexcept nogil
cdef bint is_accurate(ActiveSet m, double error) noexcept nogil
cdef bint are_within(ActiveSet m, double rounding) noexcept nogil
cdef Code verdict(ActiveSet m) noexcept nogil
cdef void set_correction(ActiveSet m) noexcept nogil
cdef void set_change(ActiveSet m) noexcept nogil
cdef void take_change(ActiveSet m) noexcept nogil
cdef Code judge(ActiveSet m, Code found) noexcept nogil
cdef bint is_far(ActiveSet m) noexcept nogil
cdef double largest_side(const double* side, Py_ssize_t n) noexcept nogil
cdef bint is_faulty(ActiveSet m) noexcept nogil
cdef Code follow(ActiveSet m) noexcept nogil
