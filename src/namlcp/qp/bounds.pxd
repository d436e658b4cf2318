cpdef tuple on_bounds(const double[::1] z, const double[::1] w, const double[::1] lower, const double[::1] upper)
cpdef bint is_box_open(const double[::1] lower, const double[::1] upper)
