from namlcp.arrays cimport numbers
from namlcp.linalg.vectors cimport fill, largest_entry
from namlcp.qp.kkt cimport Matrix, equilibrate_parts, first_of, place_of, take_matrix

cdef double VALUE_ROUNDING, RESIDUAL, RADIUS, EXACT_RESIDUAL, MARGIN, ROUNDED_VALUE, CANCELLED

# A QP for which something is claimed; three vectors of n + p + m numbers to work with; of
# a Farkas certificate its value, the sum of the moduli of the terms of that, and the
# 1-norm of the multipliers; the residuals of the certificate.
cdef struct Claim:
    Py_ssize_t n, m, p
    Matrix *P, *G, *A
    const double *q, *h, *b, *lb, *ub
    double tol
    double *units, *largest, *r
    double value, moduli, lam, primal, dual

cdef bint suffices(double worst, double most, double error, double margin, double moduli, bint cancels) noexcept nogil
cdef void weigh(Claim* c, const double* y, const double* z, const double* s, double* z_box) noexcept nogil
cdef void add_term(Claim* c, double side, double multiplier) noexcept nogil
cdef bint prove_infeasible(Claim* c, const double* x, double* y, double* z, double* z_box) noexcept nogil
cdef bint prove_unbounded(Claim* c, const double* x, const double* y, const double* z, double* d) noexcept nogil
cdef void scale(double factor, double* v, Py_ssize_t n) noexcept nogil
cdef double largest_in(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef (double, double) norms_per(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef void add_products(const Matrix* M, const double* d, double* out, double* sizes) noexcept nogil
cdef void add_transposed(const Matrix* M, const double* y, double* out) noexcept nogil
