from namlcp.qp.interior.state cimport Interior

cdef double OFF, RESIDUAL_GOAL, SMALL_ENOUGH, WRONG_SIGN, FIRST_SHIFT, SECOND_SHIFT
cdef double GOOD_ENOUGH, FAR, FALL
cdef enum:
    MOST_SETS = 6
    PROXIMAL_STEPS = 25

cdef int refine(Interior m) except -1
cdef void solve_set(Interior m) noexcept nogil
cdef void hold(Interior m) noexcept nogil
cdef double set_residual(Interior m) noexcept nogil
cdef void choose_next_set(Interior m) noexcept nogil
