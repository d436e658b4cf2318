cdef enum:
    WHOLE = 0
    STRICT = 1

cdef void count_entries(const int* indptr, const int* indices, const int* place, Py_ssize_t n, Py_ssize_t least, int* columns, Py_ssize_t size) noexcept nogil
cdef void permute(const int* indptr, const int* indices, const int* place, Py_ssize_t n, Py_ssize_t least, int* columns, int* rows, int* source) noexcept nogil
cdef void set_tree(const int* columns, const int* rows, Py_ssize_t size, int* parent, int* count, int* seen) noexcept nogil
cdef void set_postorder(const int* parent, Py_ssize_t size, int* place, int* head, int* following, int* path) noexcept nogil
cdef Py_ssize_t merge(const int* parent, const int* counts, const int* lower, const int* below, Py_ssize_t size, const double* limits, int* first, double* filled) noexcept nogil
cdef bint are_twins(Py_ssize_t i, Py_ssize_t j, const int* parent, const int* lower, const int* below) noexcept nogil
cdef void set_row_patterns(const int* columns, const int* upper, const int* parent, const int* node, Py_ssize_t size, Py_ssize_t* end, int* seen, int* rows) noexcept nogil
