from namlcp.arrays cimport CANONICAL, are_long, are_places, data_of, dense_asymmetry, fits
from namlcp.arrays cimport index_order, is_bad, narrowed, sparse_asymmetry

cdef double INFINITE

cpdef object qp_data(object P, object q, object G, object h, object A, object b, object lb, object ub)
cpdef object whole(object P, object q, object G, object h, object A, object b, object lb, object ub)
cdef object shortened(object M)
cdef bint is_clean(object P, object q, object G, object h, object A, object b, object lb, object ub) except -1
cdef Py_ssize_t rows_of(object M, Py_ssize_t n, bint is_dense) except -2
cdef bint is_side(object array, double sign, Py_ssize_t size)
