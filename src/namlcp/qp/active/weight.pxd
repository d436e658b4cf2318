from namlcp.qp.active.engine cimport ActiveSet

cdef double RHO, NO_WEIGHT, LEAST_SHAPE

cdef struct Logarithms:
    double total
    Py_ssize_t count

cdef void set_shape(ActiveSet m) noexcept nogil
cdef double wanted_rho(ActiveSet m) noexcept nogil
cdef double typical_curvature(ActiveSet m) noexcept nogil
cdef void add_log(Logarithms* sum, double side) noexcept nogil
