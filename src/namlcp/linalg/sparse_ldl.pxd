from namlcp.arrays cimport data_of, indices as longs_at, new_indices, new_places, new_vector, numbers, places
from namlcp.limits cimport Watched, is_over, raise_kept
from namlcp.linalg.ordering cimport append_rows

cdef double LEAST, LOOK_AFTER
cdef enum:
    SMALLEST_BLOCK = 16
    BEFORE_BLOCK = 20


cdef class Factors:
    # Order of K, entries of its triangle; entries of L.
    cdef readonly Py_ssize_t n, nnz, entries

    cdef bint factor_values(self, double* data, Watched watch) noexcept nogil
    cdef void solve_into(self, double* rhs, double* x) noexcept nogil


cdef class SparseFactors(Factors):
    cdef:
        # All but `place` are in the order of elimination. Row i of K becomes row
        # place[i]. The diagonal entry of row k is data[diagonal[k]], with `data` those of
        # K. Column k of the strict upper triangle has the entries data[source[t]] in
        # rows[t], for t in columns[k] : columns[k + 1].
        const int *place
        int *diagonal
        const int *columns, *rows, *source
        # Column i of L below the diagonal has values[p] in the rows below[p], ascending,
        # for p in starts[i] : starts[i + 1]; inverse[i] is 1 over its pivot. Row k has
        # entries in the chunks that begin with the columns chunks[t], ascending, for t in
        # lines[k] : lines[k + 1]. width[i] is 1 or 4, the number of columns of the
        # chunk, for its first and its last column i.
        Py_ssize_t *starts
        int *below
        Py_ssize_t *lines
        int *chunks, *width
        double *values, *inverse
        # The column with which the dense block that L ends with begins, n without one; a
        # column i is applied row by row to the first reach[i] rows below it: a single one
        # before the block to those before the block.
        Py_ssize_t first
        int *reach
        # Work space: done[i] counts the rows that are complete below the chunk that
        # begins with i; y is a row of K or a right-hand side.
        Py_ssize_t *done
        double *y
        # Multiplications of a factorisation.
        double work
        object arrays


cdef object as_array(double* values, Py_ssize_t size)
cdef void lay_out(SparseFactors f, const int* indptr, const int* parent, const int* counts) noexcept nogil
cdef void subtract_products(SparseFactors f) noexcept nogil
cdef inline double apply_one(SparseFactors f, Py_ssize_t i, Py_ssize_t rows) noexcept nogil
cdef double apply_four(SparseFactors f, Py_ssize_t i) noexcept nogil
cdef void solve_forward(SparseFactors f) noexcept nogil
cdef void solve_backward(SparseFactors f) noexcept nogil
