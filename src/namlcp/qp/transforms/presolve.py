"""Presolve: redundant rows and fixed variables are dropped, and mapped back.

The presolved problem has ranges, lower <= Gx <= upper, and neither infinite, empty or
proportional rows nor fixed variables (lb = ub). Rows c g'x <= d beside g'x <= h are
sides of one range, equations c a'x = d beside a'x = b one equation; the first row of
each such group, found by hashing, is its leader. The multipliers of dropped rows are
zero, those of fixed variables follow from stationarity.
"""

from typing import NamedTuple

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY, fabs, floor
from cython.cimports.libc.string import memcpy
from scipy.sparse import csc_array, csr_array

from namlcp.checks import from_arrays, no_rows
from namlcp.entries import constant
from namlcp.linalg.csc import (
    add_transposed,
    arrays_of,
    by_rows,
    submatrix,
    times,
    without_zeros,
)
from namlcp.qp.problem import QP, Point

# Largest ub - lb of a fixed variable, relative to max(1, |lb|).
FIXED = 1e-12
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


class Presolved(NamedTuple):
    """The smaller problem of `qp` and the way back to it.

    min 1/2 x'Px + q'x, A x = b, -sides[1] <= G x <= sides[0], lb <= x <= ub; A and G in
    CSR. `kept` and `fixed` are columns of `qp`. `side_of` are the rows of qp.G that
    give `sides`, -1 for none, `b_of` the rows of qp.A with the extreme right-hand sides
    of an equation; b lies between. `contradictions` are reasons, (message, y, z) with
    multipliers of rows as proof.
    """

    qp: QP
    P: csc_array
    q: np.ndarray
    A: csr_array
    b: np.ndarray
    G: csr_array
    sides: np.ndarray
    lb: np.ndarray
    ub: np.ndarray
    kept: np.ndarray
    fixed: np.ndarray
    x_fixed: np.ndarray
    b_of: np.ndarray
    side_of: np.ndarray
    contradictions: list[tuple[str, np.ndarray, np.ndarray]]
    A_groups: Groups
    G_groups: Groups

    def guess(self, guess):
        """Return (x, y, z, z_box, active) of a guess for `qp`; z: of `sides`, (2, m).

        active: whether these sides, upper and lower bounds are.
        """
        y = (guess.y * self.A_groups.ratio)[self.b_of]
        y[1, self.b_of[0] == self.b_of[1]] = 0.0
        # with an entry for -1, no row
        z = np.append(guess.z * np.abs(self.G_groups.ratio), 0.0)[self.side_of]
        m, n = guess.z.size, guess.x.size
        row, lb, ub = np.split(guess.active != 0, (m, m + n))
        sides = np.append(row, False)[self.side_of].ravel()
        active = np.concatenate((sides, ub[self.kept], lb[self.kept]))
        return guess.x[self.kept], y.sum(0), z, guess.z_box[self.kept], active

    def point(self, x, y, z, z_box, data=1.0):
        """Return the point of `qp`; z_box of a fixed variable makes its residual 0.

        z: of `sides`, (2, m). The multipliers of dropped rows are 0; the two extreme
        rows of an equation share its y so that b'y does not change.
        """
        qp, (full, y_full, z_full, _) = self.qp, self.qp.point()
        share_out(y, self.b_of, self.A_groups.ratio, y_full)
        hand_on(z, self.side_of, self.G_groups.ratio, z_full)
        if not self.fixed.size:
            return Point(x, y_full, z_full, z_box)
        full[self.kept], full[self.fixed] = x, data * self.x_fixed
        box = times(qp.P, full) + data * qp.q
        add_transposed(qp.A, y_full, box)
        add_transposed(qp.G, z_full, box)
        box *= -1.0
        box[self.kept] = z_box
        return Point(full, y_full, z_full, box)


