from namlcp.lcp.pivoting.state cimport Pivoting

cdef double ACCURACY, SYMMETRY_ROUNDING
cdef Py_ssize_t MOST
cdef object SOLVED, NAME

cpdef object solve_small(object kind, double begun, object given, object A, object q, object lower, object upper, object start, object stamp)
cdef bint is_vector(object value, Py_ssize_t n)
cdef (double, double) sum_and_asymmetry(const double* A, Py_ssize_t n) noexcept nogil
cdef const double* bound(object value, double default, double* out, Py_ssize_t n) noexcept
