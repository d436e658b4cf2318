cdef enum:
    PASSES = 3

cpdef void gauss_seidel(const int[::1] indptr, const int[::1] indices, const double[::1] data, const double[::1] lb, const double[::1] ub, double tol, double left, double[::1] r, double[::1] x, double[::1] z_box) noexcept
cpdef bint propose(const double[::1] multiplier, const double[::1] side, const double[::1] largest, const unsigned char[::1] usable, bint any_sign, double gap, double dual_left, double[::1] new) noexcept
