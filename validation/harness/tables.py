"""Rows as tables."""

import math
from collections.abc import Iterable, Iterator
from typing import Any

from validation.harness import timing
from validation.harness.csv_files import Row, number


def distinct(rows: Iterable[Row], *keys: str) -> list[Any]:
    """Return the different values of a column, or tuples of several, in their order."""
    if len(keys) == 1:
        return list(dict.fromkeys(row[keys[0]] for row in rows))
    return list(dict.fromkeys(tuple(row[key] for key in keys) for row in rows))


def chosen(rows: Iterable[Row], **wanted: Any) -> list[Row]:
    return [row for row in rows if all(row[k] == v for k, v in wanted.items())]


def markdown(columns: Iterable[Any], lines: Iterable[Iterable[Any]]) -> str:
    head = [str(column) for column in columns]
    text = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    text += ["| " + " | ".join(str(cell) for cell in line) + " |" for line in lines]
    return "\n".join(text)


def short(value: float) -> str:
    """Return a number with three digits, without an exponent where it is large."""
    return f"{value:.0f}" if value >= 999.5 else f"{value:.3g}"


COMPARED = ("solver", "solved", "time [ms]", "nam/solver (both solve)")
"""The columns of what `compared` yields."""


def compared(rows: list[Row], *about: str) -> Iterator[tuple[str, ...]]:
    """Yield a line for each solver: what it solves, its time, ours over it.

    Rows have the columns `about` a problem, "solver", "success" and "runtime" [s];
    times are geometric means of those that were taken.
    """
    times: dict[str, dict[Any, float]] = {s: {} for s in distinct(rows, "solver")}
    for row in rows:
        if str(row["success"]) == "True":
            problem = tuple(row[name] for name in about)
            times[row["solver"]][problem] = number(row["runtime"])
    total, base = len({tuple(r[k] for k in about) for r in rows}), times.get("nam", {})
    for solver, own in times.items():
        known = {name: time for name, time in own.items() if not math.isnan(time)}
        mean = 1e3 * timing.geometric_mean(list(known.values()))
        ratios = [base[name] / known[name] for name in known if name in base]
        over = f"{timing.geometric_mean(ratios):.2f} ({len(ratios)})"
        ratio = over if ratios and solver != "nam" else ""
        yield solver, f"{len(own)}/{total}", short(mean), ratio


def print_row(row: Row, columns: str) -> None:
    """Print entries of a row on a line, blanks for those that it has not.

    `columns` names them, as "name:width" where 12 characters do not suit.
    """
    cells = []
    for column in columns.split():
        name, _, width = column.partition(":")
        value = "" if row.get(name) is None else row[name]
        shown = f"{value:.3g}" if isinstance(value, float) else str(value)
        most = int(width or 12)
        cells.append(f"{shown:<{most}.{most}}")
    print(" ".join(cells).rstrip(), flush=True)


def print_rows(rows: Iterable[Row], columns: str) -> None:
    print()
    names = [column.partition(":")[0] for column in columns.split()]
    for row in (dict(zip(names, names, strict=True)), *rows):
        print_row(row, columns)
