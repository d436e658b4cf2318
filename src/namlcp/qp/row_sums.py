"""Equalities with huge right sides, met in the order in which their sums are added.

The right sides of BOYD1 reach 4e12, where doubles are 5e-4 apart: a residual b_i -
a_i'x as it is computed is 0 or a multiple of that, and adding 9e4 terms leaves a
hundred of these units, however exact x is. What can be had is an x whose sums come out
as b:

1. Steps dx = W A'(A W A')^-1 r of all variables inside their bounds, for the residual r
   as it is computed. The changed terms round anew, but a small dx changes few
   roundings, so that a few units are left. W = diag(1 / p_jj^2) keeps P dx small.
2. A row does not see what is beyond its last column. So the rows that end first come
   first; rows that end at about the same column form a group. Such steps by a random
   half of the last variables of a group, in which only the ends of the sums are added
   again, are taken until all its residuals are within the tolerance.
"""

from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.qp.problem import QP

# Steps of all variables, and most steps of a group.
STEPS, TRIES = 4, 1500
# Variables for each row of a group, and columns between the ends of rows of one group.
WIDTH, APART = 300, 40
# A variable is inside if it is so far from its bounds, relative to 1 + |x|.
INSIDE = 1e-6
# Least p_jj that counts in W, relative to the largest.
LEAST_CURVATURE = 1e-3
# A step that gains nothing, but leaves no more residuals above the tolerance, is taken
# with this probability.
SIDEWAYS = 0.2


class Row(NamedTuple):
    """A row of A from some column on: columns, entries, the sum before, b_i."""

    columns: np.ndarray
    entries: np.ndarray
    before: float
    side: float

    def residual(self, x: np.ndarray) -> float:
        """Return b_i - a_i'x, added from the first column to the last."""
        terms = np.append(self.before, self.entries * x[self.columns])
        return float(self.side - np.cumsum(terms)[-1])

    def tail(self, first: int, x: np.ndarray) -> "Row":
        """Return the row from column `first` on."""
        k = np.searchsorted(self.columns, first)
        terms = np.append(self.before, self.entries[:k] * x[self.columns[:k]])
        before = float(np.cumsum(terms)[-1])
        return Row(self.columns[k:], self.entries[k:], before, self.side)


def meet_equalities(qp: QP, x: np.ndarray, tol: float) -> np.ndarray:
    """Return x changed so that more of |b - Ax|, as it is computed, are at most tol."""
    x = x.copy()
    room = np.minimum(x - qp.lb, qp.ub - x)
    inside = room > INSIDE * (1.0 + np.abs(x))
    A = sp.csr_array(qp.A)
    A.sort_indices()
    curvature = np.asarray(qp.P.diagonal())
    largest = curvature.max(initial=0.0)
    weight = np.ones(x.size)
    if largest > 0.0:
        weight = np.maximum(curvature / largest, LEAST_CURVATURE) ** -2.0
    weight[~inside] = 0.0
    for _ in range(STEPS):
        x += least_change(A, weight, qp.b - qp.A @ x)
    rows = [
        Row(A.indices[start:stop], A.data[start:stop], 0.0, side)
        for start, stop, side in zip(A.indptr, A.indptr[1:], qp.b, strict=False)
    ]
    rng = np.random.default_rng(0)
    before = -1
    for group in groups(rows, inside):
        columns = np.unique(np.concatenate([row.columns for row in group]))
        columns = columns[inside[columns] & (columns > before)]
        columns = columns[-WIDTH * len(group) :]
        if columns.size:
            settle(group, columns, weight, x, tol, rng)
            before = columns[-1]
    return x


def least_change(A: Any, weight: np.ndarray, r: np.ndarray) -> np.ndarray:
    """Return W A'(A W A')^-1 r, the dx of A dx = r with the least dx' W^-1 dx."""
    scale = 1.0 / np.sqrt(np.maximum((A * A) @ weight, np.finfo(float).tiny))
    if sp.issparse(A):
        M = sp.diags_array(scale) @ A
        normal = (M @ sp.diags_array(weight) @ M.T).toarray()
    else:
        M = scale[:, None] * A
        normal = (M * weight) @ M.T
    multipliers = np.linalg.lstsq(normal, scale * r, rcond=1e-15)[0]
    return weight * (M.T @ multipliers)


def groups(rows: list[Row], inside: np.ndarray) -> list[list[Row]]:
    """Return the rows by the last column that can change, close ones together."""
    ends = [np.max(row.columns[inside[row.columns]], initial=-1) for row in rows]
    found: list[list[Row]] = []
    last = -np.inf
    for k in np.argsort(ends, kind="stable"):
        if ends[k] - last > APART:
            found.append([])
        found[-1].append(rows[k])
        last = ends[k]
    return found


def settle(
    group: list[Row],
    columns: np.ndarray,
    weight: np.ndarray,
    x: np.ndarray,
    tol: float,
    rng: np.random.Generator,
) -> None:
    """Overwrite x in these columns until the rows of the group are within tol."""
    tails = [row.tail(columns[0], x) for row in group]

    def residuals(trial: np.ndarray) -> np.ndarray:
        return np.array([row.residual(trial) for row in tails])

    B = np.zeros((len(group), columns.size))
    for i, row in enumerate(tails):
        known = np.isin(row.columns, columns)
        B[i, np.searchsorted(columns, row.columns[known])] = row.entries[known]
    trial, r = x.copy(), residuals(x)
    units = np.maximum(tol, [np.spacing(abs(row.side)) for row in group])

    def missed(r: np.ndarray) -> tuple[int, float]:
        """Return how many residuals exceed the tolerance, and the most units."""
        return int(np.sum(np.abs(r) > tol)), float(np.max(np.abs(r) / units))

    least = missed(r)
    for _ in range(TRIES):
        if least[0] == 0:
            return
        half = np.where(rng.random(columns.size) < 0.5, weight[columns], 0.0)
        trial[columns] = x[columns] + least_change(B, half, r)
        new = residuals(trial)
        rank = missed(new)
        if rank < least or (rank[0] == least[0] and rng.random() < SIDEWAYS):
            x[columns], r, least = trial[columns], new, rank