def presolve(qp, eps_abs, eps_rel, last=None):
    """Return the smaller problem of a QP in CSC; reuse the matrices of `last` if equal.

    The tolerances decide which constraints contradict each other.
    """
    _, q, _, h, _, b, lb, ub = qp
    stays = constant(q.size, True, np.bool_)
    find_fixed(lb, ub, stays)
    kept, fixed = stays.nonzero()[0], (~stays).nonzero()[0]
    x_fixed = 0.5 * (lb[fixed] + ub[fixed])
    if fixed.size:
        held = np.zeros(q.size)
        held[fixed] = x_fixed
        q = (q + times(qp.P, held))[kept]
        b, h = b - times(qp.A, held), h - times(qp.G, held)
        lb, ub = lb[kept], ub[kept]
    if last is not None and (
        qp.has_matrices_of(last.qp)
        and np.array_equal(fixed, last.fixed)
        and np.array_equal(qp.h < np.inf, last.G_groups.number != UNWANTED)
    ):
        P, A, G = last.P, last.A, last.G
        A_groups, G_groups = last.A_groups, last.G_groups
    else:
        P = submatrix(qp.P, kept, kept)
        A, A_groups = leading_rows(qp.A, kept, constant(b.size, True, np.bool_))
        G, G_groups = leading_rows(qp.G, kept, h < np.inf)
    tol = eps_abs if eps_abs > 0.0 else eps_rel
    ends, b_of, wrong = merged("A", A_groups, b, tol)
    found = [(text, y, np.zeros(h.size)) for text, y in wrong]
    sides, side_of, wrong = merged("G", G_groups, h, tol)
    found += [(text, np.zeros(b.size), z) for text, z in wrong]
    b = between(ends, b_of, A_groups.ratio)
    return Presolved(
        qp, P, q, A, b, G, sides, lb, ub, kept, fixed, x_fixed, b_of, side_of, found,
        A_groups, G_groups,
    )  # fmt: skip


def find_fixed(lb, ub, stays):
    """Clear the marks of the columns that their bounds fix."""
    for j in range(lb.shape[0]):
        if fabs(lb[j]) < INFINITY and fabs(ub[j]) < INFINITY:
            stays[j] = not ub[j] - lb[j] <= FIXED * max(1.0, fabs(lb[j]))


def share_out(y, rows, ratio, full):
    """Add the multipliers of equations, (p,), to those of their two extreme rows."""
    for half in range(2):
        for k in range(rows.shape[1]):
            i, weight = rows[half, k], fabs(ratio[rows[0, k]]) + fabs(ratio[rows[1, k]])
            full[i] += y[k] / weight if ratio[i] > 0.0 else -(y[k] / weight)


def hand_on(z, rows, ratio, full):
    """Set the multipliers of the rows that give sides, from those of the sides."""
    for half in range(2):
        for k in range(rows.shape[1]):
            i = rows[half, k]
            if i >= 0:
                full[i] = z[half, k] / fabs(ratio[i])


def between(ends, rows, ratio):
    """Return the b from which the two extreme rows of equations differ by as much."""
    found = np.empty(rows.shape[1])
    b: cython.double[::1] = found
    for k in range(rows.shape[1]):
        own, other = fabs(ratio[rows[0, k]]), fabs(ratio[rows[1, k]])
        b[k] = ends[0, k] - other / (own + other) * (ends[0, k] + ends[1, k])
    return found


def merged(name, groups, values, tol):
    """Return the sides of each group of rows of A or G, and the rows that give them.

    Contradictions are returned, too: messages and multipliers.
    """
    equal, (number, ratio, first) = name == "A", groups
    found = []
    i = wrong_empty_row(number, values, equal, tol)
    if i >= 0:
        proof = np.zeros(values.size)
        proof[i] = -np.sign(values[i])
        text = f"row {i} of {name} has no free variable, but the right-hand side"
        found.append((f"{text} {values[i]:g}", proof))
    sides, givers = np.empty((2, first.size)), np.empty((2, first.size), np.intp)
    k = merge_rows(number, ratio, values, equal, tol, sides, givers)
    if k >= 0:
        i, j = givers[:, k]
        proof = np.zeros(values.size)
        proof[i], proof[j] = 1.0 / ratio[i], -1.0 / ratio[j]
        found.append((f"rows {i} and {j} of {name} contradict each other", proof))
    return sides, givers, found


# ---- rows that are multiples of each other


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
