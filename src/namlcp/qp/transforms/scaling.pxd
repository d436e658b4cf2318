cdef enum:
    ROUNDS = 10
    STEPS = 20

cdef double EQUAL, LEAST_FACTOR, MOST_FACTOR, REDUCTION, LARGEST, LEAST_DIVISOR

cpdef int equilibrate(const int[::1] indptr, const int[::1] indices, double[::1] data, double[::1] scale) except -1
cpdef int even_out(const int[::1] indptr, const int[::1] indices, const double[::1] data, double[::1] scale) except -1
