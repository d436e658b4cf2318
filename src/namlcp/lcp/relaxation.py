"""Kernels of projected SOR and Gauss-Seidel, for `psor` and multigrid.

Callers have checked that every diagonal entry is stored and positive. Indices are cast
to unsigned, so that the compiled code has no test for negative ones.
"""

import numpy as np

from namlcp.compiled import kernel, part

ONE = np.uintp(1)

FUSED = {"contract"}
"""fastmath flag: a b + c may be a fused multiply-add; NaN and infinities are kept."""


@part
def clip(x, l, u):
    """Return x clipped to [l, u], NaN for NaN, without a branch."""
    x = l if x < l else x
    return u if x > u else x


@kernel(error_model="numpy", fastmath=FUSED)
def relax_csr(indptr, indices, data, q, lower, upper, alpha, z):
    """Overwrite z by one projected SOR sweep; return || D^(1/2) (z+ - z) ||_2.

    z_i <- clip(z_i - alpha (A z + q)_i / a_ii, l_i, u_i) with the newest values of z
    (Cryer 1971). z must lie in [lower, upper]; A is sorted CSR without duplicates. The
    returned number, D = diag(A), is about as large as Res of the problem scaled to a
    unit diagonal, but no bound for it.
    """
    total = 0.0
    last = 0.0  # z of the row above
    k = np.uintp(0)
    for i in range(z.size):
        end = np.uintp(indptr[i + 1])
        above = i - 1
        zi = z[i]
        r = q[i]  # becomes (A z + q)_i without the term of z_{i-1}
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
def relax_back(indptr, indices, data, q, lower, upper, z):
    """Do what `relax_csr` does, alpha = 1, from the last row up; return nothing."""
    last = 0.0  # z of the row below
    k = np.uintp(indptr[z.size])
    for t in range(z.size):
        i = z.size - 1 - t
        row = np.uintp(i)
        start = np.uintp(indptr[i])
        r = q[i]
        neighbour = 0.0  # a_{i, i+1}
        a = 0.0  # the entry just read; a_ii after the first loop
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
def dominance_csr(indptr, indices, data, root):
    """Return the largest row sums of |I - D^-1 A| and of |I - D^(-1/2) A D^(-1/2)|.

    Either bounds rho(|I - D^-1 A|); if one is below 1, A is an H+ matrix. A is in CSR,
    and root = sqrt(diag(A)) must be positive.
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
