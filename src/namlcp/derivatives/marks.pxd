from namlcp.measure cimport Terms

cdef double ACTIVE

cdef Py_ssize_t mark(const Terms* t, const double* share, const double* norms, const double* size, signed char* strict, signed char* whole) noexcept nogil
