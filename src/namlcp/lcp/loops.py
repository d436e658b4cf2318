"""Loops over the data of an LCP, each one pass."""

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY, fabs, sqrt

from namlcp import checks

INFINITE = checks.INFINITE


def is_ordinary(q, lower, upper):
    n: cython.Py_ssize_t = q.size
    return are_ordinary(numbers(q, n), numbers(lower, n), numbers(upper, n), n)


def are_ordinary(q, lower, upper, n):
    """Tell whether the vectors surely need no further check.

    Then no entry is NaN, sum |q_i| is 0 or in (1e-90, 1e90), lower <= upper, and no
    finite bound has a modulus of INFINITE or more.
    """
    size, most = 0.0, INFINITE
    faults: cython.Py_ssize_t = 0
    for i in range(n):
        size += fabs(q[i])
        l, u = lower[i], upper[i]
        below: cython.bint = (l < most) & ((l > -most) | (l == -INFINITY))
        above: cython.bint = (u > -most) & ((u < most) | (u == INFINITY))
        faults += not (below & above & (l <= u))
    return (size == 0.0 or 1e-90 < size < 1e90) and faults == 0


def affine(A, z, q):
    n: cython.Py_ssize_t = q.size
    w = np.empty(n)
    affine_at(numbers(A, n * n), numbers(z, n), numbers(q, n), numbers(w, n), n)
    return w


def affine_at(A, z, q, w, n):
    for i in range(n):
        w[i] = dot(A + i * n, z, n) + q[i]


def row_sums(indptr, indices, data, x, roundoff, least, own, others, margin):
    """Set the rows of D x and |A - D| x, and the largest error of their difference.

    A sum of k terms t is off by at most (k + 1) u sum |t| (Higham, Accuracy and
    Stability, section 3.1), u = roundoff, and underflow adds less than 4 k times the
    `least` number. No error where no operation is rounded.
    """
    for i in range(x.shape[0]):
        d, off = 0.0, 0.0
        exact: cython.bint = True
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            exact &= x[j] == 1.0
            t = fabs(data[k]) * x[j]
            if j == i:
                d = t
            else:
                total = off + t
                exact &= (total - off == t) & (total - t == off)
                off = total
        rest = d - off
        exact &= (d - rest == off) & (rest + off == d)
        count = indptr[i + 1] - indptr[i] + 3
        error = count * (2.0 * roundoff * (d + off) + 4.0 * least)
        own[i], others[i], margin[i] = d, off, 0.0 if exact else error


# ---- sweeps of projected SOR and Gauss-Seidel, for `psor` and multigrid


def relax(indptr, indices, data, q, lower, upper, alpha, z, way):
    """Overwrite z by one projected SOR sweep; return || D^(1/2) (z+ - z) ||_2.

    z_i <- clip(z_i - alpha (A z + q)_i / a_ii, l_i, u_i) with the newest values of z
    (Cryer 1971), from the first row on (way = 1), or the last (-1). Every a_ii is
    stored and positive. The returned number, D = diag(A), is about as large as Res of
    the problem scaled to a unit diagonal, but no bound for it.

    The one term of a row that depends on the row before is added last: the chain of
    these limits the speed.
    """
    n: cython.Py_ssize_t = z.size
    row, column = places(indptr, n + 1), places(indices, data.size)
    entry, x = numbers(data, data.size), numbers(z, n)
    c, l, u = numbers(q, n), numbers(lower, n), numbers(upper, n)
    total = 0.0
    last = 0.0  # z of the row before
    i: cython.Py_ssize_t = 0 if way > 0 else n - 1
    with cython.nogil:
        for _ in range(n):
            xi = x[i]
            r = c[i]  # becomes (A z + q)_i without the term of the row before
            neighbour, a = 0.0, 0.0  # the entry of that, a_ii
            for k in range(row[i], row[i + 1]):
                j = column[k]
                if j == i - way:
                    neighbour = entry[k]
                else:
                    r += entry[k] * x[j]
                    if j == i:
                        a = entry[k]
            step = alpha / a
            last = clip((xi - r * step) - (neighbour * step) * last, l[i], u[i])
            x[i] = last
            total += a * (last - xi) * (last - xi)
            i += way
    return sqrt(total)


def two_colours(indptr, indices, second):
    """Mark rows of a second colour so that none is coupled to one above of its colour.

    False if it finds no such colours, which are unique where every row but the first is
    coupled to one above it. Where the pattern is not symmetric, a row may be coupled to
    one below of its colour: then sweeps by colours are sweeps in some order.
    """
    for i in range(second.shape[0]):
        first = indices[indptr[i]]
        second[i] = first < i and not second[first]
        for k in range(indptr[i], indptr[i + 1]):
            if indices[k] < i and second[indices[k]] == second[i]:
                return False
    return True


def relax_coloured(indptr, indices, data, q, lower, upper, alpha, z, second):
    """Make two sweeps, the second colour last; return for both what `relax` returns.

    Their four stages go through the matrix at once, so that it is read from memory
    once: a stage relaxes a row as soon as the one before has passed all rows that this
    row is coupled to.
    """
    n: cython.Py_ssize_t = z.size
    row, column = places(indptr, n + 1), places(indices, data.size)
    entry, x = numbers(data, data.size), numbers(z, n)
    c, l, u = numbers(q, n), numbers(lower, n), numbers(upper, n)
    passed = cython.declare(cython.Py_ssize_t[STAGES])
    total = cython.declare(cython.double[STAGES])
    for s in range(STAGES):
        passed[s], total[s] = 0, 0.0
    with cython.nogil:
        while passed[STAGES - 1] < n:
            for s in range(STAGES):
                i = passed[s]
                before = passed[s - 1] if s > 0 else min(i + BLOCK, n)
                while i < n:
                    last = column[row[i + 1] - 1] if s > 0 else i
                    if last >= before and before < n:
                        break
                    if second[i] == s % 2:
                        total[s] += relax_row(i, row, column, entry, c, l, u, alpha, x)
                    i += 1
                passed[s] = i
    return sqrt(total[0] + total[1]), sqrt(total[2] + total[3])


def relax_row(i, row, column, entry, c, l, u, alpha, x):
    """Relax row i; return a_ii times the square of the change of x_i."""
    r, a, xi = c[i], 1.0, x[i]
    for k in range(row[i], row[i + 1]):
        r += entry[k] * x[column[k]]
        if column[k] == i:
            a = entry[k]
    x[i] = clip(xi - r * (alpha / a), l[i], u[i])
    return a * (x[i] - xi) * (x[i] - xi)


# ---- sweeps of the triangular methods of `modulus`
#
# A sweep adds ds to s so that, with the letters of `modulus.sweeps` and P = D/alpha +
# Omega + E,
#
#     (P - G L) ds - H L dz = -2 (A z + q - w).
#
# The right side needs A z of the *old* iterate, so the pass that computes s+ also gives
# Res(z). What depends on row i - 1 is added last, as in `relax`. NaN reaches Res.
#
# All vectors are rows of two-dimensional arrays: `vectors` has the diagonals of Omega
# and P^-1, q, work space, and the bounds; an iterate has s and z = clip(s).


def sweep_csr(indptr, indices, data, vectors, G, H, old, new):
    """Write the next iterate to `new` and return Res(z) of `old`, (2, n) arrays.

    `vectors` has the rows OMEGA to UPPER; row CHANGE is overwritten.
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
            away = deviation(zi, r, l, u)
            total += away * away
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
            away: cython.double = deviation(zi, r, l, u)
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
