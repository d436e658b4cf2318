"""Compiled sweeps: one pass over the rows of A for every triangular method.

Box LCP in modulus form (Bai 2010, r = 2; A = D - L - U, z = clip(s, l, u)):

    A z + q + Omega (s - z) = 0

Every method of `sweeps.METHODS` is, with ds = s+ - s, dz = z+ - z, the increment form

    (P - G L) ds - H L dz = -2 (A z + q - w),    w = Omega (z - s),

with P = D/alpha + Omega + shift and two numbers G, H; `sweeps` derives them. The right
side holds A z of the *old* iterate, so the pass that makes s+ also gives Res(z).

A kernel reads row i once. The terms of z go to a sum that needs no new value; the only
term that must wait for row i - 1 (its change is in a register) is added last, because
the chain of those waits, not memory, bounds a Gauss-Seidel sweep. Indices are cast to
unsigned so that no negative index is looked for. NaN passes the comparisons and reaches
the residual; infinite bounds are compared, never subtracted.
"""

import numpy as np
from numba import njit

ONE = np.uintp(1)


@njit(cache=True, nogil=True)
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
    q, lower, upper, omega : (n,) array
        Problem and diagonal of Omega.
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
    last = 0.0  # G ds + H dz of the row above
    k = np.uintp(0)
    for i in range(s.size):
        row = np.uintp(i)
        end = np.uintp(indptr[i + 1])
        l = lower[i]
        u = upper[i]
        zi = z[i]
        inv = inverse[i]
        r = q[i]  # becomes (A z + q)_i
        known = 0.0  # terms of the changes of the rows before i - 1
        neighbour = 0.0  # a_{i, i-1}
        while k < end:
            j = np.uintp(indices[k])
            a = data[k]
            r += a * z[j]
            k += ONE
            if j + ONE >= row:
                if j < row:
                    neighbour = a
                break
            known += a * change[j]
        while k < end:
            r += data[k] * z[np.uintp(indices[k])]
            k += ONE
        x = zi - r
        if x < l:
            x = l
        elif x > u:
            x = u
        total += (zi - x) * (zi - x)
        ds = (2.0 * (omega[i] * (zi - s[i]) - r) - known) * inv
        ds -= (neighbour * inv) * last
        x = s[i] + ds
        s_next[i] = x
        if x < l:
            x = l
        elif x > u:
            x = u
        z_next[i] = x
        last = G * ds + H * (x - zi)
        change[i] = last
    return np.sqrt(total)


@njit(cache=True, nogil=True)
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
        x = zi - r
        if x < l:
            x = l
        elif x > u:
            x = u
        total += (zi - x) * (zi - x)
        known = np.dot(A[i, :i], change[:i])
        ds = (2.0 * (omega[i] * (zi - s[i]) - r) - known) * inverse[i]
        x = s[i] + ds
        s_next[i] = x
        if x < l:
            x = l
        elif x > u:
            x = u
        z_next[i] = x
        change[i] = G * ds + H * (x - zi)
    return np.sqrt(total)


@njit(cache=True, nogil=True, error_model="numpy")
def relax_csr(data, indices, indptr, q, lower, upper, alpha, z):
    """Overwrite z by one projected SOR sweep; return || D (z+ - z) ||_2, D = diag(A).

    z_i <- clip(z_i - alpha (A z + q)_i / a_ii, l_i, u_i) with the newest values of z
    (Cryer 1971). Without s and Res it needs two thirds of the time of `sweep_csr`; the
    number returned is of the size of Res but not a bound for it.

    Parameters
    ----------
    data, indices, indptr : arrays
        A (n, n) in CSR, column indices ascending and unique in each row, every
        diagonal entry stored and positive.
    q, lower, upper : (n,) array
        Problem.
    alpha : float
        Relaxation.
    z : (n,) array
        Iterate in [lower, upper], old on entry, new on return.
    """
    total = 0.0
    last = 0.0  # z of the row above
    k = np.uintp(0)
    for i in range(z.size):
        row = np.uintp(i)
        end = np.uintp(indptr[i + 1])
        zi = z[i]
        r = q[i]
        neighbour = 0.0  # a_{i, i-1}
        a = 0.0  # a_ii when the first loop is left
        while k < end:
            j = np.uintp(indices[k])
            a = data[k]
            k += ONE
            if j + ONE >= row:
                if j < row:
                    neighbour = a
                    a = data[k]
                    k += ONE
                break
            r += a * z[j]
        while k < end:
            r += data[k] * z[np.uintp(indices[k])]
            k += ONE
        step = alpha / a
        last = (zi - (r + a * zi) * step) - (neighbour * step) * last
        if last < lower[i]:
            last = lower[i]
        elif last > upper[i]:
            last = upper[i]
        z[i] = last
        total += (a * (last - zi)) * (a * (last - zi))
    return np.sqrt(total)


@njit(cache=True, nogil=True)
def dominance_csr(data, indices, indptr):
    """Return max_i sum_{j != i} |a_ij| / a_ii, inf where an a_ii is not positive.

    Below 1, A is strictly dominant, an H+ matrix, and the number bounds
    rho(|I - D^-1 A|).
    """
    worst = 0.0
    k = np.uintp(0)
    for i in range(indptr.size - 1):
        row = np.uintp(i)
        end = np.uintp(indptr[i + 1])
        d = 0.0
        off = 0.0
        while k < end:
            if np.uintp(indices[k]) == row:
                d = data[k]
            else:
                off += abs(data[k])
            k += ONE
        if not d > 0.0:
            return np.inf
        worst = max(worst, off / d)
    return worst
