from namlcp.linalg.csc cimport Columns

cdef enum:
    # Values of `Groups.number` for a row that is not wanted, and for an empty one.
    UNWANTED = -2
    EMPTY = -1
    NO_ENTRY = -1
    SEVERAL = -2

cdef double FIXED, SAME, GOLDEN, PIVOT

cdef int find_fixed(const double[::1] lb, const double[::1] ub, unsigned char[::1] stays) except -1
cpdef int group_rows(int[::1] indptr, int[::1] indices, double[::1] data, int[::1] key, int[::1] table, int[::1] number, double[::1] ratio, int[::1] first) except -1
cdef double multiple(const int[::1] indices, const double[::1] data, Py_ssize_t a, Py_ssize_t a_end, Py_ssize_t c, Py_ssize_t c_end) noexcept
cdef Py_ssize_t merge_rows(const int[::1] number, const double[::1] ratio, const double[::1] sides, bint equal, double tol, double[:, ::1] least, Py_ssize_t[:, ::1] giver) except -2
cdef Py_ssize_t wrong_empty_row(const int[::1] number, const double[::1] sides, bint equal, double tol) except -2
cdef bint find_free_columns(object qp, int[::1] chosen, double[::1] pivot, double[::1] cost) except -1
cdef Py_ssize_t only_entry(const Columns* C, Py_ssize_t j) noexcept nogil
