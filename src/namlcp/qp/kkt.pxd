from namlcp.arrays cimport indices as longs, new_indices, new_places, new_vector
from namlcp.arrays cimport numbers, places, same_places
from namlcp.limits cimport Watched, is_over
from namlcp.linalg.blas cimport add_gram, blas_times, cholesky
from namlcp.linalg.csc cimport Columns, take_columns
from namlcp.linalg.dense cimport backward_solve, forward_solve
from namlcp.linalg.sparse_ldl cimport Factors
from namlcp.linalg.vectors cimport copy, fill

# The lines of a matrix: the rows of a dense one, of `width` numbers each (`starts` is NULL
# then), or the columns of one in CSC.
cdef struct Matrix:
    Py_ssize_t lines, width
    const double *values
    const int *starts
    const int *others

cdef double FULL, EQUAL, LEAST_FACTOR, MOST_FACTOR, LARGEST, STILL
cdef enum:
    BLOCK = 128  # rows that are condensed at a time
    ROUNDS = 10
    SWEEPS = 12

cdef class Condensed(Factors):
    cdef:
        # All variables, those of C; the sizes of C, of S and of the eliminated part, and
        # where these parts begin.
        Py_ssize_t variables, columns, rows, width, others, kept, gone
        double sign
        # Of each lone variable: its row, the place of c and c / d; the pattern of K~; S, R,
        # and D, ones for the part kept and 1 / d for lone variables; work space.
        const Py_ssize_t *row, *entry
        const int *indptr, *indices
        double *S, *R, *D, *y, *u, *slope
        tuple arrays

    cdef bint factor_values(self, double* data, Watched watch) noexcept nogil
    cdef void solve_into(self, double* rhs, double* x) noexcept nogil

cdef Py_ssize_t first_alone(object indptr, object indices, Py_ssize_t n) except -1
cdef int upper_triangle(object P, object A, object G, object starts, object rows, object values) except -1
cdef int hand_on(object problem, object y, object Z, object y_full, object z_full, object z_box) except -1
cdef tuple find_finite(object small, object units)
cpdef int equilibrate(object indptr, object indices, object data, object scale) except -1
cdef void equilibrate_parts(
    const Matrix* P, const Matrix* A, const Matrix* G, Py_ssize_t n, Py_ssize_t p, Py_ssize_t m,
    double* units, double* largest,
) noexcept nogil
cdef object take_matrix(Matrix* M, object array)
cdef void note_entries(const Matrix* M, const double* rows, const double* columns, double* of_rows, double* of_columns) noexcept nogil
cdef Py_ssize_t first_of(const Matrix* M, Py_ssize_t line) noexcept nogil
cdef (Py_ssize_t, Py_ssize_t) place_of(const Matrix* M, Py_ssize_t line, Py_ssize_t t) noexcept nogil
cpdef int even_out(const int[::1] indptr, const int[::1] indices, const double[::1] data, double[::1] scale, double[::1] logs) except -1
