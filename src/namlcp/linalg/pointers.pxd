"""Where the entries of NumPy arrays begin; whoever asks keeps the arrays alive.

An array of another type or layout is refused: TypeError or ValueError.
"""

cdef inline double* floats_of(double[::1] array) noexcept:
    return &array[0] if array.shape[0] > 0 else NULL


cdef inline const double* const_floats_of(const double[::1] array) noexcept:
    return &array[0] if array.shape[0] > 0 else NULL


cdef inline const int* ints_of(const int[::1] array) noexcept:
    return &array[0] if array.shape[0] > 0 else NULL


cdef inline const Py_ssize_t* longs_of(const Py_ssize_t[::1] array) noexcept:
    return &array[0] if array.shape[0] > 0 else NULL
