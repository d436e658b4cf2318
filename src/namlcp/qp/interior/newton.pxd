from namlcp.linalg.vectors cimport add_line, add_scaled, copy, dot, fill, times_line
from namlcp.qp.interior.state cimport Interior, KRYLOV_STEPS

cdef double ABOVE_ATTAINED, FORGET, SMALL_RHS, GMRES_ABOVE, BREAKDOWN
cdef double RHO, DELTA, FLOOR, LOWEST, TOP, POOR, ACCURATE, ACCURATE_FULL
cdef double NEEDED, BEHIND
cdef double THIN, MOST_LEFT, LENGTHENED, LEAST_PRODUCT, MOST_PRODUCT, SHORT, FULL, LONG, GAIN
cdef double NEGLIGIBLE, START_VALUE
cdef enum:
    FACTORISATIONS = 3
    REFINEMENT_STEPS = 11
    WAIT = 3

cdef void multiply(Interior m, const double* x, const double* v, double* Px, double* Ctv, double* t) noexcept nogil
cdef void evaluate(Interior m) noexcept nogil
cdef void assemble(Interior m) noexcept nogil
cdef void set_step(Interior m) noexcept nogil
cdef void aim_at_centre(Interior m) noexcept nogil
cdef void aim_at_longer_step(Interior m) noexcept nogil
cdef void move(Interior m) noexcept nogil
cdef bint factor(Interior m) noexcept nogil
cdef double weighted_norm(const double* r, const double* weight, Py_ssize_t size) noexcept nogil
cdef double set_remainder(Interior m, const double* b, const double* u, double* r) noexcept nogil
cdef void solve(Interior m) noexcept nogil
cdef void accept(Interior m, double error) noexcept nogil
cdef void improve(Interior m) noexcept nogil
cdef bint step(Interior m) noexcept nogil
cdef bint predict(Interior m) noexcept nogil
cdef void find_step(Interior m) noexcept nogil
cdef bint start(Interior m) noexcept nogil
cdef void regularise(Interior m, double old_mu) noexcept nogil
cdef void lower(Interior m, bint rho, bint delta) noexcept nogil
cdef void strengthen(Interior m) noexcept nogil
