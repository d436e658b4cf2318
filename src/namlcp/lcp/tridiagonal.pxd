from namlcp.arrays cimport numbers, signs
from namlcp.box cimport clip
from namlcp.linalg.vectors cimport copy, fill
from namlcp.measure cimport are_met

cdef double SIGN_ROUNDING, SAME_PIVOT

# Rows of a tridiagonal matrix: its diagonals, 1 / pivot, 1 / sqrt(a_ii).
cdef enum:
    BELOW
    DIAGONAL
    ABOVE
    INVERSE
    ROOT

# Faces at most.
cpdef enum:
    MOST_FACES = 50

# What `solve_face` returns. ROUNDED: every sign is right, but the residual is not.
cdef enum:
    SOLVED
    MORE
    STUCK
    ROUNDED

cdef class Faces:
    cdef:
        Py_ssize_t n
        const double *below
        const double *diagonal
        const double *above
        const double *inverse
        const double *root
        const double *q
        const double *lower
        const double *upper
        signed char *state
        double *z
        double *w
        double *coupling
        double *best_z
        double *best_w
        # Tolerances; scaled Res(clip(0)), wrong sign that is rounding, least scaled Res;
        # Res of the face, as given and scaled.
        double eps_abs, eps_rel, size, slack, least, plain, scaled
        bint inside

cpdef bint read_rows(const int[::1] indptr, const int[::1] indices, const double[::1] data, double[:, ::1] rows) noexcept
cdef Py_ssize_t eliminate(Faces m) noexcept nogil
cdef void clip_into_box(Faces m, double* z, double* w) noexcept nogil
cdef void set_residuals(Faces m, const double* z, const double* w) noexcept nogil
cdef int begin(Faces m) noexcept nogil
cdef int solve_face(Faces m) noexcept nogil
