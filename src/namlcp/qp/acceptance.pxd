cdef double VALUE_ROUNDING, RESIDUAL, RADIUS, EXACT_RESIDUAL, MARGIN, ROUNDED_VALUE, CANCELLED

# Of a Farkas certificate: its value, the sum of the moduli of the terms of that, and the
# 1-norm of the multipliers.
cdef struct Farkas:
    double value
    double moduli
    double lam

cpdef bint is_clear(double value, double moduli) noexcept nogil
cpdef bint is_contradiction(double worst, double most, double size, double margin, double moduli) noexcept nogil
cpdef bint is_ray(double worst, double most, double error, double margin, double moduli, double left) noexcept nogil
cdef bint is_exact(double relative, double moduli) noexcept nogil
cdef bint suffices(double relative, double error, double margin, bint exact) noexcept nogil
cdef void weigh(
    Farkas* found, const double* b, const double* y, Py_ssize_t p, const double* h, const double* z,
    Py_ssize_t m, const double* lb, const double* ub, const double* s, double* z_box, Py_ssize_t n,
) noexcept nogil
cdef void add_term(Farkas* found, double side, double multiplier) noexcept nogil
