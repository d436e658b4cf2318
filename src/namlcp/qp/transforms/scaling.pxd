cdef enum:
    ROUNDS = 10
    STEPS = 20

cdef double EQUAL, LEAST_FACTOR, MOST_FACTOR, REDUCTION, LARGEST, LEAST_DIVISOR

cpdef tuple one_sided(const double[::1] upper, const double[::1] lower, const double[::1] ub, const double[::1] lb, Py_ssize_t rows, int[::1] place, double[::1] sign, double[::1] side)
cdef Py_ssize_t list_finite(const double[::1] values, Py_ssize_t first, double s, Py_ssize_t k, int[::1] place, double[::1] sign, double[::1] side) noexcept
cpdef int unscale(const double[::1] unit, const int[::1] place, tuple ends, const double[::1] x, const double[::1] y, const double[::1] Z, double[::1] x_out, double[::1] y_out, double[::1] upper, double[::1] lower, double[::1] box) except -1
cpdef int equilibrate(const int[::1] indptr, const int[::1] indices, double[::1] data, double[::1] scale) except -1
cpdef int even_out(const int[::1] indptr, const int[::1] indices, const double[::1] data, double[::1] scale) except -1
