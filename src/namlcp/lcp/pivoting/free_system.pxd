from namlcp.lcp.pivoting.state cimport Pivoting

cdef Py_ssize_t SMALL_ORDER
cdef double PSD_SLACK, JITTER, LEAST_PIVOT, PIVOT_FLOOR, CALL, DENSE_SPEED

cdef bint factor_free(Pivoting m, double shift) noexcept nogil
cdef void solve_free(Pivoting m) noexcept nogil
cdef void set_order(Pivoting m) noexcept nogil
cdef void plan(Pivoting m) noexcept nogil
cdef void gather(Pivoting m, double* out) noexcept nogil
cdef bint factor_dense(Pivoting m) noexcept nogil
cdef double analyse(Pivoting m) noexcept nogil
cdef double factor_sparse(Pivoting m) noexcept nogil
cdef void solve_sparse(Pivoting m, double* x) noexcept nogil
cdef bint is_definite(Pivoting m) noexcept nogil
