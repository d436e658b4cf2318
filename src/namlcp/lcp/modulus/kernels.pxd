# Rows of `vectors`, and of an iterate.
cpdef enum:
    OMEGA
    INVERSE
    Q
    CHANGE
    LOWER
    UPPER

cpdef enum:
    S
    Z

cpdef double sweep_csr(object indptr, object indices, object data, object vectors, double G, double H, object old, object new) except? -1
cpdef double sweep_dense(const double[:, ::1] A, double[:, ::1] vectors, double G, double H, const double[:, ::1] old, double[:, ::1] new) noexcept
