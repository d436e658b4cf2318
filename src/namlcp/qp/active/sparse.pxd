from namlcp.arrays cimport data_of, numbers, places
from namlcp.linalg.csc cimport Columns, columns_times_transposed, take_columns
from namlcp.linalg.sparse_ldl cimport SparseFactors
from namlcp.linalg.vectors cimport add_line, add_scaled, copy, fill, largest_entry
from namlcp.qp.active.engine cimport ActiveSet, STUCK, claim_place, forget_responses
from namlcp.qp.active.engine cimport lay_out_rows, make_room, reals
from namlcp.qp.active.rounds cimport is_fit, set_shape, solve_at_hand, wanted_rho


cdef class SparseActiveSet(ActiveSet):
    cdef:
        # The upper triangle of K, of order `size`, and the values of K~, with the arrays
        # of `kkt`; the rows of G and A, those of `matrices`.
        const int *indptr, *indices
        double *base, *data
        Columns G, A
        object kkt
        Py_ssize_t size
        SparseFactors factors
        # Passes of refinement of a solve with K; operations of making a response.
        Py_ssize_t passes
        double response_operations
        # Units of (x, y) in which K is equilibrated; the diagonal of P; a residual.
        double *unit, *cost, *rest

    cdef bint factor_and_try(self) except -1


cdef double SHIFT, REACHED, FIXED, MOST_OPERATIONS, ACCURATE, GAIN
cdef enum:
    MOST_PASSES = 4

cdef void solve_base(SparseActiveSet m, const double* rhs, double* values, Py_ssize_t passes) noexcept nogil
cdef void subtract_product(SparseActiveSet m, const double* u, double* r) noexcept nogil
cdef void times_both(const Columns* M, Py_ssize_t count, Py_ssize_t n, const double* x, double* Mx, const double* y, double* Mty) noexcept nogil
cdef bint is_quasi_definite(SparseActiveSet m) noexcept nogil
cdef void set_norms(SparseActiveSet m, const Columns* M, Py_ssize_t count, double* norm) noexcept nogil
