from namlcp.qp.interior.state cimport Interior

cdef double RHO, DELTA, FLOOR, LOWEST, TOP, POOR, ACCURATE, ACCURATE_FULL
cdef double NEGLIGIBLE_RESIDUAL, NEEDED, BEHIND
cdef enum:
    WAIT = 3

cdef void regularise(Interior m, double old_mu) noexcept nogil
cdef void lower(Interior m, bint rho, bint delta) noexcept nogil
cdef void strengthen(Interior m) noexcept nogil
