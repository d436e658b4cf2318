"""Compiled parts of the truncated multigrid cycle, each a pass over one level.

A face F is the set of free unknowns, given by `dinv`: 1 / a_ii on F, 0 elsewhere. T is
diagonal with T_ii = 1 on F, 0 elsewhere. The V(1,1)-cycle acts on T A T: one forward
Gauss-Seidel sweep, the correction with the coarse matrix

    A_c = P' T A T P,

and one backward sweep (Ruge and Stueben, in McCormick, Multigrid Methods, SIAM 1987,
for T = I; Kornhuber, Numer. Math. 69 (1994) 167-184, for truncation). On coarse levels
with symmetric A the rows at the edge of F are relaxed once more, before and after.
Matrices are `Compressed` by rows; `diagonal` holds the positions of their a_ii.

Indices are cast to unsigned types, which saves the test for negative indices.
"""

from typing import NamedTuple

import numpy as np

from namlcp.compiled import kernel
from namlcp.lcp.relaxation import ONE
from namlcp.linalg.csc import Compressed

VANISHED = 1e-13
"""Coarse diagonal entry, relative to its value without truncation, that counts as 0."""


@kernel
def residual_vector(A, q, z, w):
    """Write w = A z + q."""
    for i in range(w.size):
        r = q[i]
        for k in range(np.uintp(A.indptr[i]), np.uintp(A.indptr[i + 1])):
            r += A.data[k] * z[np.uintp(A.indices[k])]
        w[i] = r


@kernel
def mark_free(d, z, lower, upper, dinv):
    """Write the face l < z < u to `dinv`; return how many of its entries changed."""
    changed = 0
    for i in range(z.size):
        new = 1.0 / d[i] if lower[i] < z[i] < upper[i] else 0.0
        changed += new != dinv[i]
        dinv[i] = new
    return changed


@kernel
def descend(A, diagonal, P, dinv, b, x, coarse):
    """Write x, one forward sweep on T A T x = b from 0, and coarse = P' T (b - A x).

    The residual is -(strict upper triangle of T A T) x, so every entry is read once.
    """
    for i in range(x.size):
        if dinv[i] == 0.0:
            x[i] = 0.0
            continue
        r = b[i]
        for k in range(np.uintp(A.indptr[i]), np.uintp(diagonal[i])):
            r -= A.data[k] * x[np.uintp(A.indices[k])]
        x[i] = r * dinv[i]
    for j in range(coarse.size):
        coarse[j] = 0.0
    for i in range(x.size):
        if dinv[i] == 0.0:
            continue
        r = 0.0
        for k in range(np.uintp(diagonal[i]) + ONE, np.uintp(A.indptr[i + 1])):
            r -= A.data[k] * x[np.uintp(A.indices[k])]
        for k in range(np.uintp(P.indptr[i]), np.uintp(P.indptr[i + 1])):
            coarse[np.uintp(P.indices[k])] += P.data[k] * r


@kernel
def ascend(A, diagonal, P, dinv, b, coarse, x):
    """Add T P coarse to x, sweep backward on T A T x = b, and return b'x."""
    for i in range(x.size):
        if dinv[i] != 0.0:
            r = x[i]
            for k in range(np.uintp(P.indptr[i]), np.uintp(P.indptr[i + 1])):
                r += P.data[k] * coarse[np.uintp(P.indices[k])]
            x[i] = r
    product = 0.0
    for t in range(x.size):
        i = x.size - 1 - t
        if dinv[i] == 0.0:
            continue
        r = b[i]
        for k in range(np.uintp(A.indptr[i]), np.uintp(diagonal[i])):
            r -= A.data[k] * x[np.uintp(A.indices[k])]
        k = np.uintp(A.indptr[i + 1]) - ONE
        while k > np.uintp(diagonal[i]):
            r -= A.data[k] * x[np.uintp(A.indices[k])]
            k -= ONE
        x[i] = r * dinv[i]
        product += b[i] * x[i]
    return product


@kernel
def relax_edge(A, dinv, edge, b, x):
    """Sweep forward over the rows `edge` on T A T y = b from y = 0.

    Sets x to these entries of y, and b to b - A y on F. A is symmetric.
    """
    for t in range(edge.size):
        i = edge[t]
        x[t] = b[i] * dinv[i]
        for k in range(A.indptr[i], A.indptr[i + 1]):
            b[A.indices[k]] -= A.data[k] * x[t]


@kernel
def relax_edge_back(A, dinv, edge, b, start, x):
    """Sweep backward over these rows on T A T x = b, then add `start` to x there."""
    for t in range(edge.size - 1, -1, -1):
        i = edge[t]
        r = b[i]
        for k in range(A.indptr[i], A.indptr[i + 1]):
            r -= A.data[k] * x[A.indices[k]]
        x[i] += r * dinv[i]
    for t in range(edge.size):
        x[edge[t]] += start[t]


