from namlcp.qp.active.dense cimport DenseActiveSet
from namlcp.qp.active.state cimport ActiveSet, Code

cdef Code solve_by_rounds(ActiveSet m) noexcept nogil
cdef void refine_contradiction(ActiveSet m) noexcept nogil
cdef bint contradicts_equations(DenseActiveSet m) noexcept nogil
cdef bint leaves_equations(DenseActiveSet m) noexcept nogil
