"""Arithmetic of bounds, inline; NaN stays NaN."""


cdef inline double clip(double x, double l, double u) noexcept nogil:
    """Return x clipped to [l, u], without a branch."""
    x = l if x < l else x
    return u if x > u else x


cdef inline double deviation(double z, double w, double lower, double upper) noexcept nogil:
    """Return z - clip(z - w, lower, upper), NaN if z or w is.

    z - w is not computed: a w far smaller than z would be lost by rounding, so that
    every large z would seem a solution where A is singular.
    """
    return max(min(w, z - lower), z - upper) + 0.0 * z
