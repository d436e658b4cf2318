from namlcp.linalg.vectors cimport fill

cdef void blas_times(const double* C, int rows, int columns, const double* x, double* out, char letter) noexcept nogil
cdef double blas_dot(const double* a, const double* b, int n) noexcept nogil
cdef void times_lower(double* X, int count, int width, const double* V, int n, char letter) noexcept nogil
cdef bint cholesky(double* A, int n) noexcept nogil
cdef bint lu(double* A, int n, int* pivots) noexcept nogil
cdef void lu_solve(const double* factors, int n, const int* pivots, double* b) noexcept nogil
cdef void solve_rows(const double* L, int n, double* X, int count) noexcept nogil
cdef void invert_lower(double* L, int n) noexcept nogil
cdef void add_gram(const double* X, int rows, int n, int width, char letter, double beta, double* W, int width_W) noexcept nogil
