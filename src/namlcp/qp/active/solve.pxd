from namlcp.limits cimport begin_watch, raise_kept
from namlcp.arrays cimport data_of, fits, is_bad, new_vector, stamp_of
from namlcp.linalg.vectors cimport copy, dot, fill
from namlcp.measure cimport Numbers
from namlcp.qp.active.dense cimport DenseActiveSet
from namlcp.qp.active.engine cimport ActiveSet, CONTRADICTION, DONE, LATE, SUMMED, UNBOUNDED
from namlcp.qp.active.engine cimport forget_rows, make_room
from namlcp.qp.active.rounds cimport NO_WEIGHT
from namlcp.qp.active.sparse cimport SparseActiveSet
from namlcp.qp.intake cimport is_side, rows_of
from namlcp.result_base cimport ResultBase, made

cpdef enum:
    MOST_ORDER = 500
    MOST_BOX = 50
    MOST_LINEAR = 90
    SPARSE_LINEAR = 50
    FEW_ENTRIES = 10_000
    FULL = 30
    TINY_ENTRIES = 6000
    MOST_LENGTH = 20_000
    BRIEF = 1000

cdef object SOLVED, DUAL, clock
cdef tuple OPEN_SIDES
cdef double FEW_OPERATIONS, PASSES, OF_COST, OF_ROWS, ACTIVE, MOST_ANEW

cdef Py_ssize_t filled(const double* values, Py_ssize_t count) noexcept nogil
cdef void take_settings(ActiveSet m, tuple settings, double start)
cdef int run(ActiveSet m) except -1
cdef object result_of(ActiveSet m, object kind, object problem, double start, double ready)
cdef Py_ssize_t height_of(object C, object d, Py_ssize_t n)
cpdef int attach(DenseActiveSet m, object P, object G, object A, bint is_single) except -1
cdef void set_effort(DenseActiveSet m) noexcept nogil
cdef object small_form(object C)
cdef object tiny_form(object C, Py_ssize_t n)
cdef void suggest_signs(ActiveSet m, const double* z, const double* z_box) noexcept
cdef bint suggest_point(DenseActiveSet m, object x0)
cdef bint is_met(double side, double value) noexcept
cdef bint suggest_solution(DenseActiveSet m, object point)
cpdef int solve(ActiveSet m, object vectors, tuple settings, double start) except -1
cdef bint is_vector(object value, Py_ssize_t size)
