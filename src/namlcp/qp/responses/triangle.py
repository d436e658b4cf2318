"""The Cholesky factor L of a matrix S = L L' that gains and loses rows and columns.

L of order k is stored row by row without its zeros: row i begins at i (i + 1) / 2.
Removing a row and column of S leaves L with one entry too many in each later row, which
Givens rotations of its columns take away (Gill, Golub, Murray and Saunders, Math.
Comp. 28 (1974) 505-535, method C1 in the form for L).
"""

import numpy as np

from namlcp.compiled import part
from namlcp.linalg import add_scaled, dot


@part
def triangle_solve(L, k, b):
    """Overwrite b (k,) by L^-1 b."""
    start = 0
    for i in range(k):
        b[i] = (b[i] - dot(L[start : start + i], b[:i])) / L[start + i]
        start += i + 1


@part
def triangle_solve_transposed(L, k, b):
    """Overwrite b (k,) by L'^-1 b."""
    for i in range(k - 1, -1, -1):
        start = i * (i + 1) // 2
        b[i] /= L[start + i]
        add_scaled(-b[i], L[start : start + i], b[:i])


@part
def append_to_triangle(L, k, b, diagonal):
    """Add row and column k to S; b = L^-1 s for the new entries s of S."""
    start = k * (k + 1) // 2
    for j in range(k):
        L[start + j] = b[j]
    L[start + k] = diagonal


@part
def remove_from_triangle(L, k, leaving, cosines, sines):
    """Remove row and column `leaving` of k from S; the last two are work space."""
    for i in range(leaving, k - 1):
        row, below = i * (i + 1) // 2, (i + 1) * (i + 2) // 2
        for j in range(leaving):
            L[row + j] = L[below + j]
        carried = L[below + leaving]
        for j in range(leaving, i):
            following = L[below + j + 1]
            L[row + j] = cosines[j] * carried + sines[j] * following
            carried = cosines[j] * following - sines[j] * carried
        following = L[below + i + 1]
        radius = np.sqrt(carried * carried + following * following)
        cosines[i], sines[i] = carried / radius, following / radius
        L[row + i] = radius
