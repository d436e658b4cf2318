"""When a certificate is accepted: the tests of `certificates`, whatever the matrices.

Certificates are those of value -1. `moduli` is the sum of the moduli of the terms of
the value, `margin` the absolute tolerance times the 1-norm of the multipliers (t lam in
`certificates`) or of the ray.
"""

import cython
import numpy as np
from cython.cimports.libc.math import fabs, isinf
from cython.cimports.namlcp.linalg.arrays import data_of

# The value of a certificate, before it is scaled to -1, must be below minus this times
# the sum of the moduli of its terms, far beyond the rounding errors of the sum.
VALUE_ROUNDING = 1e3 * 2.0**-52
# A certificate with a residual, relative to its largest entry, of at most RESIDUAL must
# exclude all x with |x|_1 up to RADIUS times max(1, |x|_1 of the current point). With a
# residual of at most EXACT_RESIDUAL, mere rounding, it need not, but must satisfy
# MARGIN and ROUNDED_VALUE.
RESIDUAL, RADIUS, EXACT_RESIDUAL = 1e-8, 1e3, 1e-12
# Largest margin of such a certificate.
MARGIN = 0.5
# Largest error of its value, as a part of it: a multiplier is as inexact as the
# relative residual says, and so is each term of the sum. (Of a ray also: as inexact as
# |M d| relative to |M| |d|.)
ROUNDED_VALUE = 1e-2
# Largest |M d|, relative to |M| |d| row by row, of such a ray.
CANCELLED = 1e-10


def is_clear(value, moduli):
    """Tell whether a value is negative beyond rounding; False for NaN."""
    return value < -VALUE_ROUNDING * moduli


def is_contradiction(worst, most, size, margin, moduli):
    """Tell whether multipliers pass as a Farkas certificate.

    worst: the largest residual; most: the largest multiplier; size: |x|_1.
    """
    error = RADIUS * max(1.0, size) * worst
    exact = is_exact(worst / most, moduli)
    return suffices(worst / most, error + margin, margin, exact)


def is_ray(worst, most, error, margin, moduli, left):
    """Tell whether a direction d passes as a ray.

    worst: the largest |M d|_i of P, A and G; most: that of d; error: the largest of
    each times the size of x, y and z, added; left: the largest |M d| over |M| |d|.
    """
    cancelled: cython.bint = left <= CANCELLED and left * moduli <= ROUNDED_VALUE
    exact = is_exact(worst / most, moduli) and cancelled
    return suffices(worst / most, RADIUS * error + margin, margin, exact)


def is_exact(relative, moduli):
    """Tell whether a residual is mere rounding, and has not made the value of -1."""
    return relative <= EXACT_RESIDUAL and relative * moduli <= ROUNDED_VALUE


def suffices(relative, error, margin, exact):
    """Tell whether a certificate with this relative residual is accepted.

    `error` must be at most 1 for the points within RADIUS; for an exact one `margin`,
    its part by the tolerance, must be small.
    """
    within: cython.bint = relative <= RESIDUAL and error <= 1.0
    return within or (exact and margin <= MARGIN)


def weigh(found, b, y, p, h, z, m, lb, ub, s, z_box, n):
    """Set z_box to -s = -(G'z + A'y) where a bound allows, and the numbers `found`.

    The value is b'y + h'z + lb'z_box^- + ub'z_box^+, NaN where a multiplier is.
    """
    found.value = found.moduli = found.lam = 0.0
    for i in range(p):
        add_term(found, b[i], y[i])
    for i in range(m):
        if z[i] != 0.0:
            add_term(found, h[i], z[i])
    for j in range(n):
        bound = ub[j] if s[j] < 0.0 else lb[j]
        z_box[j] = 0.0 if isinf(bound) else 0.0 - s[j]
        if z_box[j] != 0.0:
            add_term(found, bound, z_box[j])
        found.value += 0.0 * s[j]  # NaN where s is, for what max() may ignore


def add_term(found, side, multiplier):
    """Add side times multiplier to the value."""
    found.value += side * multiplier
    found.moduli += fabs(side * multiplier)
    found.lam += fabs(multiplier)


def farkas_numbers(sides, y, z, s):
    """Do `weigh` for sides = (b, h, lb, ub); return z_box and the numbers."""
    found: Farkas
    z_box = np.empty(s.size)
    b, h, lb, ub, y, z, s = (np.ascontiguousarray(v, float) for v in (*sides, y, z, s))
    weigh(
        cython.address(found), data_of(b), data_of(y), y.size, data_of(h), data_of(z),
        z.size, data_of(lb), data_of(ub), data_of(s), data_of(z_box), s.size,
    )  # fmt: skip
    return z_box, (found.value, found.moduli, found.lam)
