cdef double OFTEN

cdef class Watched:
    cdef:
        # Operations since the last look at the clock, the end of the time limit; whether
        # to stop, whether a signal's handler raised `error`.
        double since, until
        bint over, interrupted
        object error

cdef void begin_watch(Watched m, double until) noexcept nogil
cdef bint is_over(Watched m, double operations) noexcept nogil
cdef void look_at_clock(Watched m) noexcept nogil
cdef int raise_kept(Watched m) except -1
