"""Where to start: a guess of x, or the full state of a similar problem's solution."""

from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import QPData, refuse_number, vector

# A row counts as active at a guess of x within this, relative to 1 + |its side|.
NEAR = 1e-7


class Guess(NamedTuple):
    """A guess of x (n,) and of the active inequalities; both empty where there is none.

    active (m + 2 n,) is 1 for the active ones among the rows of G, the lower and the
    upper bounds, in this order.
    """

    x: np.ndarray
    active: np.ndarray

    @property
    def point(self) -> np.ndarray | None:
        """Return x, or None where there is no guess."""
        return self.x if self.x.size else None


NO_GUESS = Guess(np.empty(0), np.empty(0, dtype=np.int8))


def make_guess(qp: QPData, x0: Any, warm_start: Any, name: str = "x0") -> Guess:
    """Check what the user offers as a start; a warm start overrides x0.

    Raises TypeError or ValueError naming it; `name` is how the host calls x0.
    """
    if warm_start is None:
        if x0 is None:
            return NO_GUESS
        x = vector(name, x0, qp.q.size, "q", qp.q.shape)
        refuse_number(name, x, False)
        return Guess(x, active_at(qp, x))
    parts: list[Any] = [getattr(warm_start, key, None) for key in ("x", "z", "z_box")]
    if any(part is None for part in parts):
        raise TypeError(
            "warm_start must be a QPResult or a qpsolvers.Solution, with x, z and "
            f"z_box, got {warm_start!r:.60}"
        )
    x = vector("warm_start.x", parts[0], qp.q.size, "q", qp.q.shape)
    z = vector("warm_start.z", parts[1], qp.h.size, "h", qp.h.shape)
    z_box = parts[2] if np.size(parts[2]) else np.zeros(x.size)  # no bounds: empty
    z_box = vector("warm_start.z_box", z_box, x.size, "q", qp.q.shape)
    if not np.isfinite(x).all():  # the proof of an infeasible problem is no start
        return NO_GUESS
    return Guess(x, np.concatenate((z > 0.0, z_box < 0.0, z_box > 0.0)).astype(np.int8))


def active_at(qp: QPData, x: np.ndarray) -> np.ndarray:
    """Mark the inequalities that hold with equality at x."""
    slack = np.concatenate((qp.h - qp.G @ x, x - qp.lb, qp.ub - x))
    size = 1.0 + np.abs(np.concatenate((qp.h, qp.lb, qp.ub)))
    return (np.isfinite(size) & (np.abs(slack) <= NEAR * size)).astype(np.int8)
