from namlcp.derivatives.systems.cholesky cimport CholeskySystem, Equations
from namlcp.derivatives.systems.marks cimport Solved
from namlcp.qp.active.dense cimport DenseActiveSet

cdef enum:
    AT_ONCE = 2000
    ARRAYS = 16

cdef class DenseItem:
    cdef:
        # The QP with its solution; the gradients in x, z and y are the right-hand sides
        # of the equations, those in q, h, b and lb their unknowns; in z_box, in ub.
        Solved qp
        Equations equations
        const double *of_box
        double *upper
        # Sides of constraints, see `marks`; how many are weak.
        signed char *strict
        signed char *whole
        Py_ssize_t weak
        # Zeros; work space.
        double *zero
        double *work
        char *memory
        # The factors of the solve, as long as they serve; those that are made here.
        DenseActiveSet kept
        readonly CholeskySystem factors
        object arrays

cdef void set_cotangents(DenseItem m, double** start, const Py_ssize_t* step, Py_ssize_t i) noexcept nogil
cdef void set_gradients(DenseItem m, double* q, double* h, double* b, double* lb, double* ub) noexcept nogil
cdef CholeskySystem factors_of(DenseItem m)
cdef void solve_item(DenseItem m) noexcept nogil
cdef bint are_finite(DenseItem m) noexcept nogil
cdef bint is_finite(const double* v, Py_ssize_t n) noexcept nogil
cdef void complete(DenseItem m) noexcept nogil
cdef int write_matrices(DenseItem m, tuple matrices) except -1
