"""Stage 1: the least shifts as a QP or an LP in x and r."""

from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.checks import sparse_matrix
from namlcp.qp.closest.rows import Rows, beside, chosen
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
    E = sp.csc_array((signs, (soft, np.arange(k))), shape=(rows.d.size, k))
    C = beside(rows.C, E.toarray() if dense else E)
    squares = np.concatenate((np.zeros(n), w if norm == 2 else np.zeros(k)))
    q = np.concatenate((np.zeros(n), w if norm == 1 else np.zeros(k)))
    least = 0.0 if norm == 1 else -np.inf
    return QP(
        np.diag(squares) if dense else diagonal(squares),
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


def diagonal(entries: np.ndarray) -> Any:
    """Return the diagonal matrix with these entries, zeros not stored."""
    at = np.flatnonzero(entries)
    shape = entries.size, entries.size
    return sparse_matrix("P", sp.csc_array((entries[at], (at, at)), shape=shape), "csc")
