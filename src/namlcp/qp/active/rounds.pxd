from namlcp.box cimport clip
from namlcp.limits cimport is_over
from namlcp.linalg.dense cimport triangle_solve, triangle_solve_transposed
from namlcp.linalg.vectors cimport add_scaled, copy, dot, fill, largest_entry
from namlcp.measure cimport Terms, measure
from namlcp.qp.active.engine cimport ActiveSet, Code, CONTRADICTION, DONE, LATE, MOVED, STUCK
from namlcp.qp.active.engine cimport SUMMED, UNBOUNDED, ROUND_ROUNDING, VIOLATION_ROUNDING
from namlcp.qp.active.engine cimport drop_wrong_signs, goal_of, is_pinned, pivot
from namlcp.qp.active.engine cimport set_base_values, size_of, subtract_responses

cdef double RHO, NO_WEIGHT
cdef double EXACT, GOOD, FLAT, NEARLY_EXACT, CANCELLED, TINY, OPEN
cdef double RAY_GAIN, MOST_CURVED, LEAST_GROWTH
cdef double ACCURATE, FRESH, ROUNDING, GAIN, LEAST_DIVISOR, INFINITE
cdef enum:
    CORRECTIONS = 3
    MOST_ROUNDS = 20
    REFINEMENTS = 2
    PASSES = 60
    STEADY = 2
    RAY_PASSES = 40


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
cdef double set_change(ActiveSet m, bint to_sides) noexcept nogil
cdef void take_change(ActiveSet m) noexcept nogil
cdef Code judge(ActiveSet m) noexcept nogil
cdef Code descend(ActiveSet m) noexcept nogil
cdef double take_face(ActiveSet m) noexcept nogil
cdef double add_weighted(ActiveSet m, const double* v, double sum) noexcept nogil
cdef Code move(ActiveSet m, double energy, double error) noexcept nogil
cdef double longest_step(ActiveSet m, const double* along) noexcept nogil
cdef bint is_ray(ActiveSet m) noexcept nogil
