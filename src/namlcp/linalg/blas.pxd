cdef void blas_times(const double* C, int rows, int columns, const double* x, double* out) noexcept nogil
cdef void blas_times_transposed(const double* C, int rows, int columns, const double* x, double* out) noexcept nogil
cdef double blas_dot(const double* a, const double* b, int n) noexcept nogil
cdef bint cholesky(double* A, int n) noexcept nogil
cdef void cholesky_solve(const double* L, int n, double* b) noexcept nogil
cdef bint lu(double* A, int n, int* pivots) noexcept nogil
cdef void lu_solve(const double* factors, int n, const int* pivots, double* b) noexcept nogil
cdef void solve_rows(const double* L, int n, double* X, int count) noexcept nogil
cdef void invert_lower(double* L, int n) noexcept nogil
cdef void times_transposed(const double* A, const double* B, double* C, int rows, int columns, int inner) noexcept nogil
cdef void times(const double* A, const double* B, double* C, int rows, int columns, int inner) noexcept nogil
cdef void _multiply_vector(char letter, const double* C, int rows, int columns, const double* x, double* out, int size) noexcept nogil
cdef void _multiply(char letter, const double* A, const double* B, double* C, int rows, int columns, int inner, int width) noexcept nogil
