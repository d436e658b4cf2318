"""Stage 1: the least shifts as a QP or an LP in x and r."""

from typing import Any

import numpy as np

from namlcp.qp.closest.rows import Rows, beside, chosen, scattered
from namlcp.qp.problem import QP


def least_shifts(rows: Rows) -> QP:
    """Return the QP in (x, r) or the LP in (x, r, -r_A) with the least shifts.

    A row that is not shifted has no r. In norm 1 r is split into two parts >= 0, the
    second one only for equalities.
    """
    n, norm, dense = rows.lb.size, rows.norm, isinstance(rows.C, np.ndarray)
    soft = np.flatnonzero(np.isfinite(rows.weights) & (rows.d < np.inf))
    w = rows.weights[soft]
    signs = -np.ones(soft.size)
    if norm == 1:
        both = soft[rows.is_equality[soft]]
        soft, w = np.append(soft, both), np.append(w, rows.weights[both])
        signs = np.append(signs, np.ones(both.size))
    k = soft.size
    C = beside(rows.C, scattered(soft, np.arange(k), signs, (rows.d.size, k), dense))
    at = n + np.arange(k if norm == 2 else 0)
    P = scattered(at, at, w[: at.size], (n + k, n + k), dense)
    q = np.concatenate((np.zeros(n), w if norm == 1 else np.zeros(k)))
    least = 0.0 if norm == 1 else -np.inf
    return QP(
        P,
        q,
        *both_kinds(C, rows),
        np.append(rows.lb, np.full(k, least)),
        np.append(rows.ub, np.full(k, np.inf)),
    )


def both_kinds(C: Any, rows: Rows) -> tuple[Any, np.ndarray, Any, np.ndarray]:
    """Return the inequalities of the rows and their right sides, and the equalities."""
    m = rows.d.size - rows.p
    at = np.arange(rows.d.size)
    return chosen(C, at[:m]), rows.d[:m], chosen(C, at[m:]), rows.d[m:]
