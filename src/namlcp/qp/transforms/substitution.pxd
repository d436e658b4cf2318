from namlcp.linalg.csc cimport Columns

cdef enum:
    FILL = 4
    SMALL = 1000
    SHORT = 2
    NO_ENTRY = -1
    SEVERAL = -2

cdef double PIVOT

cdef int find_free_columns(object qp, int[::1] chosen, double[::1] pivot, double[::1] cost, double[::1] largest) except -1
cdef Py_ssize_t only_entry(const Columns* C, Py_ssize_t j) noexcept nogil
cdef Py_ssize_t drop_filling_rows(const Columns* A, Py_ssize_t n, int[::1] chosen, const double[::1] cost) except -1
