from namlcp.linalg.sparse_ldl cimport Factors
from namlcp.watch cimport Watched

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
    # Updates; a right-hand side; work space: a front of a vector, L D of the rows below.
    double *stack, *x, *w, *scaled

cdef struct Front:
    # k columns from `first` on, f rows, u of them below; those rows, their places in the
    # parent; the panels of L and U', the update.
    Py_ssize_t first, k, f, u
    const int *rows, *above
    double *panels[2]
    double *update


cdef class Fronts(Factors):
    cdef:
        Layout t
        # One side if K is symmetric, otherwise L and U'. Entry t of the layout is
        # data[sources[side][t]].
        Py_ssize_t sides
        double *panels[2]
        const int *sources[2]
        double *D
        const double *data
        object arrays, values
        # Entries of all updates that wait at once.
        readonly Py_ssize_t stack
        readonly object pivots

    cdef void allocate(self)


cdef void lay_out(Fronts f, int *position) noexcept nogil
cdef Py_ssize_t stack_updates(Fronts f, Py_ssize_t *held) noexcept nogil
cdef inline Front front_at(Fronts f, Py_ssize_t s) noexcept nogil
cdef bint factor_front(Fronts f, Py_ssize_t s, Watched watch) noexcept nogil
cdef void assemble(Fronts f, Py_ssize_t s, Py_ssize_t side) noexcept nogil
cdef bint eliminate(Fronts f, Front v, Watched watch) noexcept nogil
cdef void solve_below(int m, int n, const double *U, const double *D, double *L, int ld) noexcept nogil
cdef void complement(Fronts f, Py_ssize_t s, Py_ssize_t side, Watched watch) noexcept nogil
cdef void forward(Fronts f, Py_ssize_t s) noexcept nogil
cdef void backward(Fronts f, Py_ssize_t s) noexcept nogil
cdef void scale(const double *L, Py_ssize_t ld, const double *D, Py_ssize_t m, Py_ssize_t n, double *out) noexcept nogil
cdef void subtract(double *out, const double *L, Py_ssize_t ld, const double *w, Py_ssize_t k, Py_ssize_t m) noexcept nogil
cdef void subtract_product(int m, int n, int k, const double *A, const double *B, int ldb, double beta, double *C, int ldc) noexcept nogil
