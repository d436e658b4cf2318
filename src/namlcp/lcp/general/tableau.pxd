from namlcp.arrays cimport indices, numbers
from namlcp.linalg.vectors cimport add_scaled

cdef double LEAST_PIVOT, TIE, TINY_TIE

# How `pivot_until` ends: after the pivots asked for, with the variable that it waits
# for, or with an entering variable that nothing limits.
cpdef enum:
    MORE
    DONE
    RAY

cdef class Tableau:
    cdef readonly object rows, basic, nonbasic, position
    cdef:
        Py_ssize_t n, width
        double *entry
        Py_ssize_t *in_row
        Py_ssize_t *in_column
        Py_ssize_t *place

cpdef void exchange(Tableau t, Py_ssize_t row, Py_ssize_t column) noexcept nogil
cdef double inverse_entry(Tableau t, Py_ssize_t row, Py_ssize_t j) noexcept nogil
cdef int order(double x, double y) noexcept nogil
cdef bint comes_before(Tableau t, Py_ssize_t i, Py_ssize_t k, Py_ssize_t column) noexcept nogil
cdef Py_ssize_t leaving_row(Tableau t, Py_ssize_t column, Py_ssize_t wanted, Py_ssize_t or_wanted) noexcept nogil
cpdef tuple pivot_until(Tableau t, Py_ssize_t entering, tuple last, Py_ssize_t most)
