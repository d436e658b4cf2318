from namlcp.derivatives.systems.cholesky cimport Equations
from namlcp.qp.active.dense cimport DenseActiveSet

cdef bint serves(DenseActiveSet m, const signed char* strict) noexcept nogil
cdef bint holds(DenseActiveSet m, const signed char* strict) noexcept nogil
cdef double least_pivot(DenseActiveSet m) noexcept nogil
cdef void solve_kept(DenseActiveSet m, const Equations* eq, const double* of_box, double* goals, double* values) noexcept nogil
cdef void set_load(DenseActiveSet m, const Equations* eq) noexcept nogil
cdef void solve_active(DenseActiveSet m, double* goals, double* values) noexcept nogil
