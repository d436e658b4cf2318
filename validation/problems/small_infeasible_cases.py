"""Small QPs by construction: infeasible, unbounded, nearly so, treacherous, not convex.

SMALL: name -> (group, truth, eps, data). The data are the arguments of `make`; absent
ones are P = I, q = 0 and no constraints.
"""

from typing import Any

import numpy as np
from qpsolvers import Problem

inf = np.inf
I2, O2 = np.eye(2), np.zeros((2, 2))
Entry = tuple[str, str, float, dict[str, Any]]


def make(P: Any, q: Any = 0.0, lb: Any = None, ub: Any = None, **rows: Any) -> Problem:
    """Return a dense problem; a number stands for a vector of it."""
    P = np.array(P, dtype=float)
    n = P.shape[0]
    arrays = {key: np.array(value, dtype=float) for key, value in rows.items()}
    bounds = [None if v is None else np.zeros(n) + v for v in (lb, ub)]
    return Problem(P, np.zeros(n) + q, lb=bounds[0], ub=bounds[1], **arrays)


INFEASIBLE: dict[str, dict[str, Any]] = {
    "opposite rows": {"P": I2, "G": [[1, 1], [-2, -2]], "h": [1, -4]},
    "opposite rows, cost in one corner": {
        "P": np.diag([1, 0]), "q": [0, 1], "lb": 0, "G": [[1, 1], [-2, -2]],
        "h": [1, -4],
    },
    "three rows": {"P": I2, "G": [[1, 1], [-1, 0], [0, -1]], "h": [1, -1, -1]},
    "cycle of differences": {
        "P": np.eye(3), "G": [[1, -1, 0], [0, 1, -1], [-1, 0, 1]], "h": [-1, -1, -1],
    },
    "row against bounds": {"P": I2, "G": [[1, 1]], "h": [-1], "lb": 0},
    "crossed bounds": {"P": I2, "lb": [0, 1], "ub": [1, 0]},
    "repeated equations": {"P": I2, "A": [[1, 1], [2, 2]], "b": [1, 3]},
    "dependent equations": {
        "P": np.eye(3), "A": [[1, 1, 0], [0, 1, 1], [1, 2, 1]], "b": [1, 1, 3],
    },
    "more equations than unknowns": {
        "P": I2, "A": [[1, 0], [0, 1], [1, 1]], "b": [1, 1, 3],
    },
    "empty equation": {"P": I2, "A": [[0, 0]], "b": [-1]},
    "empty row": {"P": I2, "G": [[0, 0]], "h": [-1]},
    "row of -inf": {"P": I2, "G": [[1, 1]], "h": [-inf]},
    "all fixed": {"P": I2, "G": [[1, 1]], "h": [2], "lb": [1, 2], "ub": [1, 2]},
    "equation against bounds": {"P": I2, "A": [[1, 1]], "b": [5], "lb": 0, "ub": 1},
    "equation against rows": {
        "P": I2, "A": [[1, -1]], "b": [0], "G": [[1, 0], [0, -1]], "h": [0, -1],
    },
    "transport": {
        "P": np.zeros((4, 4)), "q": [1, 2, 2, 1], "lb": 0,
        "A": [[1, 1, 0, 0], [0, 0, 1, 1], [1, 0, 1, 0], [0, 1, 0, 1]],
        "b": [1, 1, 1, 2],
    },
    "one unknown": {"P": [[1]], "G": [[1], [-1]], "h": [-1, 0]},
    "rows of different size": {
        "P": I2, "G": [[1e6, 1e6], [-1, -1]], "h": [1e6, -2],
    },
}  # fmt: skip

UNBOUNDED: dict[str, dict[str, Any]] = {
    "no constraint, linear": {"P": O2, "q": [1, 0]},
    "no constraint, flat direction": {"P": np.diag([1, 0]), "q": [0, -1]},
    "no constraint, flat across": {"P": [[1, -1], [-1, 1]], "q": [-1, -1]},
    "strip": {"P": O2, "q": -1, "G": [[1, -1], [-1, 1]], "h": [1, 1]},
    "quadrant": {"P": O2, "q": [-1, 1], "lb": 0},
    "half-line": {"P": [[0]], "q": -1, "G": [[-1]], "h": [0]},
    "equation": {
        "P": np.diag([1, 1, 0, 0]), "q": [0, 0, -1, 0], "A": [[0, 0, 1, -1]], "b": [0],
    },
    "cone": {
        "P": np.outer([1, -1, 0], [1, -1, 0]), "q": [-1, -1, 1],
        "G": [[1, 0, -3], [0, 1, -3], [-1, -1, 1]], "h": [0, 0, 1],
    },
    "rank one": {"P": np.ones((5, 5)), "q": [-1, 2, 0, 0, 0]},
    "only infinite rows": {"P": O2, "q": [1, -1], "G": [[1, 1]], "h": [inf]},
    "empty row and a ray": {
        "P": np.diag([1, 0]), "q": [0, -1], "G": [[0, 0]], "h": [1],
    },
    "slope 1e-3": {"P": np.diag([1, 0]), "q": [1, -1e-3], "lb": 0},
    "slope 1e-5": {"P": np.diag([1, 0]), "q": [1, -1e-5], "lb": 0},
    "slope 1e-4 along a row": {
        "P": O2, "q": [-1 - 1e-4, 1], "G": [[1, -1]], "h": [1],
    },
}  # fmt: skip

