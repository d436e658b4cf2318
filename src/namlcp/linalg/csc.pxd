cdef struct Columns:
    # A sparse matrix in CSC.
    const int *indptr
    const int *indices
    const double *data

cpdef tuple select_part(const int[::1] indptr, const int[::1] indices, const double[::1] data, Py_ssize_t height, const Py_ssize_t[::1] rows, const Py_ssize_t[::1] columns)
cdef Py_ssize_t write_squares(const int[::1] p_start, const int[::1] p_row, const double[::1] p_value, const int[::1] b_start, const int[::1] b_row, const double[::1] b_value, const int[::1] start_of, const int[::1] column_of, const double[::1] value_of, const double[::1] weight, int[::1] indptr, int[::1] indices, double[::1] data) except -2
cpdef void scatter(const int[::1] indptr, const int[::1] indices, const double[::1] data, double[:, :] out)
cpdef void add_columns(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] x, double[::1] out)
cpdef void add_column_sums(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] z, double[::1] out)
cpdef tuple unit_triangle(const int[::1] indptr, const int[::1] indices, const double[::1] data, double zero, double least, double slack)
cdef int take_columns(object M, Py_ssize_t n, Columns* out) except -1
cdef void columns_times(const Columns* M, Py_ssize_t n, const double* x, double* out) noexcept nogil
cdef void columns_times_transposed(const Columns* M, Py_ssize_t n, const double* z, double* out) noexcept nogil
