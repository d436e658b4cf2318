cpdef tuple permuted(const int[::1] indptr, const int[::1] indices, const int[::1] place, bint is_strict)
cdef tuple elimination_tree(const int[::1] indptr, const int[::1] indices)
cdef object postorder(const int[::1] parent, const unsigned char[::1] comes_last)
cdef object merged(const int[::1] parent, const int[::1] counts, const int[::1] lower, const int[::1] below)
cdef bint are_twins(Py_ssize_t i, Py_ssize_t j, const int[::1] parent, const int[::1] lower, const int[::1] below) noexcept
cdef object row_patterns(const int[::1] indptr, const int[::1] indices, object starts, const int[::1] parent, const int[::1] node)
