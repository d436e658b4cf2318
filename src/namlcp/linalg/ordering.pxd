cpdef tuple permuted(const int[::1] indptr, const int[::1] indices, const int[::1] place, bint is_strict)
cdef tuple elimination_tree(const int[::1] indptr, const int[::1] indices)
cdef object postorder(const int[::1] parent, const unsigned char[::1] comes_last)
cdef object merged(const int[::1] parent, const int[::1] counts, const int[::1] lower, const int[::1] below)
cdef bint are_twins(Py_ssize_t i, Py_ssize_t j, const int[::1] parent, const int[::1] lower, const int[::1] below) noexcept
cdef void append_rows(Py_ssize_t n, const int* indptr, const int* indices, const int* parent, const int* node, int* seen, Py_ssize_t* end, int* rows) noexcept nogil
