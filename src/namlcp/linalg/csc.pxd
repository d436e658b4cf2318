from namlcp.arrays cimport are_places, fits, indices as longs, new_places, new_vector, numbers, places, same_places

cdef struct Columns:
    # A sparse matrix in CSC.
    const int *indptr
    const int *indices
    const double *data

cdef Py_ssize_t write_squares(const Columns* parts, const double[::1] weight, int[::1] indptr, int[::1] indices, double[::1] data) except -2
cpdef tuple unit_triangle(object P, double zero, double least, double slack)
cdef int take_columns(object M, Py_ssize_t n, Columns* out) except -1
cdef void columns_times(const Columns* M, Py_ssize_t n, const double* x, double* out) noexcept nogil
cdef void columns_times_transposed(const Columns* M, Py_ssize_t n, const double* z, double* out) noexcept nogil
