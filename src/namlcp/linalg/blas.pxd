cdef void blas_times(const double* C, Py_ssize_t count, Py_ssize_t n, const double* x, double* out) noexcept nogil
cdef void blas_times_transposed(const double* C, Py_ssize_t count, Py_ssize_t n, const double* x, double* out) noexcept nogil
cdef double blas_dot(const double* a, const double* b, Py_ssize_t n) noexcept nogil
cdef bint cholesky(double* A, Py_ssize_t n) noexcept nogil
cdef void cholesky_solve(const double* L, Py_ssize_t n, double* b) noexcept nogil
cdef bint lu(double* A, Py_ssize_t n, int* pivots) noexcept nogil
cdef void lu_solve(const double* factors, Py_ssize_t n, const int* pivots, double* b) noexcept nogil
cdef void solve_rows(const double* L, Py_ssize_t n, double* X, Py_ssize_t count) noexcept nogil
cdef void invert_lower(double* L, Py_ssize_t n) noexcept nogil
cdef void times_transposed(const double* A, const double* B, double* C, Py_ssize_t rows, Py_ssize_t columns, Py_ssize_t inner) noexcept nogil
cdef void times(const double* A, const double* B, double* C, Py_ssize_t rows, Py_ssize_t columns, Py_ssize_t inner) noexcept nogil
cdef void _times(char letter, const double* C, Py_ssize_t count, Py_ssize_t n, const double* x, double* out, Py_ssize_t size) noexcept nogil
cdef void _multiply(char letter, const double* A, const double* B, double* C, Py_ssize_t rows, Py_ssize_t columns, Py_ssize_t inner) noexcept nogil
