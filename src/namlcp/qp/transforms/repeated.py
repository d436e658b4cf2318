"""Rows of a matrix that are multiples of each other: found by hashing, and merged.

Rows c g'x <= d beside g'x <= h are sides of one range, equations c a'x = d beside
a'x = b are one equation. The first row of each such group is its leader.
"""

import functools
from typing import NamedTuple

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs, floor
from cython.cimports.namlcp.linalg.vectors import float_bits
from scipy.sparse import csr_array

from namlcp.checks import from_arrays

# Largest relative difference between entries of two rows, one row scaled.
SAME = 1e-13
# The weight of column j in the key of a row is 1 plus the fractional part of j times
# the golden ratio, which differs from that of any nearby column.
GOLDEN = 0.6180339887498949


class Groups(NamedTuple):
    """Which rows of a matrix are kept, and which are multiples of others.

    Row i is ratio[i] times row leader[i], the `first` one of its group; rows that are
    not `wanted` and empty ones have the leader UNWANTED or EMPTY. number[i] is the
    position of a leader in `first`. `repeated` tells whether some rows are not leaders,
    `empty` has those that are empty.
    """

    wanted: np.ndarray
    leader: np.ndarray
    ratio: np.ndarray
    number: np.ndarray
    first: np.ndarray
    repeated: bool
    empty: np.ndarray

    @property
    def merged_by(self):
        """What `merge_ranges` and `merge_equations` need."""
        return self.leader, self.ratio, self.number


def leading_rows(M, columns, wanted):
    """Return the leaders of the wanted rows of M[:, columns] in CSR, and the groups.

    Stored zeros are dropped.
    """
    m = M.shape[0]
    if m == 0:
        return no_leading_rows(columns.size)
    indptr = np.empty(m + 1, dtype=np.int32)
    indices, data = np.empty(M.indices.size, dtype=np.int32), np.empty(M.data.size)
    rows = indptr, indices, data
    leader, number = np.empty((2, m), dtype=np.int32)
    ratio, key = np.empty(m), np.empty(m, dtype=np.int32)
    wanted_bytes = wanted.view(np.uint8)
    turned_part(M.indptr, M.indices, M.data, columns, wanted_bytes, *rows)
    table = np.empty(1 << (2 * m + 1).bit_length(), dtype=np.int32)
    count, followers = group_rows(
        *rows, wanted_bytes, key, table, leader, ratio, number
    )
    entries = indptr[count]
    parts = indptr[: count + 1], indices[:entries], data[:entries]
    first, empty = (number >= 0).nonzero()[0], (leader == EMPTY).nonzero()[0]
    groups = Groups(wanted, leader, ratio, number, first, followers > 0, empty)
    return from_arrays(parts, (count, columns.size), csr_array), groups


@functools.lru_cache(maxsize=16)
def no_leading_rows(n):
    """Return what `leading_rows` does of no rows; it is shared: read only."""
    none, flags = np.empty(0, dtype=np.int32), np.empty(0, dtype=np.bool_)
    empty = from_arrays((np.zeros(1, np.int32), none, np.empty(0)), (0, n), csr_array)
    rows = np.empty(0, dtype=np.intp)
    return empty, Groups(flags, none, np.empty(0), none, rows, False, rows)


def turned_part(indptr, indices, data, columns, wanted, start, position, value):
    """Write the nonzeros of some columns and of the wanted rows of a matrix by rows.

    It comes in CSC, and becomes (start, position, value); columns are numbered as they
    stand in `columns`, other rows become empty.
    """
    count = start.shape[0]
    for i in range(count):
        start[i] = 0
    for k in range(columns.shape[0]):
        j = columns[k]
        for t in range(indptr[j], indptr[j + 1]):
            if data[t] != 0.0 and wanted[indices[t]]:
                start[indices[t]] += 1
    total: cython.int = 0
    for i in range(count):  # start[i] is the end of row i, then its beginning
        total += start[i]
        start[i] = total
    for k in range(columns.shape[0] - 1, -1, -1):
        j = columns[k]
        for t in range(indptr[j], indptr[j + 1]):
            i = indices[t]
            if data[t] != 0.0 and wanted[i]:
                start[i] -= 1
                position[start[i]] = k
                value[start[i]] = data[t]


