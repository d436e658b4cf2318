"""What it means to solve an LCP, and to prove that it has no solution, written out."""

import numpy as np
import pytest
from scipy import sparse

from namlcp import Status

RELATIVE = 1e-9
"""Res of the unit-diagonal LCP over its value at z = clip(0)."""

CANCELS = 1e-12
"""Entry of A'v, relative to its terms, that counts as 0 in a proof."""


def relative_residual(A, q, z, lower=0.0, upper=np.inf):
    """Return Res of the LCP scaled to a unit diagonal, over Res at z = clip(0)."""
    diagonal = A.diagonal()
    d = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    lower = np.broadcast_to(lower, q.shape) / d
    upper = np.broadcast_to(upper, q.shape) / d

    def residual(z):
        w = d * (A @ (d * z) + q)
        return np.linalg.norm(z - np.clip(z - w, lower, upper))

    size = residual(np.clip(np.zeros(q.size), lower, upper))
    return residual(z / d) / size if size > 0 else residual(z / d)


def assert_consistent(result, A, q, lower=0.0, upper=np.inf):
    """Bounds, w = A z + q and the residual, whatever the status."""
    assert np.all(result.z >= lower)
    assert np.all(result.z <= upper)
    w = A @ result.z + q
    rounding = 1e-15 * (abs(A) @ np.abs(result.z) + np.abs(q))
    assert np.all(np.abs(result.w - w) <= np.sqrt(q.size) * rounding)
    plain = np.maximum(np.minimum(result.w, result.z - lower), result.z - upper)
    assert result.residual == pytest.approx(np.linalg.norm(plain))


def assert_solves_lcp(result, A, q, lower=0.0, upper=np.inf, relative=RELATIVE):
    """The definition: status, bounds, w = A z + q, signs of w by the residual."""
    A = A if sparse.issparse(A) else np.asarray(A, dtype=float)
    q = np.asarray(q, dtype=float)
    assert result.status is Status.SOLVED, result
    assert_consistent(result, A, q, lower, upper)
    assert relative_residual(A, q, result.z, lower, upper) <= relative


def assert_proves_unsolvable(v, A, q, lower=0.0, upper=np.inf, cancels=CANCELS):
    """v_i w_i >= 0 for every solution, but v'w = q'v + z'A'v <= -1 in the whole box.

    So v_i is 0 unless z_i has a bound on one side alone.
    """
    A = A if sparse.issparse(A) else np.asarray(A, dtype=float)
    q = np.asarray(q, dtype=float)
    lower, upper = np.broadcast_to(lower, q.shape), np.broadcast_to(upper, q.shape)
    assert np.isfinite(v).all()
    assert not ((v > 0.0) & (upper < np.inf)).any()
    assert not ((v < 0.0) & (lower > -np.inf)).any()
    s, terms = A.T @ v, abs(A).T @ np.abs(v)
    side = np.where(s > 0.0, upper, lower)
    moving = np.isfinite(side) | (np.abs(s) > cancels * terms)
    assert q @ v + side[moving] @ s[moving] == pytest.approx(-1.0, abs=1e-6)
    rounding = np.abs(q) @ np.abs(v) + np.abs(side[moving]) @ terms[moving]
    assert CANCELS * rounding <= 1.0
