from namlcp.arrays cimport indices as longs, new_indices, new_places, new_vector
from namlcp.arrays cimport numbers, places, same_places
from namlcp.linalg.csc cimport Columns, take_columns
from namlcp.linalg.vectors cimport fill
from namlcp.qp.kkt cimport Matrix, first_of, take_matrix

cdef enum:
    # Values of `Groups.number` for a row that is not wanted, and for an empty one.
    UNWANTED = -2
    EMPTY = -1
    FILL = 4
    SMALL = 1000
    SHORT = 2
    NO_ENTRY = -1
    SEVERAL = -2

cdef double FIXED, SAME, GOLDEN, PIVOT

cdef tuple split_columns(object lb, object ub)
cdef int group_rows(Py_ssize_t m, Py_ssize_t n, int* indptr, int* indices, double* data, int* number, double* ratio) except -1
cdef double multiple(const int* indices, const double* data, Py_ssize_t a, Py_ssize_t a_end, Py_ssize_t c, Py_ssize_t c_end) noexcept
cdef Py_ssize_t merge_rows(Py_ssize_t rows, const int* number, const double* ratio, const double* sides, bint equal, double tol, object ends, object givers) except -2
cdef int find_free_columns(object qp, object choice, object parts) except -1
cdef Py_ssize_t only_entry(const Columns* C, Py_ssize_t j) noexcept nogil
cdef int drop_filling_rows(const Columns* A, Py_ssize_t n, Py_ssize_t rows, int* chosen, const double* cost) except -1
