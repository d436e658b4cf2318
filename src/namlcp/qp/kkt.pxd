cpdef int upper_triangle(object P, object A, object G, int[::1] indptr, int[::1] indices, double[::1] data) except -1
