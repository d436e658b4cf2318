from namlcp.qp.active.dense cimport DenseActiveSet
from namlcp.qp.active.engine cimport ActiveSet, Code

cdef double CONTRADICTED, LEFT, WRONG
cdef enum:
    MOST_ROUNDS = 20
    RETRIES = 2
    REFINEMENTS = 2

cdef Code solve_by_rounds(ActiveSet m) noexcept nogil
cdef void set_base_values(ActiveSet m) noexcept nogil
cdef Code try_old_face(ActiveSet m) noexcept nogil
cdef Code minimise(ActiveSet m) noexcept nogil
cdef Code settle(ActiveSet m) noexcept nogil
cdef void refine_contradiction(ActiveSet m) noexcept nogil
cdef double equation_error(DenseActiveSet m, Py_ssize_t i, const double* x) noexcept nogil
cdef bint contradicts_equations(DenseActiveSet m) noexcept nogil
cdef bint leaves_equations(DenseActiveSet m) noexcept nogil
