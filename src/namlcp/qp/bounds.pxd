cpdef bint is_box_open(const double[::1] lower, const double[::1] upper)
