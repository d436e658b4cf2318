from namlcp.qp.active.engine cimport ActiveSet, Code

cdef double WRONG, RHO, NO_WEIGHT, LEAST_SHAPE, LEAST_CURVATURE
cdef enum:
    MOST_ROUNDS = 20
    RETRIES = 2
    REFINEMENTS = 2

cdef Code solve_at_hand(ActiveSet m) noexcept nogil
cdef Code solve_by_rounds(ActiveSet m) noexcept nogil
cdef Code try_old_face(ActiveSet m) noexcept nogil
cdef Code settle(ActiveSet m) noexcept nogil
cdef void refine_contradiction(ActiveSet m) noexcept nogil
cdef void set_shape(ActiveSet m) noexcept nogil
cdef double wanted_rho(ActiveSet m) noexcept nogil
