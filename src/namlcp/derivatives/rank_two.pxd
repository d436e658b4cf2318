cdef void write_rank_two(double s, const double* a, const double* b, double t, const double* c, const double* d, Py_ssize_t rows, Py_ssize_t columns, double* out) noexcept nogil
