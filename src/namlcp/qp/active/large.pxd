from namlcp.qp.active.dense cimport DenseActiveSet

cdef enum:
    MOST_ROWS = 2

cdef void prepare(DenseActiveSet m) noexcept nogil
cdef Py_ssize_t violated_rows(DenseActiveSet m, double* values, Py_ssize_t* rows) noexcept nogil
cdef void make_all(DenseActiveSet m, const Py_ssize_t* rows, Py_ssize_t k, double* space) noexcept nogil
