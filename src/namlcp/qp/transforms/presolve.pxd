cdef double FIXED

cpdef int fix_by_rows(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] h, double[::1] lb, double[::1] ub, int[::1] by, double[::1] entry) except -1
