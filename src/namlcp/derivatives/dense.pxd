from namlcp.arrays cimport indices, numbers, places, signs
from namlcp.linalg.blas cimport add_gram, cholesky, solve_rows
from namlcp.linalg.dense cimport add_times_transposed, backward_solve, forward_solve
from namlcp.linalg.dense cimport times_rows, triangle_solve, triangle_solve_transposed
from namlcp.linalg.vectors cimport add_scaled, dot, fill, largest_entry
from namlcp.measure cimport Terms, set_terms
from namlcp.qp.active.dense cimport DenseActiveSet
from namlcp.qp.active.engine cimport response_of

cdef double ACTIVE, LEAST_PIVOT, LEAST_DIVISOR
cdef enum:
    ARRAYS = 16
    SOLVES = 2

cdef class DenseItem:
    cdef:
        # The QP with its solution; gradients in x, y, z and z_box; those in the data.
        Terms qp
        const double *P, *G, *A, *of_x, *of_y, *of_z, *of_box
        double *u, *v, *lower, *upper
        # Sides of constraints; how many are weak.
        signed char *strict, *whole
        readonly Py_ssize_t weak
        # The rows of [G; A] that are held, the free variables, and their numbers.
        Py_ssize_t *held, *free
        Py_ssize_t held_n, free_n
        # L, V and the factor of S; right-hand sides for free variables and held rows.
        double *L, *V, *S, *t, *s
        # Work space; the array of all these.
        double *work
        object memory
        # The factors of the solve, if they serve.
        DenseActiveSet kept

cdef Py_ssize_t mark(const Terms* t, const double* share, const double* norms, const double* size, signed char* strict, signed char* whole) noexcept nogil
cdef void set_item(DenseItem m, double** start, const Py_ssize_t* step, Py_ssize_t i) noexcept nogil
cdef void set_gradients(DenseItem m, double* out) noexcept nogil
cdef void mark_item(DenseItem m) noexcept nogil
cdef bint serves(DenseActiveSet own, DenseItem m) noexcept nogil
cdef bint factor(DenseItem m) noexcept nogil
cdef bint has_factor(double* M, Py_ssize_t n) noexcept nogil
cdef const double* row_at(DenseItem m, Py_ssize_t k) noexcept nogil
cdef void solve_item(DenseItem m) noexcept nogil
cdef void set_remainder(DenseItem m, bint are_zero) noexcept nogil
cdef void correct(DenseItem m) noexcept nogil
cdef void correct_by_kept(DenseActiveSet own, DenseItem m) noexcept nogil
