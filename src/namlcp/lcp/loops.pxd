from namlcp.arrays cimport numbers, places
from namlcp.box cimport clip, deviation
from namlcp.linalg.blas cimport blas_dot
from namlcp.linalg.vectors cimport dot

cdef double INFINITE

# Most unknowns of a dense LCP that is small: its products are our own loops, and "auto"
# begins with pivoting, whatever A is.
cpdef enum:
    MOST_SMALL = 100

# Of `relax_coloured`: stages, and rows that the first one passes at a time.
cdef enum:
    STAGES = 4
    BLOCK = 256

# Of the triangular methods: rows of `vectors`, and of an iterate.
cpdef enum:
    OMEGA
    INVERSE
    Q
    CHANGE
    LOWER
    UPPER

cpdef enum:
    S
    Z

cpdef bint is_ordinary(object q, object lower, object upper) except -1
cdef bint are_ordinary(const double* q, const double* lower, const double* upper, Py_ssize_t n) noexcept nogil
cpdef object affine(object A, object z, object q)
cdef void affine_at(const double* A, const double* z, const double* q, double* w, Py_ssize_t n) noexcept nogil
cpdef void row_sums(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] x, double roundoff, double least, double[::1] own, double[::1] others, double[::1] margin) noexcept
cpdef double relax(object indptr, object indices, object data, object q, object lower, object upper, double alpha, object z, Py_ssize_t way) except? -1
cpdef bint two_colours(const int[::1] indptr, const int[::1] indices, unsigned char[::1] second) noexcept
cpdef tuple relax_coloured(object indptr, object indices, object data, object q, object lower, object upper, double alpha, object z, const unsigned char[::1] second)
cdef double relax_row(Py_ssize_t i, const int* row, const int* column, const double* entry, const double* c, const double* l, const double* u, double alpha, double* x) noexcept nogil
cpdef double sweep_csr(object indptr, object indices, object data, object vectors, double G, double H, object old, object new) except? -1
cpdef double sweep_dense(const double[:, ::1] A, double[:, ::1] vectors, double G, double H, const double[:, ::1] old, double[:, ::1] new) noexcept
