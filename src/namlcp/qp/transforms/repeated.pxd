cpdef enum:
    # Values of `Groups.leader` for a row that is not wanted, and for an empty one.
    UNWANTED = -2
    EMPTY = -1

cdef double SAME, GOLDEN

cpdef int turned_part(const int[::1] indptr, const int[::1] indices, const double[::1] data, const Py_ssize_t[::1] columns, const unsigned char[::1] wanted, int[::1] start, int[::1] position, double[::1] value) except -1
cpdef tuple group_rows(int[::1] indptr, int[::1] indices, double[::1] data, const unsigned char[::1] wanted, int[::1] key, int[::1] table, int[::1] leader, double[::1] ratio, int[::1] number)
cdef double multiple(const int[::1] indices, const double[::1] data, Py_ssize_t a, Py_ssize_t a_end, Py_ssize_t c, Py_ssize_t c_end) noexcept
cpdef Py_ssize_t merge_ranges(const int[::1] leader, const double[::1] ratio, const int[::1] number, const double[::1] h, double tol, double[::1] lower, double[::1] upper, Py_ssize_t[::1] low_at, Py_ssize_t[::1] up_at)
cpdef Py_ssize_t merge_equations(const int[::1] leader, const double[::1] ratio, const int[::1] number, const double[::1] b, double tol, double[::1] sides, Py_ssize_t[::1] most, Py_ssize_t[::1] least)
