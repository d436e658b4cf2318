from namlcp.arrays cimport numbers
from namlcp.limits cimport look_at_clock
from namlcp.linalg.sparse_ldl cimport as_array
from namlcp.linalg.vectors cimport copy, fill, largest_entry
from namlcp.qp.interior.newton cimport THIN, factor, multiply
from namlcp.qp.interior.state cimport Interior, offer

cdef double OFF, RESIDUAL_GOAL, SMALL_ENOUGH, WRONG_SIGN, FIRST_SHIFT, SECOND_SHIFT
cdef double GOOD_ENOUGH
cdef double CONVERGING, PROMISING, AGAIN, RAY_SHIFT, PROJECTION, PROJECTED, NEARLY_ACTIVE
cdef enum:
    MOST_SETS = 6
    PROXIMAL_STEPS = 25
    PROJECTION_STEPS = 15

cdef int refine(Interior m) except -1
cdef void solve_set(Interior m) noexcept nogil
cdef void hold(Interior m) noexcept nogil
cdef double set_residual(Interior m) noexcept nogil
cdef void choose_next_set(Interior m) noexcept nogil
cdef bint promises(Interior m) noexcept nogil
cdef double farkas_ratio(Interior m) noexcept nogil
cdef double ray_ratio(Interior m) noexcept nogil
cdef object find_proof(Interior m)
cdef bint proves(Interior m, int k, tuple candidate) except -1
cdef tuple products(Interior m, object x, object v)
cdef tuple project_multipliers(Interior m, tuple candidate)
cdef tuple project_ray(Interior m, tuple candidate)
cdef object sums(Interior m, object values)
