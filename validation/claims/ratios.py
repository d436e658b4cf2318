"""What the figures of all files are made of: ratios, means, counts."""

import math

from validation.harness import Row, tables, timing


def over(
    rows: list[Row], other: str, time: str = "runtime", ours: str = "nam"
) -> list[float]:
    """Return namlcp's time over another solver's, for each problem both solve."""
    solved = [row for row in rows if row["success"] == "True" and row[time]]
    times = {
        solver: {(row["problem"], row["set"]): float(row[time]) for row in own}
        for solver in (ours, other)
        if (own := tables.chosen(solved, solver=solver))
    }
    base, peer = times.get(ours, {}), times.get(other, {})
    return [base[key] / peer[key] for key in peer if key in base]


def mean(ratios: list[float]) -> float:
    """Return the geometric mean, nan of nothing."""
    return timing.geometric_mean(ratios) if ratios else math.nan


def solved(rows: list[Row], solver: str = "nam") -> float:
    """Return how many rows of a solver are solved."""
    own = tables.chosen(rows, solver=solver)
    return float(sum(row["success"] == "True" for row in own)) if own else math.nan
