"""The claims: figures and what they have to be."""

import math
from pathlib import Path
from typing import NamedTuple

from validation.claims.measured import values
from validation.harness import cli, tables


class Claim(NamedTuple):
    """A figure and what it has to be; `sense` is "<=" or ">="."""

    name: str
    value: float
    sense: str
    limit: float

    @property
    def holds(self) -> bool:
        """Tell whether it is within its limit; False where it was not measured."""
        if self.sense == "<=":
            return self.value <= self.limit
        return self.value >= self.limit


LIMITS = {
    "mpc solved": (">=", 31), "mpc over daqp": ("<=", 1.0),
    "contact solved": (">=", 12), "contact over piqp": ("<=", 0.4),
    "small solved": (">=", 19), "small over piqp": ("<=", 1.0),
    "Maros-Meszaros solved at 1e-6": (">=", 134),
    "Maros-Meszaros solved at 1e-9": (">=", 128),
    "Maros-Meszaros over piqp": ("<=", 0.9),
    "Maros-Meszaros over piqp, below 1 ms": ("<=", 1.2),
    "Maros-Meszaros over piqp, 1 to 10 ms": ("<=", 1.0),
    "Maros-Meszaros over piqp, above 10 ms": ("<=", 0.7),
    "Maros-Meszaros over piqp, worst": ("<=", 3.0),
    "classes missed": ("<=", 0), "classes over best peer": ("<=", 0.7),
    "classes over best peer, worst": ("<=", 1.3),
    "without a solution, not recognised": ("<=", 0),
    "without a solution over clarabel": ("<=", 0.6),
    "large over one linear solve, worst": ("<=", 2.0),
    "cvxpy small over clarabel": ("<=", 1.0), "cvxpy large over clarabel": ("<=", 0.35),
    "condensed MPC over daqp": ("<=", 1.0), "portfolio over daqp": ("<=", 0.5),
    "sparse MPC, definite over daqp": ("<=", 0.6),
    "sequences, worst residual": ("<=", 1e-9),
    "sequences, worst difference": ("<=", 1e-9),
    "campaign wrong": ("<=", 0),
}  # fmt: skip
"""What the claims have to be, those of the issues; other values have no limit."""


def claims(folder: Path = cli.RESULTS) -> list[Claim]:
    """Return the figures that have a limit."""
    found = values(folder)
    return [
        Claim(name, found.get(name, math.nan), *limit) for name, limit in LIMITS.items()
    ]


def summary(folder: Path = cli.RESULTS) -> str:
    """Return the table of what is asked and what was measured."""
    lines = (
        (claim.name, f"{claim.sense} {claim.limit:g}", f"{claim.value:.3g}",
         "yes" if claim.holds else "NO")
        for claim in claims(folder)
    )  # fmt: skip
    return tables.markdown(("quantity", "limit", "measured", "met"), lines)


def moved(before: list[Claim], now: list[Claim]) -> str:
    """Return a table of two runs' claims; what fell is marked."""
    lines = []
    for old, new in zip(before, now, strict=True):
        word = "holds" if new.holds else "FELL" if old.holds else "falls short"
        limit = f"{new.sense} {new.limit:g}"
        lines.append((new.name, limit, f"{old.value:.3g}", f"{new.value:.3g}", word))
    return tables.markdown(("claim", "limit", "before", "now", ""), lines)
