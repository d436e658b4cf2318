from namlcp.qp.interior.state cimport Interior

cdef enum:
    REPORT = 1
    JUDGE = 2
    ACTIVE_SET = 4
    PROVE = 8
    CLOCK = 16
    STOP = 32
    DOUBT = 64
    RESISTS = 30
    IDLE = 20
    LARGE_KKT = 5_000
cdef double DROP, DROP_LARGE, CLOSE, NEAR, NEAR_MU, STEADY, CONVERGING, PROMISING, SMALL_RATIO, AGAIN
cdef double STUCK, FAR, PASSES

cdef int look(Interior m) noexcept nogil
cdef bint mark_active(Interior m) noexcept nogil
cdef bint promises(Interior m) noexcept nogil
cdef double farkas_ratio(Interior m, const double* y, const double* Z, const double* v, const double* Ctv, double size) noexcept nogil
cdef double ray_ratio(Interior m, const double* d, const double* Pd, const double* t) noexcept nogil
