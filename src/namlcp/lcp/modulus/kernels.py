"""Kernels of the triangular sweep methods: each makes one pass over the rows of A.

With A = D - L - U, ds = s+ - s and dz = z+ - z, every triangular method is, see
`sweeps`,

    (P - G L) ds - H L dz = -2 (A z + q - w),    w = Omega (z - s),

where P = D/alpha + Omega + E and G, H are two numbers. The right side needs A z of the
*old* iterate, so the pass that computes s+ also gives Res(z).

A kernel reads row i once. Terms that do not depend on row i - 1 are summed first; the
one that does is added last, because the chain of these dependences limits the speed of
a sweep more than memory does. Bounds are applied without branches: while the active set
still changes, branches would be mispredicted often. Indices are cast to unsigned, so
that the compiled code has no test for negative ones. NaN passes the comparisons and
reaches the residual; infinite bounds are compared, never subtracted. Callers have
checked that every diagonal entry is stored and positive.

A call with fifteen arrays would take as long as a sweep over a few hundred rows. All
vectors are therefore rows of two-dimensional arrays, numbered here.
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.lcp.relaxation import FUSED, ONE, clip

OMEGA, INVERSE, Q, CHANGE, LOWER, UPPER = range(6)
"""Rows of `vectors`: diagonals of Omega and P^-1, q, work space, and the bounds, which
`sweep_csr` does not need if they are 0 and inf."""

S, Z = range(2)
"""Rows of an iterate: s and z = clip(s, lower, upper)."""


@kernel(fastmath=FUSED)
def sweep_csr(indptr, indices, data, vectors, G, H, old, new):
    """Write the next iterate to `new` and return Res(z) of `old`, (2, n) arrays.

    A is sorted CSR without duplicates. `vectors` has the rows OMEGA to UPPER, or to
    CHANGE if the bounds are 0 and inf; row CHANGE is overwritten. `old` and `new` must
    not overlap.
    """
    s, z = old[S], old[Z]
    s_next, z_next = new[S], new[Z]
    omega, inverse = vectors[OMEGA], vectors[INVERSE]
    q, change = vectors[Q], vectors[CHANGE]
    boxed = vectors.shape[0] > LOWER
    lower, upper = (vectors[LOWER], vectors[UPPER]) if boxed else (q, q)
    total = 0.0
    l = 0.0
    u = np.inf
    last = 0.0  # G ds + H dz of the row above
    k = np.uintp(indptr[0])
    for row in range(s.size):
        i = np.uintp(row)
        end = np.uintp(indptr[i + ONE])
        above = row - 1
        if boxed:
            l = lower[i]
            u = upper[i]
        zi = z[i]
        si = s[i]
        r = q[i]  # becomes (A z + q)_i
        earlier = 0.0  # sum a_ij change_j over L without the row above
        neighbour = 0.0  # a_{i, i-1}
        j = np.int64(indices[k])
        while j < above:
            a = data[k]
            r += a * z[np.uintp(j)]
            earlier += a * change[np.uintp(j)]
            k += ONE
            j = np.int64(indices[k])
        if j == above:
            neighbour = data[k]
        while k < end:
            r += data[k] * z[np.uintp(indices[k])]
            k += ONE
        x = clip(zi - r, l, u)
        total += (zi - x) * (zi - x)
        inv = inverse[i]
        ds = (2.0 * (omega[i] * (zi - si) - r) - earlier) * inv
        x = (si + ds) - (neighbour * inv) * last
        s_next[i] = x
        y = clip(x, l, u)
        z_next[i] = y
        last = G * (x - si) + H * (y - zi)
        change[i] = last
    return np.sqrt(total)


@kernel
def sweep_dense(A, vectors, G, H, old, new):
    """Do what `sweep_csr` does with a row-major (n, n) array A and (6, n) vectors."""
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
        earlier = np.dot(A[i, :i], change[:i])
        ds = (2.0 * (omega[i] * (zi - s[i]) - r) - earlier) * inverse[i]
        x = s[i] + ds
        s_next[i] = x
        z_next[i] = clip(x, l, u)
        change[i] = G * ds + H * (z_next[i] - zi)
    return np.sqrt(total)
