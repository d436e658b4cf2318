"""Compiled sweeps: one pass over the rows of A for every triangular method.

Box LCP in modulus form (the fixed points of the paper's equations (2) and (3), r = 2,
with bounds in place of z >= 0; A = D - L - U, z = clip(s, l, u)):

    A z + q + Omega (s - z) = 0

Every method of `methods.METHODS` is, with ds = s+ - s, dz = z+ - z, the increment form

    (P - G L) ds - H L dz = -2 (A z + q - w),    w = Omega (z - s),

with P = D/alpha + Omega + E and two numbers G, H; `sweeps` derives them. The right side
holds A z of the *old* iterate, so the pass that makes s+ also gives Res(z).

A kernel reads row i once. The terms of z go to a sum that needs no new value; the only
term that must wait for row i - 1 (its change is in a register) is added last, because
the chain of those waits bounds a Gauss-Seidel sweep more than memory does. Bounds are
applied by selection, not by branches: while the active set still moves, a branch is
guessed wrong every other row and the sweep takes two and a half times as long. Indices
are cast to unsigned where they address, so that no negative index is looked for. NaN
passes the comparisons and reaches the residual; infinite bounds are compared, never
subtracted. Rows have a diagonal entry; every caller has checked that it is positive.

A sweep over a few hundred rows takes a few microseconds, as does a call with fifteen
arrays. So all vectors stand in two-dimensional arrays, their rows named here.
"""

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.lcp.relaxation import FUSED, ONE, clip

OMEGA, INVERSE, Q, CHANGE, LOWER, UPPER = range(6)
"""Rows of `vectors`: the diagonals of Omega and of P^-1, q, work, and the bounds, which
are left out where they are 0 and inf, as they need not be read then."""

S, Z = range(2)
"""Rows of an iterate: s, and z = clip(s, lower, upper)."""


@part(fastmath=FUSED)
def sweep_rows(A, vectors, G, H, old, new, colours, b):
    """Sweep the rows of block b, all rows where `colours` is None; return sum r_i^2.

    r = z - clip(z - w), w = A z + q, z the old iterate. Rows left of the diagonal are
    those of earlier colours, and earlier ones of the same block. `None` is a type: what
    only blocks need is not compiled for the natural order.
    """
    data, indices, indptr = A
    s, z = old[S], old[Z]
    s_next, z_next = new[S], new[Z]
    omega, inverse = vectors[OMEGA], vectors[INVERSE]
    q, change = vectors[Q], vectors[CHANGE]
    boxed = vectors.shape[0] > LOWER
    lower, upper = (vectors[LOWER], vectors[UPPER]) if boxed else (q, q)
    start, stop = 0, s.size
    if colours is not None:
        colour, shift = colours.colour, colours.shift
        own = colour[b]
        start, stop = b << shift, min((b + 1) << shift, s.size)
    total = 0.0
    l = 0.0
    u = np.inf
    last = 0.0  # G ds + H dz of the row above
    k = np.uintp(indptr[start])
    for row in range(start, stop):
        i = np.uintp(row)
        end = np.uintp(indptr[i + ONE])
        above = max(row - 1, start - 1)
        if boxed:
            l = lower[i]
            u = upper[i]
        zi = z[i]
        si = s[i]
        r = q[i]  # becomes (A z + q)_i
        known = 0.0  # terms of the changes of earlier rows, but for the one above
        neighbour = 0.0  # a_{i, i-1}, 0 in the first row of a block
        j = np.int64(indices[k])
        if colours is not None:
            while j < start:  # blocks before this one
                a = data[k]
                r += a * z[np.uintp(j)]
                if colour[j >> shift] < own:
                    known += a * change[np.uintp(j)]
                k += ONE
                j = np.int64(indices[k])
        while j < above:
            a = data[k]
            r += a * z[np.uintp(j)]
            known += a * change[np.uintp(j)]
            k += ONE
            j = np.int64(indices[k])
        if j == above:
            neighbour = data[k]
        while k < end:
            r += data[k] * z[np.uintp(indices[k])]
            k += ONE
        if colours is not None:
            back = end - ONE
            j = np.int64(indices[back])
            while j >= stop:  # blocks after this one
                if colour[j >> shift] < own:
                    known += data[back] * change[np.uintp(j)]
                back -= ONE
                j = np.int64(indices[back])
        x = clip(zi - r, l, u)
        total += (zi - x) * (zi - x)
        inv = inverse[i]
        ds = (2.0 * (omega[i] * (zi - si) - r) - known) * inv
        x = (si + ds) - (neighbour * inv) * last
        s_next[i] = x
        y = clip(x, l, u)
        z_next[i] = y
        last = G * (x - si) + H * (y - zi)
        change[i] = last
    return total


@kernel(fastmath=FUSED)
def sweep_csr(data, indices, indptr, vectors, G, H, old, new):
    """Write the next iterate and return Res(z) of the old one.

    Parameters
    ----------
    data, indices, indptr : arrays
        A (n, n) in CSR, column indices ascending and unique in each row.
    vectors : (6, n) or (4, n) array
        Rows as above.
    G, H : float
        Weights of ds and of dz in the terms left of the diagonal.
    old, new : (2, n) array
        Iterates; they must not overlap.
    """
    A = data, indices, indptr
    return np.sqrt(sweep_rows(A, vectors, G, H, old, new, None, 0))


@kernel
def sweep_dense(A, vectors, G, H, old, new):
    """Do what `sweep_csr` does with a row-major (n, n) array A and (6, n) vectors.

    Both inner products of a row are BLAS calls while the row is in cache.
    """
    s, z = old[S], old[Z]
    s_next, z_next = new[S], new[Z]
    omega, inverse = vectors[OMEGA], vectors[INVERSE]
    q, change = vectors[Q], vectors[CHANGE]
    lower, upper = vectors[LOWER], vectors[UPPER]
    total = 0.0
    for i in range(s.size):
        l = lower[i]
        u = upper[i]
        zi = z[i]
        r = q[i] + np.dot(A[i], z)
        x = clip(zi - r, l, u)
        total += (zi - x) * (zi - x)
        known = np.dot(A[i, :i], change[:i])
        ds = (2.0 * (omega[i] * (zi - s[i]) - r) - known) * inverse[i]
        x = s[i] + ds
        s_next[i] = x
        z_next[i] = clip(x, l, u)
        change[i] = G * ds + H * (z_next[i] - zi)
    return np.sqrt(total)
