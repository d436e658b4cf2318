from namlcp.linalg.sparse_ldl cimport Factors
from namlcp.limits cimport Watched

cdef double FULL
cdef enum:
    BLOCK = 128  # rows that are condensed at a time

cdef class Condensed(Factors):
    cdef:
        # Variables; the pattern of K~; S, R and D; work space.
        Py_ssize_t width
        const int *indptr, *indices
        double *S, *R, *D, *y, *u
        tuple arrays

    cdef bint factor_values(self, double* data, Watched watch) noexcept nogil
    cdef void solve_into(self, double* rhs, double* x) noexcept nogil

cpdef int upper_triangle(object P, object A, object G, int[::1] indptr, int[::1] indices, double[::1] data) except -1
