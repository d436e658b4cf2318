from namlcp.qp.transforms.scaling cimport Matrix

cdef double VALUE_ROUNDING, RESIDUAL, RADIUS, EXACT_RESIDUAL, MARGIN, ROUNDED_VALUE, CANCELLED

# Of a Farkas certificate: its value, the sum of the moduli of the terms of that, and the
# 1-norm of the multipliers.
cdef struct Farkas:
    double value, moduli, lam

# A QP for which something is claimed; three vectors of n + p + m numbers to work with; the
# residuals of the certificate.
cdef struct Claim:
    Py_ssize_t n, m, p
    Matrix *P, *G, *A
    const double *q, *h, *b, *lb, *ub
    double tol
    double *units, *largest, *r
    double primal, dual

cdef bint suffices(double worst, double most, double error, double margin, double moduli, bint cancels) noexcept nogil
cdef void weigh(Farkas* found, const Claim* c, const double* y, const double* z, const double* s, double* z_box) noexcept nogil
cdef void add_term(Farkas* found, double side, double multiplier) noexcept nogil
cdef bint prove_infeasible(Claim* c, const double* x, double* y, double* z, double* z_box) noexcept nogil
cdef bint prove_unbounded(Claim* c, const double* x, const double* y, const double* z, double* d) noexcept nogil
cdef void scale(double factor, double* v, Py_ssize_t n) noexcept nogil
cdef double sum_per(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef double largest_in(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef double largest_per(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef Py_ssize_t first_of(const Matrix* M, Py_ssize_t line) noexcept nogil
cdef (Py_ssize_t, Py_ssize_t) place_of(const Matrix* M, Py_ssize_t line, Py_ssize_t t) noexcept nogil
cdef void add_products(const Matrix* M, const double* d, double* out, double* sizes) noexcept nogil
cdef void add_transposed(const Matrix* M, const double* y, double* out) noexcept nogil
cdef object take_matrix(Matrix* M, object array)
