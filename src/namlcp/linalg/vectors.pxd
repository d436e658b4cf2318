"""Loops over vectors; those that take the time of a dense solve are in C."""

cdef extern from "vectors.h" nogil:
    double dot(const double* a, const double* b, Py_ssize_t n) noexcept
    void four_dots(
        const double* row, const double* a, const double* b, const double* c,
        const double* d, Py_ssize_t n, double* out
    ) noexcept
    void add_scaled(double scale, const double* a, double* out, Py_ssize_t n) noexcept
    void add_four(
        double fa, const double* a, double fb, const double* b,
        double fc, const double* c, double fd, const double* d,
        double* out, Py_ssize_t n
    ) noexcept
    void subtract_sum(
        double fa, const double* a, double fb, const double* b,
        double fc, const double* c, double fd, const double* d,
        double* out, Py_ssize_t n
    ) noexcept


cdef inline void copy(const double* a, double* out, Py_ssize_t n) noexcept nogil:
    cdef Py_ssize_t i
    for i in range(n):
        out[i] = a[i]


cdef inline void fill(double* out, double value, Py_ssize_t n) noexcept nogil:
    cdef Py_ssize_t i
    for i in range(n):
        out[i] = value


cdef inline double largest_entry(const double* v, Py_ssize_t n) noexcept nogil:
    cdef Py_ssize_t i
    cdef double largest = 0.0
    for i in range(n):
        largest = max(largest, v[i] if v[i] >= 0.0 else -v[i])
    return largest


# Entries from which on a line of a sparse matrix without gaps is taken by vectors.
cdef enum:
    LONG_LINE = 16


cdef inline double times_line(
    double total, const double* values, const int* places, Py_ssize_t count,
    const double* x,
) noexcept nogil:
    """Return total plus the product of a line of a sparse matrix with x."""
    cdef Py_ssize_t t
    if count >= LONG_LINE and places[count - 1] - places[0] == count - 1:
        return total + dot(values, x + places[0], count)
    for t in range(count):
        total += values[t] * x[places[t]]
    return total


cdef inline double add_line(
    double total, const double* values, const int* places, Py_ssize_t count,
    const double* x, double scale, double* out,
) noexcept nogil:
    """Return what `times_line` does; add scale times the line to out."""
    cdef Py_ssize_t t
    if count >= LONG_LINE and places[count - 1] - places[0] == count - 1:
        add_scaled(scale, values, out + places[0], count)
        return total + dot(values, x + places[0], count)
    for t in range(count):
        out[places[t]] += values[t] * scale
        total += values[t] * x[places[t]]
    return total
