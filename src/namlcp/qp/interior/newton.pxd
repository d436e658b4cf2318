from namlcp.qp.interior.state cimport Interior

cdef double ABOVE_ATTAINED, FORGET, SMALL_RHS, GMRES_ABOVE, BREAKDOWN
cdef enum:
    REFINEMENT_STEPS = 11
    KRYLOV_STEPS = 8

cdef bint factor(Interior m) noexcept nogil
cdef double weighted_norm(const double* r, const double* weight, Py_ssize_t size) noexcept nogil
cdef double set_remainder(Interior m, const double* b, const double* u, double* r) noexcept nogil
cdef void solve(Interior m) noexcept nogil
cdef bint is_refined(Interior m) noexcept nogil
cdef void accept(Interior m, double error) noexcept nogil
cdef void improve(Interior m) noexcept nogil
