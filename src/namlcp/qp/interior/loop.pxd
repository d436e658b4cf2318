from namlcp.limits cimport is_over, look_at_clock, raise_kept
from namlcp.linalg.sparse_ldl cimport as_array
from namlcp.linalg.vectors cimport copy, fill
from namlcp.qp.interior.candidates cimport PROMISING, find_proof, promises, refine
from namlcp.qp.interior.newton cimport DELTA, RHO, evaluate, regularise, start, step
from namlcp.qp.interior.state cimport EXACT, Interior, attach, offer

cdef double LIFT, TOLERABLE, CLOSER, LEAST, INSIDE, LEAST_SLACK, LEAST_MULTIPLIER
cdef double DROP, CLOSE, NEAR, NEAR_MU, STEADY, FAR, PASSES
cdef enum:
    REPORT = 1
    JUDGE = 2
    ACTIVE_SET = 4
    PROVE = 8
    CLOCK = 16
    STOP = 32
    DOUBT = 64
    RESISTS = 30
    MOST_RESTARTS = 2
    PATIENCE = 100
    WARM_PATIENCE = 10
    MOST_REFUSED = 15

cdef bint is_late(Interior m) except -1
cdef object iterate(Interior m, object guess)
cdef object answer(Interior m, int wants)
cdef int look(Interior m) noexcept nogil
cdef bint restart(Interior m) except -1
cdef bint start_warm(Interior m, object guess) except -1
