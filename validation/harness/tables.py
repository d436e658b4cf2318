"""Rows as tables."""

from collections.abc import Iterable
from typing import Any

from validation.harness.csv_files import Row


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
