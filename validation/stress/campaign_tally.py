"""What a campaign has counted: kept in a CSV.

A row of the CSV is a seed, a set of classes, a solver, a class of problems, what is
true of them and an outcome; its count, its time, and the indices of the first problems
with an outcome that is not right. The rows with the outcome "done" tell how many
problems a solver has behind it, and in how many seconds with all that is around them.
"""

import collections
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from validation.harness import Row, csv_files

COLUMNS = (
    "seed set solver class truth outcome count seconds slowest cases first"
).split()
KEY = COLUMNS[:6]
LISTED = 40  # indices of a class and outcome in the CSV
Key = tuple[Any, ...]


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
