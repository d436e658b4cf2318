from namlcp.arrays cimport data_of, fits, hash_of, new_vector
from namlcp.lcp.loops cimport MOST_SMALL, affine_at, are_ordinary
from namlcp.lcp.pivoting.state cimport Pivoting, allocate, factor_free, is_definite
from namlcp.lcp.pivoting.state cimport solve_free
from namlcp.limits cimport look_at_clock, raise_kept
from namlcp.linalg.vectors cimport add_scaled, copy, fill, largest_entry
from namlcp.measure cimport are_met, both_residuals
from namlcp.result_base cimport LCPResultBase, made

# GO_ON is never returned by `pivot`. HALTED: no progress, w is not finite, or too many
# proximal steps. MOST: as many factorisations as allowed. RAY: there is a proof that
# there is no solution; from within, that there may be one.
cpdef enum Code:
    GO_ON
    DONE
    HALTED
    MOST
    LATE
    RAY

cdef enum:
    FIRST_SWEEPS = 30
    STILL_SWEEPS = 3
    BLOCK_STEPS = 3
    OUTER_STEPS = 200
    EARLY_STEPS = 20
    FEW = 64
    SOME = 4
    FACTORISATIONS = 100

cdef double SWEEP_RELAXATION, RHO, EXACT_RESIDUAL, START_MARGIN
cdef double SYMMETRY_ROUNDING
cdef object SOLVED

cpdef int pivot(Pivoting m) except -1
cdef int advance(Pivoting m) noexcept nogil
cdef int begin_pivoting(Pivoting m) noexcept nogil
cdef void scale_problem(Pivoting m) noexcept nogil
cdef void first_sweeps(Pivoting m) noexcept nogil
cdef void add_column(Pivoting m, Py_ssize_t j, double factor, double* out) noexcept nogil
cdef void write_w(Pivoting m, double* w) noexcept nogil
cdef int state_of(double s, double lower, double upper) noexcept nogil
cdef bint meets(Pivoting m, double margin) noexcept nogil
cdef bint record(Pivoting m) noexcept nogil
cdef void set_right_side(Pivoting m) noexcept nogil
cdef int use_solution(Pivoting m) noexcept nogil
cdef void clip_rounding(Pivoting m) noexcept nogil
cdef Py_ssize_t set_goals(Pivoting m) noexcept nogil
cdef void reset_patience(Pivoting m, double rho) noexcept nogil
cdef int end_outer_step(Pivoting m) noexcept nogil
cpdef object solve_small(object kind, double begun, object given, object A, object q, object lower, object upper, object start, object stamp)
cdef bint is_vector(object value, Py_ssize_t n)
cdef (double, double, double) sizes(const double* A, Py_ssize_t n) noexcept nogil
cdef const double* bound(object value, double default, double* out, Py_ssize_t n) noexcept
