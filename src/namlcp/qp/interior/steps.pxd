from namlcp.qp.interior.state cimport Interior

cdef double THIN, MOST_LEFT, LENGTHENED, LEAST_PRODUCT, MOST_PRODUCT, SHORT, FULL
cdef double NEGLIGIBLE, START_VALUE

cdef void multiply(Interior m, const double* x, const double* v, double* Px, double* Ctv, double* t) noexcept nogil
cdef void evaluate(Interior m) noexcept nogil
cdef void assemble(Interior m) noexcept nogil
cdef void set_right_side(Interior m) noexcept nogil
cdef void set_step(Interior m) noexcept nogil
cdef void aim_at_centre(Interior m) noexcept nogil
cdef void aim_at_longer_step(Interior m) noexcept nogil
cdef void move(Interior m) noexcept nogil
cdef void prepare_start(Interior m) noexcept nogil
cdef void start_inside(Interior m) noexcept nogil
