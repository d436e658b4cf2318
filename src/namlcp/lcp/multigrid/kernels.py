"""Compiled parts of the truncated multigrid cycle, each a pass over one level.

A face F is given by `dinv`: 1 / a_ii on F, 0 elsewhere; T is diagonal, 1 on F, 0
elsewhere. The V(1,1)-cycle acts on T A T: one forward Gauss-Seidel sweep, the
correction with the coarse matrix A_c = P' T A T P, and one backward sweep (Kornhuber,
Numer. Math. 69 (1994) 167-184). `diagonal` holds the positions of the a_ii.
"""

import cython
import numpy as np
from cython.cimports.libc.math import fabs

# Coarse diagonal entry, relative to its value without truncation, that counts as 0.
VANISHED = 1e-13


def rows_of(M, n):
    rows = cython.declare(Columns)
    take_columns(M, n, cython.address(rows))
    return rows


def strong_couplings(matrix, theta, indptr, indices, data):
    """Write the couplings -a_ij >= theta max_k -a_ik > 0; return their number."""
    n = indptr.shape[0] - 1
    A = rows_of(matrix, n)
    count: cython.int = 0
    with cython.nogil:
        indptr[0] = 0
        for i in range(n):
            least = 0.0
            for k in range(A.indptr[i], A.indptr[i + 1]):
                if A.indices[k] != i:
                    least = min(least, A.data[k])
            for k in range(A.indptr[i], A.indptr[i + 1]):
                if A.indices[k] != i and A.data[k] < 0.0 and A.data[k] <= theta * least:
                    indices[count], data[count] = A.indices[k], A.data[k]
                    count += 1
            indptr[i + 1] = count
    return count


def free_product(matrix, dinv, x, y):
    """Write y = T A x, in less than half of the time of SciPy's product."""
    n = dinv.shape[0]
    A = rows_of(matrix, n)
    with cython.nogil:
        for i in range(n):
            r = 0.0
            if dinv[i] != 0.0:
                for k in range(A.indptr[i], A.indptr[i + 1]):
                    r += A.data[k] * x[A.indices[k]]
            y[i] = r


def descend(matrix, diagonal, interpolation, dinv, b, x, coarse):
    """Write x, one forward sweep on T A T x = b from 0, and coarse = P' T (b - A x).

    The residual is -(strict upper triangle of T A T) x: every entry is read once. Its
    rows are computed when the sweep has passed their columns, still in the cache.
    """
    n = x.shape[0]
    A, P = rows_of(matrix, n), rows_of(interpolation, n)
    row: cython.Py_ssize_t = 0  # the next one of the residual
    with cython.nogil:
        for j in range(coarse.shape[0]):
            coarse[j] = 0.0
        for i in range(n):
            x[i] = 0.0
            if dinv[i] != 0.0:
                r = b[i]
                for k in range(A.indptr[i], diagonal[i]):
                    r -= A.data[k] * x[A.indices[k]]
                x[i] = r * dinv[i]
            while row <= i and A.indices[A.indptr[row + 1] - 1] <= i:
                if dinv[row] != 0.0:
                    r = 0.0
                    for k in range(diagonal[row] + 1, A.indptr[row + 1]):
                        r -= A.data[k] * x[A.indices[k]]
                    for k in range(P.indptr[row], P.indptr[row + 1]):
                        coarse[P.indices[k]] += P.data[k] * r
                row += 1


def ascend(matrix, diagonal, interpolation, dinv, b, coarse, x):
    """Add T P coarse to x, and sweep backward on T A T x = b."""
    n = x.shape[0]
    A, P = rows_of(matrix, n), rows_of(interpolation, n)
    added: cython.Py_ssize_t = n  # from here on, just before they are read
    with cython.nogil:
        for i in range(n - 1, -1, -1):
            while added > A.indices[A.indptr[i]]:
                added -= 1
                if dinv[added] != 0.0:
                    r = x[added]
                    for k in range(P.indptr[added], P.indptr[added + 1]):
                        r += P.data[k] * coarse[P.indices[k]]
                    x[added] = r
            if dinv[i] == 0.0:
                continue
            r = b[i]
            for k in range(A.indptr[i], diagonal[i]):
                r -= A.data[k] * x[A.indices[k]]
            for k in range(A.indptr[i + 1] - 1, diagonal[i], -1):
                r -= A.data[k] * x[A.indices[k]]
            x[i] = r * dinv[i]


def truncate_coarse(level, face, below_level, below):
    """Recompute the rows of A_c = P' T A T P that differ from P' A P, no others.

    `below`, an earlier face, gets A_c in the pattern of P' A P, its dinv and touched.
    Entries outside the pattern are added, in modulus, to the diagonal. A coarse unknown
    is truncated if C_j, the fine unknown it stands for, is not free, or its diagonal
    vanishes. (Kornhuber keeps it as long as any fine unknown of column j of P is free.
    Next to a long edge of the face these columns, cut off in the middle, slow down the
    cycles.)
    """
    d: cython.double[::1] = below_level.d
    C: cython.int[::1] = level.C
    dinv: cython.double[::1] = face.dinv
    fine_touched: cython.uchar[::1] = face.touched
    truncated: cython.double[::1] = below.A.data
    coarse_dinv: cython.double[::1] = below.dinv
    touched: cython.uchar[::1] = below.touched
    n, m = dinv.shape[0], d.shape[0]
    position: cython.int[::1] = np.empty(m, np.int32)  # places of columns in row j
    A, P = rows_of(face.A, n), rows_of(level.P, n)
    R, coarse = rows_of(level.R, m), rows_of(below_level.A, m)
    with cython.nogil:
        for j in range(m):
            touched[j] *= 2  # by an earlier face
        for i in range(n):
            cut: cython.bint = fine_touched[i]
            for t in range(A.indptr[i], A.indptr[i + 1]):
                cut |= dinv[A.indices[t]] == 0.0
            if cut:
                for s in range(P.indptr[i], P.indptr[i + 1]):
                    touched[P.indices[s]] |= 1
        for j in range(m):
            before = touched[j] & 2
            touched[j] &= 1
            start, end = coarse.indptr[j], coarse.indptr[j + 1]
            if not touched[j]:
                coarse_dinv[j] = 1.0 / d[j]
                if before:
                    for k in range(start, end):
                        truncated[k] = coarse.data[k]
                continue
            coarse_dinv[j] = 0.0
            if dinv[C[j]] == 0.0:
                continue
            for k in range(start, end):
                truncated[k] = 0.0
                position[coarse.indices[k]] = k
            outside = 0.0
            for k in range(R.indptr[j], R.indptr[j + 1]):
                i = R.indices[k]
                if dinv[i] == 0.0:
                    continue
                for t in range(A.indptr[i], A.indptr[i + 1]):
                    l = A.indices[t]
                    if dinv[l] == 0.0:
                        continue
                    ra = R.data[k] * A.data[t]
                    for s in range(P.indptr[l], P.indptr[l + 1]):
                        c = P.indices[s]
                        p = position[c]
                        if start <= p < end and coarse.indices[p] == c:
                            truncated[p] += ra * P.data[s]
                        else:
                            outside += fabs(ra * P.data[s])
            p = position[j]
            truncated[p] += outside
            if truncated[p] > VANISHED * d[j]:
                coarse_dinv[j] = 1.0 / truncated[p]
