cdef double FIXED

cpdef int fix_by_rows(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] h, double[::1] lb, double[::1] ub, int[::1] by, double[::1] entry) except -1
cdef int find_fixed(const double[::1] lb, const double[::1] ub, unsigned char[::1] stays) except -1
cdef int share_out(const double[::1] y, const Py_ssize_t[:, ::1] rows, const double[::1] ratio, double[::1] full) except -1
cdef int hand_on(const double[:, ::1] z, const Py_ssize_t[:, ::1] rows, const double[::1] ratio, double[::1] full) except -1
cdef object between(const double[:, ::1] ends, const Py_ssize_t[:, ::1] rows, const double[::1] ratio)
