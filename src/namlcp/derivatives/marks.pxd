cdef double ACTIVE

cdef struct Solved:
    # A QP and its solution. Matrices are row by row; those of a sparse QP are elsewhere.
    Py_ssize_t n, m, p
    const double *P
    const double *q
    const double *G
    const double *h
    const double *A
    const double *lb
    const double *ub
    const double *x
    const double *y
    const double *z
    const double *z_box

cdef tuple sizes_of(Py_ssize_t n, Py_ssize_t m, Py_ssize_t p)
cdef int locate(tuple arrays, tuple sizes, Py_ssize_t count, double** start, Py_ssize_t* step) except -1
cdef void set_solved(Solved* qp, double** start, const Py_ssize_t* step, Py_ssize_t i) noexcept nogil
cdef Py_ssize_t mark_dense(const Solved* qp, double* work, signed char* strict, signed char* whole) noexcept nogil
cdef Py_ssize_t mark(const Solved* qp, const double* Gx, const double* share, const double* norms, const double* size, signed char* strict, signed char* whole) noexcept nogil