class FaceOnLevel(NamedTuple):
    """The free unknowns F of one level, and what follows from them.

    A: the matrix of the level, truncated by the faces of the finer levels. dinv (n,):
    1 / a_ii on F, 0 elsewhere. touched (n,): rows of A that differ from the matrix of
    the level. dirty (n,): rows that `mark_dirty` marks. b, x (n,): right-hand side and
    solution of a cycle, for the next finer level. position (n,): work of
    `truncate_coarse`, empty while A is the matrix of the level itself.
    """

    A: Compressed
    dinv: np.ndarray
    touched: np.ndarray
    dirty: np.ndarray
    b: np.ndarray
    x: np.ndarray
    position: np.ndarray


@kernel
def mark_dirty(face):
    """Write dirty: rows that are truncated, touched or have a truncated neighbour."""
    A, dinv, touched, dirty = face.A, face.dinv, face.touched, face.dirty
    for i in range(dinv.size):
        mark = touched[i] or dinv[i] == 0.0
        k = np.uintp(A.indptr[i])
        end = np.uintp(A.indptr[i + 1])
        while not mark and k < end:
            mark = dinv[np.uintp(A.indices[k])] == 0.0
            k += ONE
        dirty[i] = mark


@kernel
def truncate_coarse(face, P, R, C, coarse, d, below):
    """Recompute the rows of A_c = P' T A T P that differ from P' A P, no others.

    Entries outside the pattern of P' A P are added, in modulus, to the diagonal. A
    coarse unknown is truncated if C_j, the fine unknown it stands for, is not free, or
    its diagonal vanishes. (Kornhuber keeps it as long as any fine unknown of column j
    of P is free. Next to a long edge of the face these columns, cut off in the middle,
    slow down the cycles.)

    `face` is that of the fine level after `mark_dirty`, R = P', `coarse` is P' A P, d
    its diagonal. `below`, an earlier face on the coarse level, gets A_c in the pattern
    of `coarse`, its dinv and touched.
    """
    A, dinv, dirty = face.A, face.dinv, face.dirty
    truncated, coarse_dinv = below.A.data, below.dinv
    touched, position = below.touched, below.position
    for j in range(d.size):
        before = touched[j]
        now = False
        for k in range(R.indptr[j], R.indptr[j + 1]):
            now |= dirty[R.indices[k]]
        touched[j] = now
        start, end = coarse.indptr[j], coarse.indptr[j + 1]
        if not now:
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
        for k in range(np.uintp(R.indptr[j]), np.uintp(R.indptr[j + 1])):
            i = np.uintp(R.indices[k])
            if dinv[i] == 0.0:
                continue
            for t in range(np.uintp(A.indptr[i]), np.uintp(A.indptr[i + 1])):
                l = np.uintp(A.indices[t])
                if dinv[l] == 0.0:
                    continue
                ra = R.data[k] * A.data[t]
                for s in range(np.uintp(P.indptr[l]), np.uintp(P.indptr[l + 1])):
                    c = P.indices[s]
                    p = position[c]
                    if start <= p < end and coarse.indices[p] == c:
                        truncated[p] += ra * P.data[s]
                    else:
                        outside += abs(ra * P.data[s])
        p = position[j]
        truncated[p] += outside
        if truncated[p] > VANISHED * d[j]:
            coarse_dinv[j] = 1.0 / truncated[p]


@kernel
def face_product(A, dinv, p, Ap):
    """Write Ap = T A p for p = T p; return p'Ap."""
    product = 0.0
    for i in range(p.size):
        r = 0.0
        if dinv[i] != 0.0:
            for k in range(np.uintp(A.indptr[i]), np.uintp(A.indptr[i + 1])):
                r += A.data[k] * p[np.uintp(A.indices[k])]
            product += r * p[i]
        Ap[i] = r
    return product


@kernel
def step_along(step, p, Ap, x, r):
    """Add step p to x and -step Ap to r; return || r ||_2."""
    total = 0.0
    for i in range(x.size):
        x[i] += step * p[i]
        t = r[i] - step * Ap[i]
        r[i] = t
        total += t * t
    return np.sqrt(total)


@kernel
def project_step(A, z, w, lower, upper, x, Ax):
    """Overwrite x by clip(z + x) - z, write Ax = A x; return w'x and x'Ax."""
    for i in range(z.size):
        x[i] = min(max(z[i] + x[i], lower[i]), upper[i]) - z[i]
    slope = 0.0
    curvature = 0.0
    for i in range(z.size):
        r = 0.0
        for k in range(np.uintp(A.indptr[i]), np.uintp(A.indptr[i + 1])):
            r += A.data[k] * x[np.uintp(A.indices[k])]
        Ax[i] = r
        slope += w[i] * x[i]
        curvature += r * x[i]
    return slope, curvature


@kernel
def move(step, x, Ax, lower, upper, z, w):
    """Write z = clip(z + step x), and add step Ax to w."""
    for i in range(z.size):
        z[i] = min(max(z[i] + step * x[i], lower[i]), upper[i])
        w[i] += step * Ax[i]
