"""What the figures of all files are made of: ratios, means, counts."""

import math
from collections.abc import Callable
from pathlib import Path

from validation.harness import Row, csv_files, tables, timing

Figures = dict[str, float]


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


def least(values: list[float]) -> float:
    """Return the smallest value, nan of nothing."""
    return min(values, default=math.nan)


def most(values: list[float]) -> float:
    """Return the largest value, nan of nothing."""
    return max(values, default=math.nan)


def solved(rows: list[Row], solver: str = "nam") -> float:
    """Return how many rows of a solver are solved."""
    own = tables.chosen(rows, solver=solver)
    return float(sum(row["success"] == "True" for row in own)) if own else math.nan


def numbers(rows: list[Row], column: str) -> list[float]:
    """Return the numbers of a column, without the entries that are empty or nan."""
    values = (csv_files.number(row[column]) for row in rows)
    return [value for value in values if not math.isnan(value)]


def worst(rows: list[Row], *columns: str) -> float:
    """Return the largest number of these columns, nan of nothing."""
    return most([value for column in columns for value in numbers(rows, column)])


def figures(folder: Path, files: dict[str, Callable[[list[Row]], Figures]]) -> Figures:
    """Return what functions find in the rows of their files; one without rows has none.

    `files` has the functions by the names of the files.
    """
    found: Figures = {}
    for name, source in files.items():
        rows = csv_files.read(folder / f"{name}.csv")
        if rows:
            found |= source(rows)
    return found
