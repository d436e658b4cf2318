from namlcp.qp.interior.state cimport Interior

cdef double LIFT, TOLERABLE, CLOSER, LEAST, INSIDE, LEAST_SLACK, LEAST_MULTIPLIER, LONG, GAIN
cdef enum:
    MOST_RESTARTS = 2
    PATIENCE = 100
    WARM_PATIENCE = 10
    FACTORISATIONS = 3
    MOST_REFUSED = 15

cdef bint is_late(Interior m) except -1
cdef object iterate(Interior m, object guess)
cdef object answer(Interior m, int wants)
cdef void begin(Interior m) noexcept nogil
cdef bint start(Interior m) noexcept nogil
cdef bint step(Interior m) noexcept nogil
cdef bint predict(Interior m) noexcept nogil
cdef void find_step(Interior m) noexcept nogil
cdef void correct(Interior m) noexcept nogil
cdef bint restart(Interior m) except -1
cdef bint start_warm(Interior m, object guess) except -1
