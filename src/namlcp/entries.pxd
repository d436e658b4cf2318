cpdef enum Order:
    CORRUPT
    UNSORTED
    CANONICAL

cdef enum:
    TILE = 32

cpdef bint is_bad(const double[::1] values, bint infinite_allowed)
cpdef bint has_huge(const double[::1] values, double most)
cpdef tuple dense_asymmetry(const double[:, ::1] P)
cpdef tuple sparse_asymmetry(const int[::1] indptr, const int[::1] indices, const double[::1] data)
cpdef Order index_order(const int[::1] indptr, const int[::1] indices, Py_ssize_t major, Py_ssize_t minor)
cpdef object narrowed(const long long[::1] indices)
cpdef tuple transposed(const int[::1] indptr, const int[::1] indices, const double[::1] data, Py_ssize_t rows)
cpdef tuple compressed(const double[:, ::1] C)
