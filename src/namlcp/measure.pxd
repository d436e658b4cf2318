from namlcp.arrays cimport data_of, new_vector, numbers
from namlcp.box cimport clip, deviation
from namlcp.linalg.blas cimport blas_dot
from namlcp.linalg.csc cimport Columns, columns_times, columns_times_transposed
from namlcp.linalg.csc cimport take_columns
from namlcp.linalg.vectors cimport fill

cdef struct Numbers:
    double primal
    double dual
    double gap
    double primal_size
    double dual_size
    double gap_size
    double objective

cdef struct Terms:
    # A QP, a point with multipliers, and the products of both.
    Py_ssize_t n, m, p
    const double *q
    const double *h
    const double *b
    const double *lb
    const double *ub
    const double *x
    const double *y
    const double *z
    const double *z_box
    double *Px
    double *Gx
    double *Ax
    double *Gtz
    double *Aty

cdef void measure(const Terms* t, Numbers* found) noexcept nogil
cdef double gap_by_products(const Terms* t) except? -1
cdef double finite_dot(const double* sides, const double* multipliers, double sign, Py_ssize_t n, double* finite, double* beside) noexcept nogil
cdef int set_terms(Terms* t, object qp, object point) except -1
cpdef tuple residuals_of_products(object qp, object point, tuple products)
cpdef tuple residuals_of_columns(object qp, object point)
cdef tuple in_order(const Terms* t)
cpdef double largest_ratio(object found, double eps_abs, double eps_rel) except? -1
cpdef double signed_gap(object qp, object point, object Px) except? -1
cpdef tuple on_bounds(object x, object z_box, object lb, object ub, bint moves)
cpdef double natural_squares(object z, object w, object lower, object upper) except? -1
cpdef tuple natural_residuals(object z, object w, object lower, object upper, object d)
cdef (double, double) both_residuals(const double* z, const double* w, const double* lower, const double* upper, const double* d, Py_ssize_t n) noexcept nogil
cpdef bint are_met(double eps_abs, double eps_rel, double size, double plain, double scaled) noexcept nogil
