"""The weights W = rho D of the proximal term of `proximal`, chosen from the data.

D is the diagonal of P, with the geometric mean of its positive entries in place of the
others, and rho a multiple of

    max(1, tau),   tau = max |q_j| / sqrt(D_j)  over  mean |d_i| / |D^-1/2 c_i|:

in variables scaled by sqrt(D), the largest slope over the geometric mean of the
distances of all planes c_i x = d_i from 0, that is the curvature which has its minimum
about as far away as they are. With P = 0 that is tau alone. A power of 16 in its place
lets rho be the same for most QPs with the same matrices. Norms of rows and sizes of x
are those in the scaled variables, too.
"""

import cython
from cython import double
from cython.cimports.libc.math import INFINITY, exp, fabs, floor, log, sqrt

# rho over that power of 16, if no other is asked for; the value of m.wanted without any
# weight.
RHO, NO_WEIGHT = 1e-4, -1.0
# Diagonal entry of P, over the largest one, up to which it counts as 0.
LEAST_SHAPE = 1e-36
# The curvature is between this number and its inverse.
LEAST_CURVATURE = cython.declare(double, 1e-100)


def set_shape(m):
    """Make m.shape, the diagonal of P in it, that of D; set the norms of x.

    m.largest is the largest diagonal entry of P.
    """
    total, count = 0.0, 0
    for j in range(m.n):
        if m.shape[j] > LEAST_SHAPE * m.largest:
            total += log(m.shape[j])
            count += 1
    mean = exp(total / max(count, 1))
    for j in range(m.n):
        if not m.shape[j] > LEAST_SHAPE * m.largest:
            m.shape[j] = mean
        m.scale[m.m + j] = sqrt(m.shape[j])


def wanted_rho(m):
    """Return rho for the vectors at hand."""
    tau = typical_curvature(m)
    if m.largest > 0.0 or not tau > 0.0:
        tau = max(1.0, tau)
    tau = min(max(tau, LEAST_CURVATURE), 1.0 / LEAST_CURVATURE)
    factor = m.wanted if m.wanted > 0.0 else RHO
    return factor * 16.0 ** floor(log(tau) / log(16.0))


def typical_curvature(m):
    """Return tau."""
    sum: Logarithms
    largest = 0.0
    sum.total, sum.count = 0.0, 0
    for i in range(m.m):
        add_log(cython.address(sum), m.h[i] * m.scale[i])
    for i in range(m.p):
        add_log(cython.address(sum), m.b[i] * m.reach[i])
    for j in range(m.n):
        root = m.scale[m.m + j]
        add_log(cython.address(sum), m.lb[j] * root)
        add_log(cython.address(sum), m.ub[j] * root)
        largest = max(largest, fabs(m.q[j]) / root)
    return largest / exp(sum.total / max(sum.count, 1))


def add_log(sum, side):
    """Add the logarithm of one distance, unless it is 0 or means no constraint."""
    if 0.0 < fabs(side) < INFINITY:
        sum.total += log(fabs(side))
        sum.count += 1
