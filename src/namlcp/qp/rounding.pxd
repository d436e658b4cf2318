cdef enum:
    PASSES = 3

cdef int gauss_seidel(object P, object qp, object point, double[::1] r, double tol, double left) except -1
cpdef bint propose(const double[::1] multiplier, const double[::1] side, const double[::1] largest, const unsigned char[::1] usable, bint any_sign, double gap, double dual_left, double[::1] new) noexcept
