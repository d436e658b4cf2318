from namlcp.arrays cimport data_of, new_vector, numbers, places
from namlcp.limits cimport Watched, begin_watch
from namlcp.linalg.blas cimport cholesky, lu, lu_solve
from namlcp.linalg.dense cimport backward_solve, forward_solve
from namlcp.linalg.ordering cimport order_by_degree
from namlcp.linalg.vectors cimport copy, fill

cdef Py_ssize_t SMALL_ORDER
cdef double PSD_SLACK, JITTER, LEAST_PIVOT, PIVOT_FLOOR, CALL, DENSE_SPEED


cdef class Pivoting(Watched):
    cdef:
        # The columns of A, which is dense or has `entries` entries: n vectors of n
        # values, or indptr, indices and values. The scaled values.
        readonly Py_ssize_t n, entries
        readonly bint is_dense, symmetric
        const int *indptr
        const int *indices
        const double *values
        double *scaled
        # The user's bounds; the scaled problem, with the matrix D A D, D = diag(root).
        const double *low
        const double *high
        double *q
        double *lower
        double *upper
        double *root
        # The iterate z, w = A z + q, the proximal point, and the best z so far.
        double *own_z
        double *w
        double *centre
        double *best
        # Right-hand side and diagonal shift of the free system.
        double *own_rhs
        double shift
        # -1 at the lower bound, 1 at the upper one, 0 free; the same as the signs of z
        # and w ask for it; 1 where a_ii > 0, elsewhere d = 1; whether all are 1.
        int *side
        int *goal
        int *unit
        bint has_unit
        # The unknowns in elimination order, once that is known.
        int *sequence
        bint is_ordered
        # The free system: its `count` unknowns, their positions, -1 for others, between
        # two uses for all. It is factored by L D L' if is_sparse: the elimination tree,
        # the entries in each column of L; in `factor`, D, the columns' first entries,
        # values and rows. Otherwise `factor` is dense, with pivots of LU.
        int *order
        int *local
        Py_ssize_t count
        bint is_sparse
        int *parent
        int *counts
        int *pivots
        char *factor
        size_t factor_size
        double *dense
        double *D
        double *L
        Py_ssize_t *starts
        int *rows
        # Work space.
        double *y
        int *pattern
        int *flag
        # Tolerances; the proximal parameter; what counts as 0 in z and w (scaled).
        public double eps_abs, eps_rel
        readonly double rho
        double tolerance
        # Scaled Res at clip(0); that of the best z, and as the problem was given.
        readonly double size
        double best_residual, best_plain
        # Factorisations, so far and at most; proximal steps.
        public Py_ssize_t factorisations, most
        Py_ssize_t outer_steps
        # Fewest wrong signs so far; changes of states left until there must be fewer.
        Py_ssize_t fewest_wrong, patience
        # Given: `solve_free_system` is to be called; find out `convex`. Found: the
        # tolerance is met; A is semidefinite.
        public bint is_external, ask_convex, convex
        readonly bint solved
        # States or rho have changed; there is no memory for a factor.
        bint must_factor, is_short
        readonly object memory
        object given
        double *end

cdef double* reals(Pivoting m, Py_ssize_t count) noexcept nogil
cdef int* flags(Pivoting m, Py_ssize_t count) noexcept nogil
cdef int allocate(Pivoting m) except -1
cdef bint factor_free(Pivoting m, double shift) noexcept nogil
cdef void solve_free(Pivoting m) noexcept nogil
cdef void set_order(Pivoting m) noexcept nogil
cdef void plan(Pivoting m) noexcept nogil
cdef void gather(Pivoting m, double* out) noexcept nogil
cdef bint factor_dense(Pivoting m) noexcept nogil
cdef double analyse(Pivoting m) noexcept nogil
cdef double factor_sparse(Pivoting m) noexcept nogil
cdef void solve_sparse(Pivoting m, double* x) noexcept nogil
cdef bint is_definite(Pivoting m) noexcept nogil
