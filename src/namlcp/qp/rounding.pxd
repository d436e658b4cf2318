cdef enum:
    PASSES = 3

cdef int gauss_seidel(object P, object qp, object point, double[::1] r, double tol, double left) except -1
