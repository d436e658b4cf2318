from namlcp.linalg.sparse_ldl cimport Factors
from namlcp.watch cimport Watched

cdef double LEAST
cdef enum:
    # Columns of a panel eliminated at a time, columns of L in one product, columns of an
    # update that one product sets, multiplications up to which loops are faster to
    # eliminate columns.
    BLOCK = 32
    DEPTH = 256
    STRIP = 96
    SMALL = 6000

cdef struct Layout:
    Py_ssize_t number
    # Names as in `ordering.Supernodes`. Entry t of the layout goes to target[t] of the
    # panel; above[t] is the place of row rows[t] in the rows of the parent.
    const int *place, *first, *parent, *rows, *lower, *below
    const Py_ssize_t *starts, *panels
    int *above
    Py_ssize_t *target
    # The first child of a supernode, the next one of its parent, where its update is.
    int *child, *sibling
    Py_ssize_t *at
    # Updates; L D of the rows below; one row, one right-hand side.
    double *stack, *scaled, *w, *x

cdef struct Front:
    # k columns from `first` on, f rows, u of them below; where the panels begin; below
    # the square: the rows, their places in the parent.
    Py_ssize_t first, k, f, u, panel
    const int *rows, *above


cdef class Fronts(Factors):
    cdef:
        Layout t
        # One side if K is symmetric, otherwise L and U'. Entry t of the layout is
        # data[sources[side][t]].
        Py_ssize_t sides
        double *panels[2]
        const int *sources[2]
        double *D
        object arrays, values
        # Most entries of updates that wait at once.
        readonly Py_ssize_t stack
        readonly object pivots

    cdef void allocate(self)


cdef Py_ssize_t lay_out(Layout *t, Py_ssize_t sides, int *position, Py_ssize_t *held) noexcept nogil
cdef Front front_at(const Layout *t, Py_ssize_t s) noexcept nogil
cdef void open_panels(Fronts f, Py_ssize_t s, const double *data) noexcept nogil
cdef double *update_of(Fronts f, Py_ssize_t s, Py_ssize_t side) noexcept nogil
cdef void assemble(Fronts f, Py_ssize_t s, Py_ssize_t side) noexcept nogil
cdef void extend_add(Fronts f, Py_ssize_t c, Py_ssize_t side) noexcept nogil
cdef bint eliminate(Fronts f, Front v, Watched watch) noexcept nogil
cdef void solve_below(Front v, double *L, const double *U, const double *D, Py_ssize_t start, Py_ssize_t stop) noexcept nogil
cdef void update_columns(Front v, double *L, const double *U, const double *D, Py_ssize_t start, Py_ssize_t stop, double *scaled) noexcept nogil
cdef void complement(Fronts f, Py_ssize_t s, Py_ssize_t side, Watched watch) noexcept nogil
cdef void forward(Fronts f, const double *L, double *x) noexcept nogil
cdef void backward(Fronts f, const double *U, double *x) noexcept nogil
cdef void scale(const double *L, Py_ssize_t ld, const double *D, Py_ssize_t m, Py_ssize_t n, double *out) noexcept nogil
cdef void subtract(double *out, const double *L, Py_ssize_t ld, const double *w, Py_ssize_t k, Py_ssize_t m) noexcept nogil
cdef void subtract_product(Py_ssize_t m, Py_ssize_t n, Py_ssize_t k, const double *A, Py_ssize_t lda, const double *B, Py_ssize_t ldb, double beta, double *C, Py_ssize_t ldc) noexcept nogil
