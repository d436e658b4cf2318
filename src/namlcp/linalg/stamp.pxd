cdef unsigned long long add_stamp(const double* values, Py_ssize_t count, unsigned long long total) noexcept nogil
