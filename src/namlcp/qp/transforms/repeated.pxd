cpdef enum:
    # Values of `Groups.number` for a row that is not wanted, and for an empty one.
    UNWANTED = -2
    EMPTY = -1

cdef double SAME, GOLDEN

cpdef int group_rows(int[::1] indptr, int[::1] indices, double[::1] data, int[::1] key, int[::1] table, int[::1] number, double[::1] ratio, int[::1] first) except -1
cdef double multiple(const int[::1] indices, const double[::1] data, Py_ssize_t a, Py_ssize_t a_end, Py_ssize_t c, Py_ssize_t c_end) noexcept
cpdef Py_ssize_t merge_rows(const int[::1] number, const double[::1] ratio, const double[::1] sides, bint equal, double tol, double[:, ::1] least, Py_ssize_t[:, ::1] giver) except -2
cpdef Py_ssize_t wrong_empty_row(const int[::1] number, const double[::1] sides, bint equal, double tol) except -2
