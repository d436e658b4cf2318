"""What a campaign has counted: kept in a CSV, and printed as Markdown.

A row of the CSV is a seed, a set of classes, a solver, a class of problems, what is
true of them and an outcome; its count, its time, and the indices of the first problems
with an outcome that is not right. The rows with the outcome "done" tell how many
problems a solver has behind it, and in how many seconds with all that is around them.
"""

import collections
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

from validation.harness import Row, csv_files, tables

COLUMNS = (
    "seed set solver class truth outcome count seconds slowest cases first"
).split()
KEY = COLUMNS[:6]
LISTED = 40  # indices of a class and outcome in the CSV
OUTCOMES = ("right", "refused", "wrong", "raised", "hang", "crash")
NEVER = OUTCOMES[2:]
HEAD = "problems", *OUTCOMES, "mean [ms]"
SOLVED = 0.998  # share that nam must solve of what has a solution
NAMED = 0.99  # share whose lack of a solution nam must prove
NAMELESS = ("infeasible", "unbounded", "both")  # what has no solution
Key = tuple[Any, ...]
Bar = tuple[str, int, int, bool]


class Part(NamedTuple):
    """What is run in one go: problems 0, 1, ... of a set and a seed, by one solver."""

    seed: int
    set: str
    solver: str

    def __str__(self) -> str:
        """Name it in a line of progress."""
        return f"{self.solver}, {self.set}, seed {self.seed}"


class Tally:
    """The counts of a campaign, kept in a CSV; the row "done" tells how far it is."""

    def __init__(self, path: Path, header: list[str]) -> None:
        """Read what an earlier run has left."""
        self.path, self.header = path, header
        self.rows: dict[Key, Row] = {}
        self.done: collections.Counter[Part] = collections.Counter()
        self.seconds: collections.defaultdict[Part, float]
        self.seconds = collections.defaultdict(float)
        for row in read(path):
            if row["outcome"] == "done":
                part = Part(row["seed"], row["set"], row["solver"])
                self.done[part], self.seconds[part] = row["count"], row["seconds"]
            else:
                self.rows[tuple(row[name] for name in KEY)] = row

    def add(self, part: Part, index: int, found: Row) -> None:
        """Count one problem."""
        key = (*part, found["class"], found["truth"], found["outcome"])
        row = self.rows.setdefault(
            key, dict(zip(COLUMNS, (*key, 0, 0.0, 0.0, "", ""), strict=True))
        )
        if found["outcome"] != "right" and row["count"] < LISTED:
            row["cases"] = f"{row['cases']} {index}".strip()
            row["first"] = row["first"] or " ".join(found["why"].split())[:160]
        row["count"] += 1
        row["seconds"] = round(row["seconds"] + found["time"], 4)
        row["slowest"] = max(row["slowest"], round(found["time"], 4))

    def write(self) -> None:
        """Replace the CSV."""
        new = self.path.with_suffix(".part")
        with csv_files.writer(new, self.header, COLUMNS) as write:
            for part, count in self.done.items():
                done = {"outcome": "done", "count": count}
                write(part._asdict() | done | {"seconds": round(self.seconds[part], 3)})
            for key in sorted(self.rows):
                write(self.rows[key])
        os.replace(new, self.path)


def read(path: Path) -> Iterator[Row]:
    """Yield the rows of a CSV with their numbers."""
    for row in csv_files.read(path):
        yield row | {
            "seed": int(row["seed"]),
            "count": int(row["count"]),
            "seconds": float(row["seconds"] or 0.0),
            "slowest": float(row["slowest"] or 0.0),
        }


def total(rows: Iterable[Row], **wanted: Any) -> int:
    """Return the sum of the counts of the rows with these values.

    A value is a text, or a collection of them, or "QP" and "LCP" for a class.
    """
    return sum(
        row["count"]
        for row in rows
        if all(fits(row, key, value) for key, value in wanted.items())
    )


def fits(row: Row, key: str, value: Any) -> bool:
    """Tell whether a row has one of the values."""
    if key == "side":
        return str(row["class"]).startswith(value)
    return row[key] == value if isinstance(value, str) else row[key] in value


