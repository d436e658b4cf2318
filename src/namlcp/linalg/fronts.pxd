from namlcp.arrays cimport indices as longs, numbers, places
from namlcp.limits cimport OFTEN, Watched, is_over
from namlcp.linalg.sparse_ldl cimport Factors, LEAST
from namlcp.linalg.vectors cimport add_scaled, copy, dot, fill, four_dots, subtract_sum

cdef double WORTH
cdef enum:
    # Columns of a panel eliminated at a time, columns of an update that one product
    # sets, multiplications up to which loops are faster to eliminate columns.
    BLOCK = 32
    STRIP = 96
    SMALL = 6000

    # Threads at most; microseconds to wait for one before a look at the clock; parts of
    # the work, of which a piece has one at most; what is done.
    MOST_THREADS = 16
    PATIENCE = 50000
    PARTS = 3
    FACTOR = 0
    FORWARD = 1
    BACKWARD = 2

cdef extern from "pythread.h" nogil:
    ctypedef void *PyThread_type_lock
    long PyThread_start_new_thread(void (*work)(void *) noexcept nogil, void *argument)
    PyThread_type_lock PyThread_allocate_lock()
    void PyThread_free_lock(PyThread_type_lock lock)
    int PyThread_acquire_lock(PyThread_type_lock lock, int wait)
    int PyThread_acquire_lock_timed(PyThread_type_lock lock, long long microseconds, int is_interrupted)
    void PyThread_release_lock(PyThread_type_lock lock)

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
    # Piece p has the supernodes sequence[bounds[p] : bounds[p + 1]], ascending: those of
    # a subtree, the last piece all others.
    Py_ssize_t pieces
    const Py_ssize_t *bounds, *sequence
    # Updates; a right-hand side; what a piece adds to that of others, entry t to row
    # rows[t], for the last supernode of the piece.
    double *stack, *x, *passed

cdef struct Front:
    # k columns from `first` on, f rows, u of them below; those rows, their places in the
    # parent; the panels of L and U', the update, the part of `passed`.
    Py_ssize_t first, k, f, u
    const int *rows, *above
    double *panels[2]
    double *update, *passed

cdef struct Desk:
    # A thread: its factors and its watch, the lock that it releases at the end.
    Py_ssize_t number
    void *owner, *watch
    PyThread_type_lock done
    # Its work space: a front of a vector, L D of the rows below, a right-hand side, which
    # is 0 between pieces.
    double *w, *scaled, *z


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
        # What is done, the next piece to be taken, whether to stop; the first thread is
        # the one that asks.
        int work
        Py_ssize_t next
        bint failed
        PyThread_type_lock guard
        Desk desks[MOST_THREADS]
        object arrays, shared, values
        # Entries of all updates that wait at once.
        readonly Py_ssize_t stack, threads
        readonly object pivots

    cdef void allocate(self)
    cdef void share(self, object nodes, Py_ssize_t threads)


cdef void lay_out(Fronts f, int *position) noexcept nogil
cdef Py_ssize_t stack_updates(Fronts f, Py_ssize_t *held) noexcept nogil
cdef tuple pieces_of(const int[::1] parent, object work)
cdef inline Front front_at(Fronts f, Py_ssize_t s) noexcept nogil
cdef void do_tasks(Fronts f, int work, Watched watch) noexcept nogil
cdef void help_along(void *own) noexcept nogil
cdef void take_tasks(Fronts f, Watched watch, Desk *desk) noexcept nogil
cdef void do_piece(Fronts f, Py_ssize_t p, Watched watch, Desk *desk) noexcept nogil
cdef bint factor_front(Fronts f, Py_ssize_t s, Watched watch, Desk *desk) noexcept nogil
cdef bint stops(Watched watch, Desk *desk, double operations) noexcept nogil
cdef void assemble(Fronts f, Py_ssize_t s, Py_ssize_t side) noexcept nogil
cdef bint eliminate(Fronts f, Front v, Watched watch, Desk *desk) noexcept nogil
cdef void solve_below(int m, int n, const double *U, const double *D, double *L, int ld) noexcept nogil
cdef void forward(Fronts f, Py_ssize_t s, Py_ssize_t end, Desk *desk) noexcept nogil
cdef void subtract_below(const int *rows, Py_ssize_t u, const double *column, double factor, double *x, double *z, Py_ssize_t end) noexcept nogil
cdef void backward(Fronts f, Py_ssize_t s, Desk *desk) noexcept nogil
cdef void scale(const double *L, Py_ssize_t ld, const double *D, Py_ssize_t m, Py_ssize_t n, double *out) noexcept nogil
cdef void subtract(double *out, const double *L, Py_ssize_t ld, const double *w, Py_ssize_t k, Py_ssize_t m) noexcept nogil
cdef void subtract_product(int m, int n, int k, const double *A, const double *B, int ldb, double beta, double *C, int ldc) noexcept nogil
