from namlcp.derivatives.systems.marks cimport Solved

cdef double LEAST_PIVOT
cdef enum:
    SOLVES = 2

cdef struct Equations:
    # The right-hand sides (r, d, e) and the unknowns of
    # P u + G'lam + A'nu + rest = r,  G_I u = d_I,  A u = e.
    const double *r
    const double *d
    const double *e
    double *u
    double *lam
    double *nu
    double *rest

cdef class CholeskySystem:
    cdef:
        # The matrices, row by row; not owned.
        const double *P
        const double *G
        const double *A
        # Sizes; the numbers of equations and rows held and of free variables, and which.
        Py_ssize_t n, m, p, held_p, held_m, free_n
        Py_ssize_t *equalities
        Py_ssize_t *rows
        Py_ssize_t *free
        # L, V, the factor of S; work space.
        double *L
        double *V
        double *S
        double *t
        double *s
        char *memory
        object matrices

cdef void hold_strict(CholeskySystem m, const Solved* qp, const signed char* strict) noexcept nogil
cdef bint factor_held(CholeskySystem m) noexcept nogil
cdef bint has_factor(double* M, Py_ssize_t n, double* diagonal) noexcept nogil
cdef void set_remainder(CholeskySystem m, const Equations* eq) noexcept nogil
cdef void solve_held(CholeskySystem m, const Equations* eq) noexcept nogil
cdef int copy_indices(object array, Py_ssize_t* out) except -1
cdef int set_equations(CholeskySystem m, tuple vectors, Equations* eq) except -1
