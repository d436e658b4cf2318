"""A QP with fewer variables and rows: presolve and substitution, and the way back.

The presolved problem has ranges, lower <= Gx <= upper, and neither infinite, empty or
proportional rows nor fixed variables (lb = ub). Rows c g'x <= d beside g'x <= h are
sides of one range, equations c a'x = d beside a'x = b one equation; the first row of
each such group, found by hashing, is its leader. The multipliers of dropped rows are
zero, those of fixed variables follow from stationarity.

Modelling languages give every residual of a least-squares cost a variable of its own.
A column t without bounds that has the cost p t^2/2 + q_t t, p >= 0, and one entry a_it,
in row i of A, is substituted together with that row:

    t = (b_i - a_i'x) / a_it,  y_i = -(p t + q_t) / a_it,
    P + (p/a_it^2) a_i a_i',   q - (p b_i/a_it + q_t) / a_it a_i

y_i follows from stationarity in t. Columns are substituted only where the products
a_i a_i' do not fill P.
"""

from typing import NamedTuple

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports.libc.math import INFINITY, fabs, floor
from cython.cimports.libc.string import memcpy
from scipy.sparse import csc_array, csr_array

from namlcp.arrays import constant, from_arrays, refuse_size
from namlcp.limits import NEVER, PASS
from namlcp.linalg.csc import (
    add_transposed,
    submatrix,
    times,
    with_squares,
    without_zeros,
)
from namlcp.qp.problem import QP, Guess, Point, check_convex

# Largest ub - lb of a fixed variable, relative to max(1, |lb|); largest relative
# difference between entries of two rows, one row scaled.
FIXED, SAME = 1e-12, 1e-13
# The weight of column j in the key of a row is 1 plus the fractional part of j times
# the golden ratio, which differs from that of any nearby column.
GOLDEN = 0.6180339887498949
# Least |a_it|, relative to the largest entry of its row, against rounding errors.
PIVOT = 1e-3
# FILL, SMALL: most entries that the products a_i a_i' may add to P, for each entry of
# the rows that they replace, and in addition. SHORT: most entries of a_i for which
# a_i a_i' has no more than the removed row and column.


class Groups(NamedTuple):
    """Row i of a matrix is ratio[i] times the leader number[i] of its group.

    number[i] may be UNWANTED or EMPTY, too.
    """

    number: np.ndarray
    ratio: np.ndarray


