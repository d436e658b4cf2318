"""The triangular sweep methods: each sweep is one pass over the rows of A.

A sweep adds ds to s so that, with the letters of `sweeps` and P = D/alpha + Omega + E,

    (P - G L) ds - H L dz = -2 (A z + q - w).

The right side needs A z of the *old* iterate, so the pass that computes s+ also gives
Res(z).

Row i is read once. Terms that do not depend on row i - 1 are summed first; the one that
does is added last, because the chain of these dependences limits the speed of a sweep
more than memory does. Bounds are applied without branches: while the active set still
changes, branches would be mispredicted often. NaN passes the comparisons and reaches
the residual; infinite bounds are compared, never subtracted. Callers have checked that
every diagonal entry is stored and positive.

All vectors are rows of two-dimensional arrays: `vectors` has the diagonals of Omega and
P^-1, q, work space, and the bounds; an iterate has s and z = clip(s, lower, upper).
"""

import cython
from cython.cimports.libc.math import sqrt
from cython.cimports.namlcp.box import clip
from cython.cimports.namlcp.linalg.arrays import numbers, places
from cython.cimports.namlcp.linalg.blas import blas_dot


def sweep_csr(indptr, indices, data, vectors, G, H, old, new):
    """Write the next iterate to `new` and return Res(z) of `old`, (2, n) arrays.

    A is sorted CSR without duplicates. `vectors` has the rows OMEGA to UPPER; row
    CHANGE is overwritten. `old` and `new` must not overlap.
    """
    n: cython.Py_ssize_t = old.shape[1]
    row, column = places(indptr, n + 1), places(indices, data.size)
    entry, first = numbers(data, data.size), numbers(vectors, 6 * n)
    s, s_next = numbers(old, 2 * n), numbers(new, 2 * n)
    z, z_next = s + n, s_next + n
    omega, inverse, q = first + OMEGA * n, first + INVERSE * n, first + Q * n
    change, lower, upper = first + CHANGE * n, first + LOWER * n, first + UPPER * n
    total = 0.0
    last = 0.0  # G ds + H dz of the row above
    k: cython.Py_ssize_t = row[0]
    with cython.nogil:
        for i in range(n):
            end = row[i + 1]
            above = i - 1
            l, u = lower[i], upper[i]
            zi, si = z[i], s[i]
            r = q[i]  # becomes (A z + q)_i
            earlier = 0.0  # sum a_ij change_j over L without the row above
            neighbour = 0.0  # a_{i, i-1}
            while column[k] < above:
                j, a = column[k], entry[k]
                r += a * z[j]
                earlier += a * change[j]
                k += 1
            if column[k] == above:
                neighbour = entry[k]
            while k < end:
                r += entry[k] * z[column[k]]
                k += 1
            x = clip(zi - r, l, u)
            total += (zi - x) * (zi - x)
            w = omega[i] * (zi - si)  # equal to r at a solution
            inv = inverse[i]
            ds = (2.0 * (w - r) - earlier) * inv
            x = (si + ds) - (neighbour * inv) * last
            s_next[i] = x
            y = clip(x, l, u)
            z_next[i] = y
            last = G * (x - si) + H * (y - zi)
            change[i] = last
    return sqrt(total)


def sweep_dense(A, vectors, G, H, old, new):
    """Do what `sweep_csr` does with a row-major (n, n) array A and (6, n) vectors."""
    n, total = old.shape[1], 0.0
    with cython.nogil:
        for i in range(n):
            l, u = vectors[LOWER, i], vectors[UPPER, i]
            zi, si = old[Z, i], old[S, i]
            row = cython.address(A[i, 0])
            r = vectors[Q, i] + blas_dot(row, cython.address(old[Z, 0]), n)
            away: cython.double = zi - clip(zi - r, l, u)
            total += away * away
            earlier = blas_dot(row, cython.address(vectors[CHANGE, 0]), i)
            w = vectors[OMEGA, i] * (zi - si)  # equal to r at a solution
            ds = (2.0 * (w - r) - earlier) * vectors[INVERSE, i]
            x = si + ds
            y = clip(x, l, u)
            new[S, i] = x
            new[Z, i] = y
            vectors[CHANGE, i] = G * ds + H * (y - zi)
    return sqrt(total)
