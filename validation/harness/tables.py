"""Rows as tables: CSV files, Markdown, columns that are printed.

The first lines of a CSV file, beginning with #, say what the figures depend on.
"""

import contextlib
import csv
from collections.abc import Iterable, Iterator, Sequence
from operator import itemgetter
from pathlib import Path
from typing import Any

Row = dict[str, Any]
Names = Sequence[str]


class Growing:
    """A CSV file that grows row by row; the columns `keys` tell what it has."""

    def __init__(self, rows: list[Row], keys: Names, write: Any) -> None:
        self.rows, self.keys, self.write = rows, keys, write
        self.known = {self.key(row) for row in rows}

    def key(self, row: Row) -> tuple[str, ...]:
        return tuple(str(row[name]) for name in self.keys)

    def add(self, row: Row) -> Row:
        """Write a row at once; entries of other columns are left out."""
        self.write(row)
        self.rows.append(row)
        self.known.add(self.key(row))
        return row


@contextlib.contextmanager
def growing(
    path: Path, header: Names, columns: Names, keys: Names = (), goes_on: bool = True
) -> Iterator[Growing]:
    """Yield the file with the rows that it has; goes_on=False begins it anew."""
    goes_on = goes_on and path.exists()
    rows = read(path) if goes_on else []
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a" if goes_on else "w", buffering=1, newline="") as file:
        form: Any = {"extrasaction": "ignore", "lineterminator": "\n"}
        writer = csv.DictWriter(file, columns, restval="", **form)
        if not goes_on:
            file.writelines(f"# {line}\n" for line in header)
            writer.writeheader()
        yield Growing(rows, keys, writer.writerow)


def write(path: Path, header: Names, rows: list[Row]) -> None:
    with growing(path, header, list(rows[0]), goes_on=False) as file:
        for row in rows:
            file.add(row)


def read(file: Path) -> list[Row]:
    if not file.exists():
        return []
    with file.open(newline="") as stream:
        return list(csv.DictReader(line for line in stream if line[0] != "#"))


def header(file: Path) -> list[str]:
    lines = file.read_text().splitlines()
    return [line[2:].strip() for line in lines if line[:2] == "# "]


def number(text: Any) -> float:
    return float(text) if text not in ("", None) else float("nan")


def distinct(rows: Iterable[Row], *keys: str) -> list[Any]:
    """Return the different values of a column, or tuples of several, in their order."""
    return list(dict.fromkeys(map(itemgetter(*keys), rows)))


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


def print_row(row: Row, columns: str) -> None:
    """Print entries of a row; `columns` has names, or "name:width"."""
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