class Presolved(NamedTuple):
    """min 1/2 x'Px + q'x, A x = b, -sides[1] <= G x <= sides[0], lb <= x <= ub.

    `kept` and `fixed` are columns of `qp`. `side_of` are the rows of qp.G that give
    `sides`, -1 for none, `b_of` the rows of qp.A with the extreme right-hand sides of
    an equation; b is their mean. `contradictions`: (message, y, z), with a proof.
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


def presolve(qp, eps_abs, eps_rel, last=None):
    """Return the smaller problem, P in CSC; reuse matrices of `last` if equal."""
    _, q, _, h, _, b, lb, ub = qp
    kept, fixed, x_fixed = split_columns(lb, ub)
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
        A, A_groups = leading_rows(qp.A, kept, b)
        G, G_groups = leading_rows(qp.G, kept, h)
    tol = eps_abs if eps_abs > 0.0 else eps_rel
    ends, b_of, wrong = merged("A", A.shape[0], A_groups, b, tol)
    found = [(text, y, np.zeros(h.size)) for text, y in wrong]
    sides, side_of, wrong = merged("G", G.shape[0], G_groups, h, tol)
    found += [(text, np.zeros(b.size), z) for text, z in wrong]
    b = 0.5 * (ends[0] - ends[1])
    return Presolved(
        qp, P, q, A, b, G, sides, lb, ub, kept, fixed, x_fixed, b_of, side_of, found,
        A_groups, G_groups,
    )  # fmt: skip


def split_columns(lb, ub):
    """Return the columns to keep, those that their bounds fix, and the values there."""
    n: Py_ssize_t = lb.size
    lower, upper = numbers(lb, n), numbers(ub, n)
    kept, fixed, values = new_indices(n), new_indices(n), new_vector(n)
    keep, fix, value = longs(kept, n), longs(fixed, n), numbers(values, n)
    count: Py_ssize_t = 0
    held: Py_ssize_t = 0
    for j in range(n):
        low, high = lower[j], upper[j]
        is_finite: cython.bint = fabs(low) < INFINITY and fabs(high) < INFINITY
        if is_finite and high - low <= FIXED * max(1.0, fabs(low)):
            fix[held], value[held] = j, 0.5 * (low + high)
            held += 1
        else:
            keep[count] = j
            count += 1
    return kept[:count], fixed[:held], values[:held]


def merged(name, count, groups, values, tol):
    """Return the sides of the groups of rows, the rows that give them, contradictions.

    These are messages and multipliers.
    """
    equal: cython.bint = name == "A"
    (number, ratio), found = groups, []
    rows: Py_ssize_t = values.size
    of, by, own = places(number, rows), numbers(ratio, rows), numbers(values, rows)
    for r in range(rows):  # the first empty one that no x satisfies
        if of[r] == EMPTY and (
            fabs(own[r]) > tol if equal else -INFINITY < own[r] < -tol
        ):
            proof = np.zeros(rows)
            proof[r] = -np.sign(own[r])
            text = f"row {r} of {name} has no free variable, but the right-hand side"
            found.append((f"{text} {own[r]:g}", proof))
            break
    sides, givers = np.empty((2, count)), np.empty((2, count), np.intp)
    k = merge_rows(rows, of, by, own, equal, tol, sides, givers)
    if k >= 0:
        i, j = givers[:, k]
        proof = np.zeros(values.size)
        proof[i], proof[j] = 1.0 / ratio[i], -1.0 / ratio[j]
        found.append((f"rows {i} and {j} of {name} contradict each other", proof))
    return sides, givers, found


# ---- rows that are multiples of each other


def leading_rows(M, columns, sides):
    """Return the leaders of the rows of M[:, columns] in CSR, and the groups.

    Rows whose side is inf are left out.
    """
    C: Matrix
    m: Py_ssize_t = sides.size
    n: Py_ssize_t = columns.size
    most: Py_ssize_t = M.size
    refuse_size("a matrix by rows", most)
    M = take_matrix(cython.address(C), M)
    width: Py_ssize_t = M.shape[1]
    numbered, kept = same_places(width, -1), longs(columns, n)
    column, side = places(numbered, width), numbers(sides, m)
    for k in range(n):
        column[kept[k]] = k
    is_dense: cython.bint = C.starts == cython.NULL
    groups = Groups(same_places(m, EMPTY), new_vector(m))
    number, ratio = places(groups.number, m), numbers(groups.ratio, m)
    fill(ratio, 1.0, m)
    starts, others = same_places(m + 1, 0), new_places(most)
    entries = new_vector(most)
    indptr, indices = places(starts, m + 1), places(others, most)
    data = numbers(entries, most)
    for i in range(m):
        if not side[i] < INFINITY:
            number[i] = UNWANTED
    for line in range(C.lines):
        begin = first_of(cython.address(C), line)
        for t in range(begin, first_of(cython.address(C), line + 1)):
            i = line if is_dense else C.others[t]
            j = t - begin if is_dense else line
            if number[i] == EMPTY and column[j] >= 0 and C.values[t] != 0.0:
                indptr[i] += 1
    for i in range(m):  # indptr[i] is the end of row i, then its beginning
        indptr[i + 1] += indptr[i]
    for line in range(C.lines - 1, -1, -1):
        begin = first_of(cython.address(C), line)
        for t in range(first_of(cython.address(C), line + 1) - 1, begin - 1, -1):
            i = line if is_dense else C.others[t]
            j = t - begin if is_dense else line
            if number[i] == EMPTY and column[j] >= 0 and C.values[t] != 0.0:
                indptr[i] -= 1
                indices[indptr[i]], data[indptr[i]] = column[j], C.values[t]
    count = group_rows(m, n, indptr, indices, data, number, ratio)
    parts = starts[: count + 1], others[: starts[count]], entries[: starts[count]]
    return from_arrays(parts, (count, n), csr_array), groups


def group_rows(m, n, indptr, indices, data, number, ratio):
    """Group proportional rows of a CSR matrix (m, n); return how many groups there are.

    number and ratio are set as in `Groups`, for rows that are not empty; the matrix is
    overwritten by its leaders. The key of a row is sum |a_ij| w_ij / |first a_ij| with
    the weights of GOLDEN, plus 1 where the signs of a_ij and of the first entry differ.
    `keys` has their bits in single precision, so that rounding errors seldom change
    them; `slots` is a hash table with open addressing.
    """
    size: Py_ssize_t = 1 << (2 * m + 1).bit_length()
    mask: cython.longlong = size - 1
    keys, slots = new_places(m), same_places(size, -1)
    key, table = places(keys, m), places(slots, size)
    kept: cython.int = 0
    group: cython.int = 0
    bits: cython.int = 0
    weights = np.empty(n)
    weight = numbers(weights, n)
    for j in range(n):
        weight[j] = 1.0 + GOLDEN * j - floor(GOLDEN * j)
    begin = indptr[0]
    for i in range(m):
        end = indptr[i + 1]
        if begin == end:
            continue
        total = 0.0
        is_positive: cython.bint = data[begin] > 0.0
        for t in range(begin, end):
            is_other: cython.bint = (data[t] > 0.0) != is_positive
            total += fabs(data[t]) * (weight[indices[t]] + is_other)
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
            table[s], number[i], key[kept] = kept, kept, bits
            start = indptr[kept]
            for t in range(end - begin if start < begin else 0):  # they move up
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


def merge_rows(rows, number, ratio, sides, equal, tol, ends, givers):
    """Merge the rows of each group, c g'x <= d or = d, to -ends[1] <= g'x <= ends[0].

    `givers` takes the rows that give these sides, -1 for none. Returns the first group
    without a point in its range, both sides widened by `tol` in the units of their
    rows, or -1.
    """
    count: Py_ssize_t = ends.shape[1]
    least, giver = numbers(ends, 2 * count), longs(givers, 2 * count)
    for k in range(2 * count):
        least[k], giver[k] = INFINITY, -1
    for half in range(2):
        sign = 1.0 - 2.0 * half
        for i in range(rows):
            k, value = number[i] + half * count, sign * sides[i] / ratio[i]
            if number[i] >= 0 and (equal or sign * ratio[i] > 0.0) and value < least[k]:
                least[k], giver[k] = value, i if value > -INFINITY else -1
    for k in range(count):
        i, j = giver[k], giver[count + k]
        if i >= 0 and j >= 0:
            wide = tol / fabs(ratio[i]) + tol / fabs(ratio[j])
            if least[k] + least[count + k] < -wide:
                return k
    return -1


# ---- substitution of free columns


class Substitution(NamedTuple):
    """The QP `user` without the free `columns`, substituted by the rows `by` of A.

    a_it is `pivot`, p is `cost`, and `rest` is A[by, kept]; `kept` and the rows
    `others` of A remain.
    """

    user: QP
    kept: np.ndarray
    columns: np.ndarray
    by: np.ndarray
    pivot: np.ndarray
    cost: np.ndarray
    others: np.ndarray
    rest: csc_array
    P: csc_array
    G: csc_array
    A: csc_array

    @property
    def problem(self):
        user, kept = self.user, self.kept
        q = user.q[kept]
        slope = self.cost * user.b[self.by] / self.pivot + user.q[self.columns]
        add_transposed(self.rest, -slope / self.pivot, q)
        b, lb, ub = user.b[self.others], user.lb[kept], user.ub[kept]
        return QP(self.P, q, self.G, user.h, self.A, b, lb, ub)

    def point(self, x, y, z, z_box, data=1.0):
        user, by, columns = self.user, self.by, self.columns
        x_full, y_full, _, box = user.point()
        x_full[self.kept], y_full[self.others], box[self.kept] = x, y, z_box
        x_full[columns] = data * user.b[by] / self.pivot
        x_full[columns] -= times(self.rest, x) / self.pivot
        gradient = self.cost * x_full[columns] + data * user.q[columns]
        y_full[by] = -gradient / self.pivot
        return Point(x_full, y_full, z, box)

    def guess(self, guess):
        if not guess.x.size:
            return guess
        m, n, kept = self.user.h.size, self.user.q.size, self.kept
        at_row, at_lb, at_ub = np.split(guess.active, (m, m + n))
        active = np.concatenate((at_row, at_lb[kept], at_ub[kept]))
        return Guess(
            guess.x[kept], guess.y[self.others], guess.z, guess.z_box[kept], active
        )


def substitute(qp, last=None, deadline=NEVER):
    """Return the `Substitution` of a sparse QP; None if there is none, or lb > ub.

    Matrices of `last` are reused if those of qp are the same. Raises OutOfTime.
    """
    if last is not None and (
        qp.has_matrices_of(last.user)
        and np.array_equal(np.isinf(qp.lb), np.isinf(last.user.lb))
        and np.array_equal(np.isinf(qp.ub), np.isinf(last.user.ub))
    ):
        return last._replace(user=qp)
    deadline.check(PASS * qp.A.data.size)
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    chosen, parts = same_places(p, -1), np.zeros((3, p))
    find_free_columns(qp, chosen, parts)
    by = (chosen >= 0).nonzero()[0]
    if not by.size or not (qp.lb <= qp.ub).all():
        return None
    deadline.check(PASS * qp.A.data.size)
    others, columns = (chosen < 0).nonzero()[0], chosen[by]
    pivot, cost = parts[0, by], parts[1, by]
    stays = constant(n, True, np.bool_)
    stays[columns] = False
    kept = stays.nonzero()[0]
    P, G, A = (without_zeros(M) for M in (qp.P, qp.G, qp.A))
    rest = submatrix(A, by, kept)
    # the squares added below would hide negative curvature
    check_convex(qp.P, deadline)
    deadline.check()
    priced = cost.nonzero()[0]
    squared = submatrix(rest, priced, np.arange(kept.size))
    weight = cost[priced] / pivot[priced] ** 2
    P = with_squares(submatrix(P, kept, kept), squared, weight, deadline)
    return Substitution(
        qp, kept, columns, by, pivot, cost, others, rest,
        P, submatrix(G, np.arange(m), kept), submatrix(A, others, kept),
    )  # fmt: skip


def find_free_columns(qp, choice, parts):
    """Choose the free columns with the largest entry in their row.

    Row i of A substitutes column choice[i], none where that is -1, as on entry. parts,
    (3, p), 0 on entry: the entry, the cost p, and the largest entry of each row.
    """
    P: Columns
    G: Columns
    A: Columns
    n: Py_ssize_t = qp.q.size
    p: Py_ssize_t = qp.b.size
    some: cython.bint = False
    take_columns(qp.P, n, cython.address(P))
    take_columns(qp.G, n, cython.address(G))
    take_columns(qp.A, n, cython.address(A))
    lb, ub = numbers(qp.lb, n), numbers(qp.ub, n)
    chosen, pivot = places(choice, p), numbers(parts, 3 * p)
    cost, largest = pivot + p, pivot + 2 * p
    for j in range(n):
        if lb[j] > -INFINITY or ub[j] < INFINITY:
            continue
        t = only_entry(cython.address(A), j)
        if t < 0 or only_entry(cython.address(G), j) != NO_ENTRY:
            continue
        i = A.indices[t]
        s = only_entry(cython.address(P), j)
        if s == SEVERAL or (s >= 0 and (P.indices[s] != j or P.data[s] < 0.0)):
            continue
        if fabs(A.data[t]) > fabs(pivot[i]):
            chosen[i], pivot[i] = j, A.data[t]
            cost[i] = P.data[s] if s >= 0 else 0.0
            some = True
    if some:
        for t in range(A.indptr[n]):
            i = A.indices[t]
            largest[i] = max(largest[i], fabs(A.data[t]))
        for i in range(p):
            if fabs(pivot[i]) < PIVOT * largest[i]:
                chosen[i], cost[i] = -1, 0.0
        drop_filling_rows(cython.address(A), n, p, chosen, cost)
    return 0


def only_entry(C, j):
    """Return where the only nonzero entry of column j is, or NO_ENTRY, or SEVERAL."""
    found: Py_ssize_t = NO_ENTRY
    for t in range(C.indptr[j], C.indptr[j + 1]):
        if C.data[t] != 0.0:
            if found != NO_ENTRY:
                return SEVERAL
            found = t
    return found


def drop_filling_rows(A, n, rows, chosen, cost):
    """If the squares of all rows with p > 0 fill P, set chosen[i] = -1 in long ones."""
    counts = np.zeros(rows, np.intp)
    count = longs(counts, rows)
    lengths: cython.longlong = 0
    squares: cython.longlong = 0
    width: cython.longlong = 0
    for j in range(n):
        is_met: cython.bint = False
        for t in range(A.indptr[j], A.indptr[j + 1]):
            if A.data[t] != 0.0 and cost[A.indices[t]] > 0.0:
                count[A.indices[t]] += 1
                is_met = True
        width += is_met
    for i in range(rows):
        if cost[i] > 0.0:
            length = count[i] - 1
            lengths += length
            squares += length * length
            width -= 1  # the column that goes
    if min(squares, width * width) > FILL * lengths + SMALL:
        for i in range(rows):
            if count[i] - 1 > SHORT:
                chosen[i] = -1
    return 0
