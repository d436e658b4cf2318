"""Rows of a matrix that are multiples of each other: found by hashing, and merged.

Rows c g'x <= d beside g'x <= h are sides of one range, equations c a'x = d beside
a'x = b are one equation. The first row of each such group is its leader.
"""

from typing import NamedTuple

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY, fabs, floor
from cython.cimports.libc.string import memcpy
from scipy.sparse import csr_array

from namlcp.checks import from_arrays, no_rows
from namlcp.entries import constant
from namlcp.linalg import arrays_of, by_rows, submatrix, without_zeros

# Largest relative difference between entries of two rows, one row scaled.
SAME = 1e-13
# The weight of column j in the key of a row is 1 plus the fractional part of j times
# the golden ratio, which differs from that of any nearby column.
GOLDEN = 0.6180339887498949


class Groups(NamedTuple):
    """Which rows of a matrix are kept, and which are multiples of others.

    Row i is ratio[i] times the first row of its group, row first[number[i]]. number[i]
    is UNWANTED or EMPTY for a row that was not wanted or is empty.
    """

    number: np.ndarray
    ratio: np.ndarray
    first: np.ndarray


def leading_rows(M, columns, wanted):
    """Return the leaders of the wanted rows of M[:, columns] in CSR, and the groups.

    Stored zeros are dropped.
    """
    number = constant(wanted.size, UNWANTED, np.int32)
    ratio = constant(wanted.size, 1.0)
    rows = wanted.nonzero()[0]
    if not rows.size:
        return by_rows(no_rows(columns.size)), Groups(number, ratio, rows)
    C = by_rows(submatrix(without_zeros(M), rows, columns))
    key, own, first = np.empty((3, rows.size), np.int32)
    table = constant(1 << (2 * rows.size + 1).bit_length(), -1, np.int32)
    factor = np.empty(rows.size)
    count = group_rows(*arrays_of(C), key, table, own, factor, first)
    number[rows], ratio[rows] = own, factor
    indptr, entries = C.indptr[: count + 1], C.indptr[count]
    parts = indptr, C.indices[:entries], C.data[:entries]
    kept = from_arrays(parts, (count, columns.size), csr_array)
    return kept, Groups(number, ratio, rows[first[:count]])


def group_rows(indptr, indices, data, key, table, number, ratio, first):
    """Group the rows of a CSR matrix that are proportional; keep their leaders.

    Returns the number of groups. number, ratio and first are overwritten as in
    `Groups`, and the matrix by its leaders; `key` by the bits of their keys in single
    precision, so that rounding errors seldom change them; `table`, -1 on entry, is a
    hash table of groups with open addressing. The key of a row is sum |a_ij| w_ij /
    |first a_ij| with the weights of GOLDEN, plus 1 where the signs of a_ij and of the
    first entry differ.
    """
    mask: cython.longlong = table.shape[0] - 1
    kept: cython.int = 0
    group: cython.int = 0
    bits: cython.int = 0
    begin = indptr[0]
    for i in range(key.shape[0]):
        end = indptr[i + 1]
        ratio[i], number[i] = 1.0, EMPTY
        if begin == end:
            continue
        total = 0.0
        for t in range(begin, end):
            share = GOLDEN * indices[t]
            weight = 1.0 + share - floor(share)
            if (data[t] > 0.0) != (data[begin] > 0.0):
                weight += 1.0
            total += fabs(data[t]) * weight
        single: cython.float = total / fabs(data[begin])
        memcpy(cython.address(bits), cython.address(single), cython.sizeof(single))
        s = (bits ^ (bits >> 15)) & mask
        factor = 0.0
        while table[s] >= 0 and factor == 0.0:
            group = table[s]
            if key[group] == bits:
                a, a_end = indptr[group], indptr[group + 1]
                factor = multiple(indices, data, a, a_end, begin, end)
            s = (s + 1) & mask
        if factor != 0.0:
            number[i], ratio[i] = group, factor
        else:
            table[s], number[i] = kept, kept
            key[kept], first[kept] = bits, i
            start = indptr[kept]
            for t in range(end - begin):
                indices[start + t] = indices[begin + t]
                data[start + t] = data[begin + t]
            kept += 1
            indptr[kept] = start + end - begin
        begin = end
    return kept


def multiple(indices, data, a, a_end, c, c_end):
    """Return r != 0 if entries c to c_end are r times a to a_end, else 0."""
    if c_end - c != a_end - a:
        return 0.0
    ratio = data[c] / data[a]
    for t in range(a_end - a):
        far = fabs(data[c + t] - ratio * data[a + t])
        if indices[a + t] != indices[c + t] or not far <= SAME * fabs(data[c + t]):
            return 0.0
    return ratio


def wrong_empty_row(number, sides, equal, tol):
    """Return the first empty row that no x satisfies within tol, or -1."""
    for i in range(number.shape[0]):
        if number[i] != EMPTY:
            continue
        if (fabs(sides[i]) > tol) if equal else -INFINITY < sides[i] < -tol:
            return i
    return -1


def merge_rows(number, ratio, sides, equal, tol, least, giver):
    """Merge rows c g'x <= d_i, or = d_i if `equal`, to one range for each group.

    That is -least[1] <= g'x <= least[0]; `giver` takes the rows that give these sides,
    -1 for none. Returns the first group without a point in its range, both sides
    widened by `tol` in the units of their rows, or -1.
    """
    count = least.shape[1]
    for half in range(2):
        sign = 1.0 - 2.0 * half
        for k in range(count):
            least[half, k], giver[half, k] = INFINITY, -1
        for i in range(number.shape[0]):
            k, value = number[i], sign * sides[i] / ratio[i]
            if k >= 0 and (equal or sign * ratio[i] > 0.0) and value < least[half, k]:
                least[half, k], giver[half, k] = value, i if value > -INFINITY else -1
    for k in range(count):
        i, j = giver[0, k], giver[1, k]
        if i >= 0 and j >= 0:
            wide = tol / fabs(ratio[i]) + tol / fabs(ratio[j])
            if least[0, k] + least[1, k] < -wide:
                return k
    return -1
