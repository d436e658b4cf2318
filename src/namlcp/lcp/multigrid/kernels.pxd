from namlcp.linalg.csc cimport Columns, take_columns

cdef double VANISHED

cdef Columns rows_of(object M, Py_ssize_t n) except *
cpdef int strong_couplings(object matrix, double theta, int[::1] indptr, int[::1] indices, double[::1] data) except -1
cpdef void free_product(object matrix, const double[::1] dinv, const double[::1] x, double[::1] y)
cpdef void descend(object matrix, const int[::1] diagonal, object interpolation, const double[::1] dinv, const double[::1] b, double[::1] x, double[::1] coarse)
cpdef void ascend(object matrix, const int[::1] diagonal, object interpolation, const double[::1] dinv, const double[::1] b, const double[::1] coarse, double[::1] x)
cpdef void truncate_coarse(object level, object face, object below_level, object below)
