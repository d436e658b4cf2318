cdef class Factored:
    cdef:
        Py_ssize_t n
        const int *place
        const int *below
        const int *width
        const Py_ssize_t *starts
        const double *values
        const double *inverse
        double *y
        object factors

cdef void solve_factored(Factored f, const double* rhs, double* x) noexcept nogil
cdef void solve_forward(Factored f) noexcept nogil
cdef void solve_backward(Factored f) noexcept nogil
