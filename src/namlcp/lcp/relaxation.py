"""Sweeps of projected SOR and Gauss-Seidel, for `psor` and multigrid.

Callers have checked that every diagonal entry is stored and positive. The one term of
a row that depends on the row before is added last: the chain of these limits the speed.
"""

import cython
from cython.cimports.libc.math import sqrt
from cython.cimports.namlcp.box import clip
from cython.cimports.namlcp.linalg.arrays import numbers, places


def relax_csr(indptr, indices, data, q, lower, upper, alpha, z):
    """Overwrite z by one projected SOR sweep; return || D^(1/2) (z+ - z) ||_2.

    z_i <- clip(z_i - alpha (A z + q)_i / a_ii, l_i, u_i) with the newest values of z
    (Cryer 1971). z must lie in [lower, upper]; A is sorted CSR without duplicates. The
    returned number, D = diag(A), is about as large as Res of the problem scaled to a
    unit diagonal, but no bound for it.
    """
    n: cython.Py_ssize_t = z.size
    row, column = places(indptr, n + 1), places(indices, data.size)
    entry, x = numbers(data, data.size), numbers(z, n)
    c, l, u = numbers(q, n), numbers(lower, n), numbers(upper, n)
    total = 0.0
    last = 0.0  # z of the row above
    k: cython.Py_ssize_t = 0
    with cython.nogil:
        for i in range(n):
            end = row[i + 1]
            above = i - 1
            xi = x[i]
            r = c[i]  # becomes (A z + q)_i without the term of z_{i-1}
            neighbour = 0.0  # a_{i, i-1}
            while column[k] < above:
                r += entry[k] * x[column[k]]
                k += 1
            if column[k] == above:
                neighbour = entry[k]
                k += 1
            a = entry[k]  # a_ii
            while k < end:
                r += entry[k] * x[column[k]]
                k += 1
            step = alpha / a
            last = clip((xi - r * step) - (neighbour * step) * last, l[i], u[i])
            x[i] = last
            total += a * (last - xi) * (last - xi)
    return sqrt(total)


def relax_back(indptr, indices, data, q, lower, upper, z):
    """Do what `relax_csr` does, alpha = 1, from the last row up; return nothing."""
    n: cython.Py_ssize_t = z.size
    row, column = places(indptr, n + 1), places(indices, data.size)
    entry, x = numbers(data, data.size), numbers(z, n)
    c, l, u = numbers(q, n), numbers(lower, n), numbers(upper, n)
    last = 0.0  # z of the row below
    k: cython.Py_ssize_t = row[n]
    with cython.nogil:
        for after in range(n, 0, -1):
            i = after - 1
            start = row[i]
            r = c[i]
            neighbour = 0.0  # a_{i, i+1}
            a = 0.0  # the entry just read; a_ii after the first loop
            while k > start:
                k -= 1
                j = column[k]
                a = entry[k]
                if j <= after:
                    if j == after:
                        neighbour = a
                        k -= 1
                        a = entry[k]
                    break
                r += a * x[j]
            while k > start:
                k -= 1
                r += entry[k] * x[column[k]]
            last = clip((-r - neighbour * last) / a, l[i], u[i])
            x[i] = last
    return 0
