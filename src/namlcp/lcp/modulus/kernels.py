"""Compiled sweeps: one pass over the rows of A for every triangular method.

Box LCP in modulus form (Bai 2010, r = 2; A = D - L - U, z = clip(s, l, u)):

    A z + q + Omega (s - z) = 0

Every method of `sweeps.METHODS` is, with ds = s+ - s, dz = z+ - z, the increment form

    (P - G L) ds - H L dz = -2 (A z + q - w),    w = Omega (z - s),

with P = D/alpha + Omega + shift and two numbers G, H; `sweeps` derives them. The right
side holds A z of the *old* iterate, so the pass that makes s+ also gives Res(z).

A kernel reads row i once. The terms of z go to a sum that needs no new value; the only
term that must wait for row i - 1 (its change is in a register) is added last, because
the chain of those waits bounds a Gauss-Seidel sweep more than memory does. Bounds are
applied by selection, not by branches: while the active set still moves, a branch is
guessed wrong every other row and the sweep takes two and a half times as long. Indices
are cast to unsigned where they address, so that no negative index is looked for. NaN
passes the comparisons and reaches the residual; infinite bounds are compared, never
subtracted. Rows have a diagonal entry; every caller has checked that it is positive.
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.lcp.relaxation import FUSED, ONE, clip


@kernel(fastmath=FUSED)
def sweep_csr(
    data,
    indices,
    indptr,
    q,
    lower,
    upper,
    omega,
    inverse,
    G,
    H,
    s,
    z,
    s_next,
    z_next,
    change,
):
    """Write the sweep's s+ and z+ = clip(s+) and return Res(z), z = clip(s).

    Parameters
    ----------
    data, indices, indptr : arrays
        A (n, n) in CSR, column indices ascending and unique in each row.
    q, omega : (n,) array
        Problem and diagonal of Omega.
    lower, upper : (n,) array
        Bounds; both empty for 0 and inf, which need not be read.
    inverse : (n,) array
        1 / P.
    G, H : float
        Weights of ds and of dz in the terms left of the diagonal.
    s, z : (n,) array
        Old iterate, z = clip(s, lower, upper).
    s_next, z_next : (n,) array
        New iterate on return; must not overlap s and z.
    change : (n,) array
        Work; no meaning on return.
    """
    total = 0.0
    boxed = lower.size > 0
    l = 0.0
    u = np.inf
    last = 0.0  # G ds + H dz of the row above
    k = np.uintp(0)
    for i in range(s.size):
        end = np.uintp(indptr[i + 1])
        above = i - 1
        if boxed:
            l = lower[i]
            u = upper[i]
        zi = z[i]
        si = s[i]
        r = q[i]  # becomes (A z + q)_i
        known = 0.0  # terms of the changes of the rows before i - 1
        neighbour = 0.0  # a_{i, i-1}
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
    return np.sqrt(total)


@kernel
def sweep_dense(A, q, lower, upper, omega, inverse, G, H, s, z, s_next, z_next, change):
    """Do what `sweep_csr` does with a row-major (n, n) array A.

    Both inner products of a row are BLAS calls while the row is in cache.
    """
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
