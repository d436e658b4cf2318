from namlcp.linalg.vectors cimport add_four, add_scaled, copy, dot, fill, four_dots

cdef double HUGE

cdef Py_ssize_t factor_in_place(double* L, Py_ssize_t n, double least) noexcept nogil
cdef void invert_triangle(double* L, Py_ssize_t n) noexcept nogil
cdef void forward_solve(const double* L, Py_ssize_t n, double* b) noexcept nogil
cdef void backward_solve(const double* L, Py_ssize_t n, double* b) noexcept nogil
cdef void times_rows(const double* C, Py_ssize_t count, Py_ssize_t n, Py_ssize_t width, const double* x, double* out) noexcept nogil
cdef void add_times_transposed(const double* C, Py_ssize_t count, Py_ssize_t n, const double* y, double* out) noexcept nogil
cdef void times_triangle(const double* V, Py_ssize_t n, const double* x, double* out) noexcept nogil
cdef void times_triangle_transposed(const double* V, Py_ssize_t n, const double* v, double* out) noexcept nogil
cdef void triangle_solve(const double* L, Py_ssize_t k, double* b) noexcept nogil
cdef void triangle_solve_transposed(const double* L, Py_ssize_t k, double* b) noexcept nogil
cdef void append_to_triangle(double* L, Py_ssize_t k, const double* b, double diagonal) noexcept nogil
cdef void remove_from_triangle(double* L, Py_ssize_t k, Py_ssize_t leaving, double* cosines, double* sines) noexcept nogil
