from namlcp.linalg.csc cimport Columns

cdef double VANISHED

cdef Columns rows_of(object M, Py_ssize_t n) except *
cpdef void residual_vector(object matrix, const double[::1] q, const double[::1] z, double[::1] w)
cpdef Py_ssize_t mark_free(const double[::1] d, const double[::1] z, const double[::1] lower, const double[::1] upper, double[::1] dinv) noexcept
cpdef void descend(object matrix, const int[::1] diagonal, object interpolation, const double[::1] dinv, const double[::1] b, double[::1] x, double[::1] coarse)
cpdef double ascend(object matrix, const int[::1] diagonal, object interpolation, const double[::1] dinv, const double[::1] b, const double[::1] coarse, double[::1] x) except? -1
cpdef void mark_dirty(object matrix, const double[::1] dinv, const unsigned char[::1] touched, unsigned char[::1] dirty)
cpdef void truncate_coarse(object face, object P_rows, object R_rows, const int[::1] C, object coarse_rows, const double[::1] d, object below)
cpdef double next_direction(object matrix, const double[::1] dinv, double beta, const double[::1] y, double[::1] p, double[::1] Ap) except? -1
cpdef double step_along(double step, const double[::1] p, const double[::1] Ap, double[::1] x, double[::1] r) noexcept
cpdef tuple project_step(object matrix, const double[::1] z, const double[::1] w, const double[::1] lower, const double[::1] upper, double[::1] x, double[::1] Ax)
cpdef void move(double step, const double[::1] x, const double[::1] Ax, const double[::1] lower, const double[::1] upper, double[::1] z, double[::1] w) noexcept