def group_rows(indptr, indices, data, wanted, key, table, leader, ratio, number):
    """Group the rows of a CSR matrix that are proportional; keep their leaders.

    Returns the numbers of leaders and of other rows in groups. `leader`, `ratio` and
    `number` (m,) are overwritten as in `Groups`, and the matrix by its leaders. key and
    table are overwritten: the bits of keys in single precision, so that rounding errors
    seldom change them, and a hash table of rows with open addressing. The key of a row
    is sum |a_ij| w_ij / |first a_ij| with the weights of GOLDEN, plus 1 where the signs
    of a_ij and of the first entry differ.
    """
    mask: cython.longlong = table.shape[0] - 1
    for k in range(table.shape[0]):
        table[k] = -1
    kept: cython.int = 0
    followers: Py_ssize_t = 0
    head: cython.int = 0
    begin = indptr[0]
    for i in range(wanted.shape[0]):
        end = indptr[i + 1]
        ratio[i], number[i] = 1.0, -1
        if begin == end:
            leader[i] = EMPTY if wanted[i] else UNWANTED
            continue
        total = 0.0
        for t in range(begin, end):
            share = GOLDEN * indices[t]
            weight = 1.0 + share - floor(share)
            if (data[t] > 0.0) != (data[begin] > 0.0):
                weight += 1.0
            total += fabs(data[t]) * weight
        key[i] = float_bits(total / fabs(data[begin]))
        s = (key[i] ^ (key[i] >> 15)) & mask
        factor = 0.0
        while table[s] >= 0 and factor == 0.0:
            head = table[s]
            if key[head] == key[i]:
                k = number[head]
                factor = multiple(indices, data, indptr[k], indptr[k + 1], begin, end)
            s = (s + 1) & mask
        if factor != 0.0:
            leader[i], ratio[i] = head, factor
            followers += 1
            begin = end
            continue
        table[s] = i
        leader[i], number[i] = i, kept
        start = indptr[kept]
        for t in range(end - begin):
            indices[start + t], data[start + t] = indices[begin + t], data[begin + t]
        kept += 1
        indptr[kept] = start + end - begin
        begin = end
    return kept, followers


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


def merge_ranges(leader, ratio, number, h, tol, lower, upper, low_at, up_at):
    """Merge rows c g'x <= h_i of each group to lower <= g'x <= upper.

    leader, ratio and number are those of `Groups`; low_at and up_at take the rows that
    give the sides, -1 for none. Returns the first range with lower > upper, each side
    widened by `tol` in the units of its row, or -1.
    """
    for k in range(lower.shape[0]):
        lower[k], upper[k], low_at[k], up_at[k] = -INFINITY, INFINITY, -1, -1
    for i in range(h.shape[0]):
        if leader[i] < 0:
            continue
        k, value = number[leader[i]], h[i] / ratio[i]
        if ratio[i] > 0.0 and value < upper[k]:
            upper[k], up_at[k] = value, i if value > -INFINITY else -1
        elif ratio[i] < 0.0 and value > lower[k]:
            lower[k], low_at[k] = value, i if value < INFINITY else -1
    for k in range(lower.shape[0]):
        i, j = low_at[k], up_at[k]
        if i >= 0 and j >= 0 and lower[k] > upper[k] + tol / ratio[j] - tol / ratio[i]:
            return k
    return -1


def merge_equations(leader, ratio, number, b, tol, sides, most, least):
    """Merge equations c a'x = b_i of each group; return the first contradiction or -1.

    leader, ratio, number are those of `Groups`; `most` and `least` take the rows with
    the extreme right-hand sides b_i / c, `sides` their mean with the weights |c|, from
    which both rows differ by as much. They contradict each other where that is above
    `tol`.
    """
    for k in range(sides.shape[0]):
        most[k], least[k] = -1, -1
    for i in range(b.shape[0]):
        if leader[i] < 0:
            continue
        k, value = number[leader[i]], b[i] / ratio[i]
        if most[k] < 0 or value > b[most[k]] / ratio[most[k]]:
            most[k] = i
        if least[k] < 0 or value < b[least[k]] / ratio[least[k]]:
            least[k] = i
    wrong: Py_ssize_t = -1
    for k in range(sides.shape[0]):
        high, low = b[most[k]] / ratio[most[k]], b[least[k]] / ratio[least[k]]
        above, below = fabs(ratio[most[k]]), fabs(ratio[least[k]])
        sides[k] = low + above / (above + below) * (high - low)
        if above * below / (above + below) * (high - low) > tol and wrong < 0:
            wrong = k
    return wrong
