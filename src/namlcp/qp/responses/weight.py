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

import numpy as np

from namlcp.compiled import floats, part
from namlcp.qp.responses.matrices import row_of

# rho over that power of 16, if no other is asked for.
RHO = 1e-4
# The value of m.wanted without any weight.
NO_WEIGHT = -1.0
# Diagonal entry of P, over the largest one, up to which it counts as 0.
LEAST_SHAPE = 1e-36
LOG_16 = np.log(16.0)
# The curvature is between this number and its inverse.
LEAST_CURVATURE = 1e-100


@part
def set_shape(m):
    """Set m.shape, the diagonal of D; m.scale and m.reach: 1 / |D^-1/2 c| for all rows.

    m.largest is the largest diagonal entry of P.
    """
    n = m.n
    shape, scale, reach = floats(m.shape, n), floats(m.scale, m.rows), m.reach
    total, count = 0.0, 0
    for j in range(n):
        shape[j] = row_of(m.P, j, n)[j]
        if shape[j] > LEAST_SHAPE * m.largest:
            total += np.log(shape[j])
            count += 1
    mean = np.exp(total / max(count, 1))
    for j in range(n):
        if not shape[j] > LEAST_SHAPE * m.largest:
            shape[j] = mean
        scale[m.m + j] = np.sqrt(shape[j])
    for i in range(m.m):
        scale[i] = reach_of(row_of(m.G, i, n), shape)
    for i in range(m.p):
        floats(reach, m.p)[i] = reach_of(row_of(m.A, i, n), shape)


@part
def reach_of(row, shape):
    """Return 1 / |D^-1/2 c|, 1 for an empty row."""
    squares = 0.0
    for j in range(row.size):
        squares += row[j] * row[j] / shape[j]
    return 1.0 / np.sqrt(squares) if squares > 0.0 else 1.0


@part
def wanted_rho(m):
    """Return rho for the vectors at hand."""
    tau = typical_curvature(m)
    if m.largest > 0.0 or not tau > 0.0:
        tau = max(1.0, tau)
    tau = min(max(tau, LEAST_CURVATURE), 1.0 / LEAST_CURVATURE)
    factor = m.wanted if m.wanted > 0.0 else RHO
    return factor * 16.0 ** np.floor(np.log(tau) / LOG_16)


@part
def typical_curvature(m):
    """Return tau."""
    total, count, largest = 0.0, 0, 0.0
    q, h, b = floats(m.q, m.n), floats(m.h, m.m), floats(m.b, m.p)
    lb, ub, scale = floats(m.lb, m.n), floats(m.ub, m.n), floats(m.scale, m.rows)
    reach = floats(m.reach, m.p)
    for i in range(m.m):
        total, count = with_log(total, count, h[i] * scale[i])
    for i in range(m.p):
        total, count = with_log(total, count, b[i] * reach[i])
    for j in range(m.n):
        root = scale[m.m + j]
        total, count = with_log(total, count, lb[j] * root)
        total, count = with_log(total, count, ub[j] * root)
        largest = max(largest, abs(q[j]) / root)
    return largest / np.exp(total / max(count, 1))


@part
def with_log(total, count, side):
    """Return the sum and the number of logarithms with that of one distance more.

    Without it where that is 0, or the side means no constraint.
    """
    if 0.0 < abs(side) < np.inf:
        return total + np.log(abs(side)), count + 1
    return total, count
