"""Starting points: a guess of x, or the solution of a similar problem."""

from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import refuse_number, vector
from namlcp.qp.problem import QP, Point

# Largest |slack| of an inequality that counts as active at a guess of x, relative to
# 1 + |right-hand side|: the accuracy of a solution in single precision.
ACTIVE = 1e-7


class Guess(NamedTuple):
    """A guess of the solution; all arrays are empty where there is none.

    active (m + 2 n,) int8 is 1 for active rows of G, lower bounds and upper bounds, in
    this order. The multipliers are zero where only x was given.
    """

    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    active: np.ndarray


NO_ENTRIES = np.empty(0)
NO_GUESS = Guess(
    NO_ENTRIES, NO_ENTRIES, NO_ENTRIES, NO_ENTRIES, np.empty(0, dtype=np.int8)
)


def make_guess(qp: QP, x0: Any, warm_start: Any, name: str = "x0") -> Guess:
    """Return the guess that x0 or warm_start makes; the latter overrides x0.

    Raises TypeError or ValueError, in which `name` stands for x0.
    """
    if warm_start is None:
        if x0 is None:
            return NO_GUESS
        x = vector(name, x0, qp.q.size, "q", qp.q.shape)
        refuse_number(name, x, False)
        return Guess(*qp.point(x), active_at(qp, x))
    check_warm_start(warm_start)
    parts: list[Any] = [getattr(warm_start, key) for key in Point._fields]
    if any(part is None for part in parts):  # a Solution without a point
        return NO_GUESS
    x = vector("warm_start.x", parts[0], qp.q.size, "q", qp.q.shape)
    y = vector("warm_start.y", parts[1], qp.b.size, "b", qp.b.shape)
    z = vector("warm_start.z", parts[2], qp.h.size, "h", qp.h.shape)
    z_box = parts[3] if np.size(parts[3]) else np.zeros(x.size)  # no bounds: empty
    z_box = vector("warm_start.z_box", z_box, x.size, "q", qp.q.shape)
    point = Point(x, y, z, z_box)
    if not np.isfinite(np.concatenate(point)).all():  # a certificate, not a point
        return NO_GUESS
    active = np.concatenate((z > 0.0, z_box < 0.0, z_box > 0.0))
    active &= np.isfinite(np.concatenate((qp.h, qp.lb, qp.ub)))
    return Guess(*point, active.astype(np.int8))


def check_warm_start(warm_start: Any) -> None:
    """Raise a TypeError for what has not the parts of a point."""
    if not all(hasattr(warm_start, key) for key in Point._fields):
        raise TypeError(
            "warm_start must be a QPResult or a qpsolvers.Solution, with x, y, z and "
            f"z_box, got {warm_start!r:.60}"
        )


def active_at(qp: QP, x: np.ndarray) -> np.ndarray:
    """Mark the inequalities that hold with equality at x."""
    slack = np.concatenate((qp.h - qp.G @ x, x - qp.lb, qp.ub - x))
    size = 1.0 + np.abs(np.concatenate((qp.h, qp.lb, qp.ub)))
    return (np.isfinite(size) & (np.abs(slack) <= ACTIVE * size)).astype(np.int8)
