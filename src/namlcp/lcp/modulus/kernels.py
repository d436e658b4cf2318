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

from namlcp.compiled import kernel, part

ONE = np.uintp(1)

# a b + c may be rounded once, which shortens the chain; NaN and infinities keep their
# meaning.
FUSED = {"contract"}


@part
def clip(x, l, u):
    """Return x in [l, u], NaN for NaN, without a branch."""
    x = l if x < l else x
    return u if x > u else x


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


@kernel(error_model="numpy", fastmath=FUSED)
def relax_csr(data, indices, indptr, q, lower, upper, alpha, z):
    """Overwrite z by one projected SOR sweep; return || D^(1/2) (z+ - z) ||_2.

    z_i <- clip(z_i - alpha (A z + q)_i / a_ii, l_i, u_i) with the newest values of z
    (Cryer 1971). Without s and Res it needs two thirds of the time of `sweep_csr`; the
    number returned, D = diag(A), is of the size of Res of the problem scaled to a unit
    diagonal, but not a bound for it.

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
        end = np.uintp(indptr[i + 1])
        above = i - 1
        zi = z[i]
        r = q[i]  # becomes (A z + q)_i but for the row above
        neighbour = 0.0  # a_{i, i-1}
        j = np.int64(indices[k])
        while j < above:
            r += data[k] * z[np.uintp(j)]
            k += ONE
            j = np.int64(indices[k])
        if j == above:
            neighbour = data[k]
            k += ONE
        a = data[k]  # a_ii
        while k < end:
            r += data[k] * z[np.uintp(indices[k])]
            k += ONE
        step = alpha / a
        last = clip((zi - r * step) - (neighbour * step) * last, lower[i], upper[i])
        z[i] = last
        total += a * (last - zi) * (last - zi)
    return np.sqrt(total)


@kernel(error_model="numpy")
def relax_back(data, indices, indptr, q, lower, upper, z):
    """Overwrite z by one projected Gauss-Seidel sweep from the last row to the first.

    The mirror image of `relax_csr` with alpha = 1.
    """
    last = 0.0  # z of the row below
    k = np.uintp(indptr[z.size])
    for t in range(z.size):
        i = z.size - 1 - t
        row = np.uintp(i)
        start = np.uintp(indptr[i])
        r = q[i]
        neighbour = 0.0  # a_{i, i+1}
        a = 0.0  # a_ii when the first loop is left
        while k > start:
            k -= ONE
            j = np.uintp(indices[k])
            a = data[k]
            if j <= row + ONE:
                if j > row:
                    neighbour = a
                    k -= ONE
                    a = data[k]
                break
            r += a * z[j]
        while k > start:
            k -= ONE
            r += data[k] * z[np.uintp(indices[k])]
        last = (-r - neighbour * last) / a
        last = lower[i] if last < lower[i] else last
        last = upper[i] if last > upper[i] else last
        z[i] = last


@kernel
def dominance_csr(data, indices, indptr, root):
    """Return the largest row sums of |I - D^-1 A| and of |I - D^(-1/2) A D^(-1/2)|.

    Either bounds rho(|I - D^-1 A|); below 1, A is an H+ matrix.

    Parameters
    ----------
    data, indices, indptr : arrays
        A (n, n) in CSR.
    root : (n,) array
        sqrt(diag(A)), positive.
    """
    plain = 0.0
    scaled = 0.0
    k = np.uintp(0)
    for i in range(indptr.size - 1):
        row = np.uintp(i)
        end = np.uintp(indptr[i + 1])
        off = 0.0
        off_scaled = 0.0
        while k < end:
            j = np.uintp(indices[k])
            if j != row:
                off += abs(data[k])
                off_scaled += abs(data[k]) / root[j]
            k += ONE
        plain = max(plain, off / (root[i] * root[i]))
        scaled = max(scaled, off_scaled / root[i])
    return plain, scaled
