"""What it means to solve an LCP, written out."""

import numpy as np
import pytest
from scipy import sparse

from namlcp import Status

RELATIVE = 1e-9
"""Res of the unit-diagonal LCP over its value at z = clip(0)."""


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


def assert_solves_lcp(result, A, q, lower=0.0, upper=np.inf):
    """The definition: status, bounds, w = A z + q, signs of w by the residual."""
    A = A if sparse.issparse(A) else np.asarray(A, dtype=float)
    q = np.asarray(q, dtype=float)
    assert result.status is Status.SOLVED
    assert np.all(result.z >= lower)
    assert np.all(result.z <= upper)
    np.testing.assert_allclose(result.w, A @ result.z + q, rtol=0, atol=0)
    assert relative_residual(A, q, result.z, lower, upper) <= RELATIVE
    plain = np.maximum(np.minimum(result.w, result.z - lower), result.z - upper)
    assert result.residual == pytest.approx(np.linalg.norm(plain))