BOTH: dict[str, dict[str, Any]] = {
    "rows and a free variable": {
        "P": np.diag([1, 0]), "q": [0, 1], "G": [[1, 0], [-1, 0]], "h": [-1, 0],
    },
    "linear rows": {"P": O2, "q": [0, -1], "G": [[1, 0], [-1, 0]], "h": [-1, 0]},
    "repeated equations, linear": {
        "P": O2, "q": [1, 0], "A": [[1, 1], [2, 2]], "b": [1, 3],
    },
}  # fmt: skip

# Solvable, though a solver may see a ray or a contradiction.
TREACHEROUS: dict[str, dict[str, Any]] = {
    "solution at 1e9, flat": {"P": [[1e-9]], "q": -1},
    "solution at 1e8, half flat": {"P": np.diag([1, 1e-8]), "q": [0, -1]},
    "solution at 1e8, linear": {"P": O2, "q": [1, 2], "lb": [1e8, 0]},
    "box of 1e9": {"P": O2, "q": [1e-3, -1e-3], "lb": -1e9, "ub": 1e9},
    "far corner of a thin cone": {
        "P": 1e-6 * I2, "q": [1, 0], "G": [[-1e-6, 1]], "h": [-1], "lb": 0,
    },
    "interior of 1e-8": {"P": [[1]], "q": 1, "G": [[1], [-1]], "h": [0, 1e-8]},
    "one point": {
        "P": I2, "q": [-1, 1], "G": [[1, 1], [-1, 0], [0, -1]], "h": [1, -0.5, -0.5],
    },
    "one corner by 1e-9": {
        "P": np.eye(10), "q": 1, "G": -np.ones((1, 10)), "h": [-10 + 1e-9], "ub": 1,
    },
    "nearly dependent equations": {
        "P": I2, "q": [1, 0], "A": [[1, 1], [1, 1 + 1e-7]], "b": [2, 2 + 1e-7],
    },
    "sum of equations, rounded": {
        "P": np.eye(3), "q": 1, "A": [[1, 1, 0], [0, 1, 1], [1, 2, 1]],
        "b": [0.1, 0.2, 0.3],
    },
    "no cost in a cone": {"P": O2, "G": [[1, -2], [-2, 1]], "h": [-1, -1]},
}  # fmt: skip

# The smallest eigenvalue with a unit diagonal is -2e-6 or less; a box holds x.
NOT_CONVEX: dict[str, dict[str, Any]] = {
    name: {"P": P, "lb": -1, "ub": 1}
    for name, P in {
        "negative diagonal": np.diag([1, -1]),
        "negative minor": [[1, 2], [2, 1]],
        "negative by 2e-6": [[1, 1 + 2e-6], [1 + 2e-6, 1]],
        "negative by 1e-4 in three": [[1, -0.50005, -0.5001], [-0.50005, 1, -0.5001],
                                      [-0.5001, -0.5001, 1]],
        "negative, far from the diagonal": np.eye(20)[::-1],
    }.items()
}  # fmt: skip

NEARLY: dict[str, dict[str, Any]] = {}
for margin, eps in ((1e-3, 1e-6), (1e-4, 1e-6), (1e-6, 1e-9), (1e-8, 1e-10)):
    small = f"margin {margin:.0e}"
    NEARLY |= {
        f"pair, {small}": {
            "eps": eps, "P": [[1]], "G": [[1], [-1]], "h": [0, -margin],
        },
        f"triangle, {small}": {
            "eps": eps, "P": I2, "G": [[1, 1], [-1, 0], [0, -1]],
            "h": [1, -0.5, -0.5 - margin],
        },
        f"box, {small}": {
            "eps": eps, "P": np.eye(10), "G": -np.ones((1, 10)), "h": [-10 - margin],
            "ub": 1,
        },
        f"mean, {small}": {
            "eps": eps, "P": O2, "q": [1, 2], "A": np.ones((1, 2)), "b": [-margin],
            "lb": 0,
        },
    }  # fmt: skip

SMALL: dict[str, Entry] = {}
for truth, group, cases in (
    ("infeasible", "small, infeasible", INFEASIBLE),
    ("unbounded", "small, unbounded", UNBOUNDED),
    ("both", "small, both", BOTH),
    ("infeasible", "nearly feasible", NEARLY),
    ("feasible", "treacherous", TREACHEROUS),
    ("not convex", "not convex", NOT_CONVEX),
):
    for name, data in cases.items():
        own = "nearly bounded" if "slope" in name else group
        SMALL[name] = (own, truth, data.pop("eps", 1e-6), data)
