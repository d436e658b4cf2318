"""CSV files whose first lines, beginning with #, say what the figures depend on."""

import contextlib
import csv
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

Row = dict[str, Any]
Names = Sequence[str]


@contextlib.contextmanager
def writer(
    path: Path, header: list[str], columns: Names, append: bool = False
) -> Iterator[Callable[[Row], None]]:
    """Yield what writes a row at once; entries of other columns are left out."""
    path.parent.mkdir(parents=True, exist_ok=True)
    goes_on = append and path.exists()
    with path.open("a" if goes_on else "w", buffering=1, newline="") as file:
        form: Any = {"extrasaction": "ignore", "lineterminator": "\n"}
        writer = csv.DictWriter(file, columns, restval="", **form)
        if not goes_on:
            file.writelines(f"# {line}\n" for line in header)
            writer.writeheader()
        yield writer.writerow


class Growing:
    """A CSV file that grows row by row; the columns `keys` tell what it has."""

    def __init__(self, rows: list[Row], keys: Names, write: Any) -> None:
        self.rows, self.keys, self.write = rows, keys, write
        self.known = {self.key(row) for row in rows}

    def key(self, row: Row) -> tuple[str, ...]:
        return tuple(str(row[name]) for name in self.keys)

    def add(self, row: Row) -> Row:
        self.write(row)
        self.rows.append(row)
        self.known.add(self.key(row))
        return row


@contextlib.contextmanager
def growing(
    path: Path, header: list[str], columns: Names, keys: Names, goes_on: bool = True
) -> Iterator[Growing]:
    """Yield the file with the rows that it has; goes_on=False begins it anew."""
    rows = read(path) if goes_on else []
    with writer(path, header, columns, append=goes_on) as write:
        yield Growing(rows, keys, write)


def number(text: Any) -> float:
    return float(text) if text not in ("", None) else float("nan")


def write(file: Path, header: list[str], rows: list[Row]) -> None:
    with writer(file, header, list(rows[0])) as write:
        for row in rows:
            write(row)


def header(file: Path) -> list[str]:
    lines = file.read_text().splitlines()
    return [line[2:].strip() for line in lines if line[:2] == "# "]


def read(file: Path) -> list[Row]:
    if not file.exists():
        return []
    with file.open(newline="") as stream:
        return list(csv.DictReader(line for line in stream if line[0] != "#"))
