from namlcp.qp.interior.state cimport Interior

cdef double ABOVE_ATTAINED, FORGET, SMALL_RHS, GMRES_ABOVE, BREAKDOWN
cdef double RHO, DELTA, FLOOR, LOWEST, TOP, POOR, ACCURATE, ACCURATE_FULL
cdef double NEGLIGIBLE_RESIDUAL, NEEDED, BEHIND
cdef enum:
    REFINEMENT_STEPS = 11
    KRYLOV_STEPS = 8
    WAIT = 3

cdef bint factor(Interior m) noexcept nogil
cdef double weighted_norm(const double* r, const double* weight, Py_ssize_t size) noexcept nogil
cdef double set_remainder(Interior m, const double* b, const double* u, double* r) noexcept nogil
cdef void solve(Interior m) noexcept nogil
cdef void accept(Interior m, double error) noexcept nogil
cdef void improve(Interior m) noexcept nogil
cdef void regularise(Interior m, double old_mu) noexcept nogil
cdef void lower(Interior m, bint rho, bint delta) noexcept nogil
cdef void strengthen(Interior m) noexcept nogil