def bars(rows: Iterable[Row]) -> list[Bar]:
    """Return what is asked of nam: text, how many, of how many, whether it is met.

    "general" LCPs need not all be decided.
    """
    own = tables.chosen(rows, solver="nam")
    found = []
    for text, share, wanted in (
        ("convex QPs with a solution: solved", SOLVED, ("QP", "solvable")),
        ("QPs without one: called by their name", NAMED, ("QP", NAMELESS)),
        ("LCPs, P or PSD, with a solution: solved", SOLVED, ("LCP", "solvable")),
        ("LCPs, PSD, without one: proved", NAMED, ("LCP", "unsolvable")),
        ("not convex: refused by name, or proved", 1.0, ("QP", "not convex")),
        ("malformed input: named", 1.0, ("malformed", "malformed")),
        ("asked in two ways: agree", SOLVED, ("", "related")),
    ):
        asked = dict(zip(("side", "truth"), wanted, strict=True))
        rows = [row for row in own if row["set"] != "general"]
        good, of = total(rows, **asked, outcome="right"), total(rows, **asked)
        found.append((text, good, of, good >= share * of))
    for outcome in NEVER:
        bad = total(own, outcome=outcome)
        found.append((f"all: {outcome}", bad, total(own), bad == 0))
    return found


def class_lines(rows: list[Row]) -> Iterator[list[Any]]:
    """Yield the line of each class and truth of one solver."""
    for group, truth in tables.distinct(rows, "class", "truth"):
        here = tables.chosen(rows, **{"class": group, "truth": truth})
        counts = [total(here, outcome=outcome) for outcome in OUTCOMES]
        seconds = sum(row["seconds"] for row in here)
        yield [group, truth, sum(counts), *counts, f"{1e3 * seconds / sum(counts):.2f}"]


def peer_lines(rows: list[Row]) -> Iterator[list[Any]]:
    """Yield a line for each solver and kind of truth, on the classes peers have."""
    common = {row["class"] for row in rows if row["solver"] != "nam"}
    kinds = {
        "with a solution": ("solvable",),
        "extreme scales": ("possible",),
        "infeasible": ("infeasible",),
        "unbounded": ("unbounded", "both"),
    }
    for text, truths in kinds.items():
        for solver in tables.distinct(rows, "solver"):
            here = tables.chosen(rows, solver=solver)
            here = [r for r in here if r["class"] in common and r["truth"] in truths]
            counts = [total(here, outcome=outcome) for outcome in OUTCOMES]
            if sum(counts):
                seconds = sum(row["seconds"] for row in here)
                mean = f"{1e3 * seconds / sum(counts):.2f}"
                yield [text, solver, sum(counts), *counts, mean]


def speed_lines(path: Path) -> Iterator[list[Any]]:
    """Yield a line for each set and solver: problems a second, minutes for 3*10^5."""
    done = [row for row in read(path) if row["outcome"] == "done" and row["seconds"]]
    for name, solver in tables.distinct(done, "set", "solver"):
        here = tables.chosen(done, set=name, solver=solver)
        rate = sum(row["count"] for row in here) / sum(row["seconds"] for row in here)
        yield [name, solver, total(here), f"{rate:.0f}", f"{3e5 / rate / 60.0:.0f}"]


def counted(path: Path) -> list[Row]:
    """Return the rows of a CSV that count problems."""
    return [row for row in read(path) if row["outcome"] != "done"]


def of_bars(rows: list[Row]) -> str:
    """Return the table of what is asked of nam."""
    met = {True: "yes", False: "NO"}
    asked = ([*bar[:3], met[bar[3]]] for bar in bars(rows))
    return tables.markdown(("nam", "count", "of", "met"), asked)


def of_solvers(rows: list[Row]) -> str:
    """Return the table of all solvers on the classes that peers have."""
    return tables.markdown(("convex QPs", "solver", *HEAD), peer_lines(rows))


def print_report(path: Path) -> None:
    """Print the tables of a CSV."""
    rows = counted(path)
    own = tables.chosen(rows, solver="nam")
    print(of_bars(rows))
    print("\n" + tables.markdown(("class", "truth", *HEAD), class_lines(own)))
    if len(tables.distinct(rows, "solver")) > 1:
        print("\n" + of_solvers(rows))
    columns = "set", "solver", "problems", "a second", "3*10^5 [min]"
    print("\n" + tables.markdown(columns, speed_lines(path)))
