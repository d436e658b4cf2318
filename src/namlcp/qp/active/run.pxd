from namlcp.qp.active.dense cimport DenseActiveSet
from namlcp.qp.active.engine cimport ActiveSet, Code

cdef double INFINITE, LESS_RHO, MORE_RHO

cdef bint is_faulty(ActiveSet m) noexcept nogil
cdef Code decide(DenseActiveSet m) noexcept nogil
cdef Code solve_anew(DenseActiveSet m, double wanted) noexcept nogil
cdef Code proved(DenseActiveSet m, Code found) noexcept nogil
cdef Code solve_dense(DenseActiveSet m) noexcept nogil
cdef Code follow(ActiveSet m) noexcept nogil
cdef Code sum_anew(DenseActiveSet m) noexcept nogil
