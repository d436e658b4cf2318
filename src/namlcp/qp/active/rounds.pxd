from namlcp.box cimport clip
from namlcp.limits cimport is_over
from namlcp.linalg.dense cimport triangle_solve, triangle_solve_transposed
from namlcp.linalg.vectors cimport add_scaled, copy, dot, fill
from namlcp.measure cimport Terms, measure
from namlcp.qp.active.engine cimport ActiveSet, Code, CONTRADICTION, DONE, LATE, STUCK
from namlcp.qp.active.engine cimport SUMMED, UNBOUNDED, ROUND_ROUNDING, VIOLATION_ROUNDING
from namlcp.qp.active.engine cimport drop_wrong_signs, goal_of, is_pinned, pivot
from namlcp.qp.active.engine cimport set_base_values, size_of, subtract_responses

cdef double RHO, NO_WEIGHT, MOST_CURVED, LEAST_GROWTH
cdef double ACCURATE, FRESH, ROUNDING, GAIN, LEAST_DIVISOR, INFINITE
cdef enum:
    CORRECTIONS = 20
    MOST_ROUNDS = 20
    REFINEMENTS = 2
    RAY_PASSES = 3


cdef bint is_fit(ActiveSet m) noexcept nogil
cdef Code solve_at_hand(ActiveSet m) noexcept nogil
cdef Code solve_by_rounds(ActiveSet m) noexcept nogil
cdef void refine_contradiction(ActiveSet m) noexcept nogil
cdef void set_shape(ActiveSet m) noexcept nogil
cdef double wanted_rho(ActiveSet m) noexcept nogil
cdef void set_point(ActiveSet m) noexcept nogil
cdef bint clip_point(ActiveSet m) noexcept nogil
cdef double measure_point(ActiveSet m) noexcept nogil
cdef bint are_within(ActiveSet m, double rounding) noexcept nogil
cdef Code verdict(ActiveSet m) noexcept nogil
cdef void set_correction(ActiveSet m) noexcept nogil
cdef void set_change(ActiveSet m, bint to_sides) noexcept nogil
cdef Code judge(ActiveSet m) noexcept nogil
cdef bint is_ray(ActiveSet m) noexcept nogil
