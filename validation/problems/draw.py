"""QPs and LCPs with a known solution: what all sets, and the tests, plant them with.

`around` makes the QP that a point solves. The dials are what is passed to it: the rank
and condition of P (`definite`), rows that depend on each other, units, which rows and
bounds hold with equality (slack 0) and which of those are weak (multiplier 0).
"""

from typing import Any, NamedTuple

import numpy as np

Rng = np.random.Generator


class Known(NamedTuple):
    """A QP as P, q, G, h, A, b, lb, ub, and a primal-dual solution of it."""

    qp: tuple[Any, ...]
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray


def around(
    P: Any,
    G: Any,
    A: Any,
    point: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray],
    slack: np.ndarray,
    below: np.ndarray,
    above: np.ndarray,
) -> Known:
    """Return the QP with these matrices that (x, y, z, z_box) solves.

    `slack` are h - G x, `below` and `above` the distances from x to its bounds; the
    point must be complementary to them.
    """
    x, y, z, z_box = point
    q = -(P @ x + G.T @ z + A.T @ y + z_box)
    return Known((P, q, G, G @ x + slack, A, A @ x, x - below, x + above), *point)


def definite(rng: Rng, n: int, condition: float) -> np.ndarray:
    """Return an SPD matrix of random eigenvectors, eigenvalues 1 to 1 / condition."""
    V, _ = np.linalg.qr(rng.standard_normal((n, n)))
    A = (V * np.geomspace(1.0, 1.0 / condition, n)) @ V.T
    return 0.5 * (A + A.T)


def opposite(
    rng: Rng, n: int, scale: np.ndarray | float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return z and w, one of each pair 0 and the other exponential, w times scale."""
    free = rng.random(n) < 0.5
    size = rng.exponential(size=n)
    return np.where(free, size, 0.0), np.where(free, 0.0, size * scale)


def pair(rng: Rng, n: int, both: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    """Return complementary z and w, half of z positive, a share where both are 0."""
    kind = rng.random(n)
    z = rng.exponential(size=n) * (kind < 0.5)
    w = rng.exponential(size=n) * (kind > 0.5 + both)
    return z, w
