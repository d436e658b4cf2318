cdef double INFINITE

# Rows of a tridiagonal matrix: its diagonals, 1 / pivot, 1 / sqrt(a_ii).
cpdef enum:
    BELOW
    DIAGONAL
    ABOVE
    INVERSE
    ROOT

cpdef bint is_ordinary(const double[::1] q, const double[::1] lower, const double[::1] upper) noexcept
cpdef bint read_rows(const int[::1] indptr, const int[::1] indices, const double[::1] data, double[:, ::1] rows) noexcept
cpdef tuple dominance_csr(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] root)
cpdef void row_sums(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] x, double roundoff, double least, double[::1] own, double[::1] others, double[::1] margin) noexcept
cpdef double relax_csr(object indptr, object indices, object data, object q, object lower, object upper, double alpha, object z) except? -1
cpdef int relax_back(object indptr, object indices, object data, object q, object lower, object upper, object z) except -1
