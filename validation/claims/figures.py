"""The figures of claims.toml, computed from the rows of results, and their limits.

A claim is read from one CSV file. Its entries, all but `value` optional:

value: a verb of VERBS and an expression of the columns, "max 1e3 * runtime". With a
    second verb, "min of mean seconds", the first one is of the values of the groups
    that the columns `each` tell apart. "ratio" is that of two other claims.
where: which rows count, an expression of the columns.
over: a solver; the expression is divided by its value for the same problem (the columns
    BY), of the rows that both have. "best" is the least of all others.
when: which values count, an expression of `value` and of the divisor, `other`.
of: the names of the two claims of a ratio.
limit: what the figure has to be, ">= 31".

Expressions are Python's, with numpy's functions; an entry that is empty is nan, and
figures leave nan out.
"""

import itertools
import keyword
import math
import tomllib
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from validation.harness import Row, cli, tables, timing

TABLE = tomllib.loads(Path(__file__).with_name("claims.toml").read_text())
BY = "problem set case scene size level n name"
"""The columns that tell problems apart, those that a file has."""

Figures = dict[str, float]
Spec = dict[str, Any]


class Claim(NamedTuple):
    """A figure and its limit; `limit` is "" where nothing is asked."""

    name: str
    value: float
    limit: str = ""

    @property
    def holds(self) -> bool:
        """Tell whether it is within its limit; False where it was not measured."""
        sense, limit = self.limit.split()
        if sense == "<=":
            return self.value <= float(limit)
        return self.value >= float(limit)


def slope(points: list[tuple[float, float]]) -> float:
    """Return the power of x with which y grows, by least squares of the logarithms."""
    x, y = np.log(points).T
    return float(np.polyfit(x, y, 1)[0]) if x.size > 1 else math.nan


def rise(values: list[float]) -> float:
    """Return by how much a value exceeds the one before it at most, 0 of a fall."""
    return max([0.0, *(b - a for a, b in itertools.pairwise(values))])


VERBS: dict[str, Callable[[list[Any]], float]] = {
    "count": len,
    "sum": sum,
    "share": lambda pairs: sum(x * w for x, w in pairs) / sum(w for _, w in pairs),
    "max": max,
    "min": min,
    "mean": lambda values: float(np.mean(values)),
    "geomean": timing.geometric_mean,
    "median": lambda values: float(np.median(values)),
    "slope": slope,
    "rise": rise,
}
NUMPY = {name: getattr(np, name) for name in ("fmin", "fmax", "isnan", "log10", "inf")}


def said(verb: str, values: list[Any]) -> float:
    counts = verb in ("count", "sum")
    return float(VERBS[verb](values)) if values or counts else math.nan


def typed(texts: Iterable[str]) -> list[Any]:
    known = {"True": True, "False": False}
    try:
        return [known[text] if text in known else tables.number(text) for text in texts]
    except ValueError:
        return list(texts)


def read(file: Path) -> list[Row]:
    """Return the rows of a CSV file; a column `class` is called class_."""
    rows = tables.read(file)
    if not rows:
        return []
    names = [f"{name}_" if keyword.iskeyword(name) else name for name in rows[0]]
    columns = (typed([row[name] for row in rows]) for name in rows[0])
    return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]


def of(rows: list[Row], expression: str) -> list[Any]:
    code = compile(expression, expression, "eval")
    return [eval(code, NUMPY, row) for row in rows]


def where(rows: list[Row], condition: str) -> list[Row]:
    return list(itertools.compress(rows, of(rows, condition)))


def known(values: Iterable[Any]) -> list[Any]:
    return [value for value in values if value == value]


def groups(rows: list[Row], keys: str) -> Iterator[list[Row]]:
    """Yield the rows with the same values of columns, in the order of the file."""
    found: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        found.setdefault(tuple(row[key] for key in keys.split()), []).append(row)
    yield from found.values()


def ratios(rows: list[Row], expression: str, over: str) -> Iterator[Row]:
    """Yield for each problem `other`, and `value`, that of nam over it."""
    keys = " ".join(key for key in BY.split() if rows and key in rows[0])
    for group in groups(rows, keys):
        solvers = (row["solver"] for row in group)
        times = dict(zip(solvers, of(group, expression), strict=True))
        ours = times.pop("nam", math.nan)
        others = times.values() if over == "best" else [times.get(over, math.nan)]
        other = min(known(others), default=math.nan)
        yield {"value": ours / other, "other": other}


def figure(rows: list[Row], spec: Spec) -> float:
    rows = where(rows, spec.get("where", "True"))
    outer, _, rest = spec["value"].rpartition(" of ")
    verb, _, expression = rest.partition(" ")
    expression = expression or "1"
    if "over" in spec:
        values = list(ratios(rows, expression, spec["over"]))
    elif outer:
        parts = groups(rows, spec["each"])
        values = [{"value": said(verb, known(of(part, expression)))} for part in parts]
    else:
        values = [{"value": value} for value in of(rows, expression)]
    if "when" in spec:
        values = where(values, spec["when"])
    return said(outer or verb, known([row["value"] for row in values]))


def specs(table: Row = TABLE["claims"]) -> dict[str, tuple[str, Spec]]:
    files = [pair for part in table.values() for pair in part.items()]
    return {name: (file, spec) for file, own in files for name, spec in own.items()}


def values(folder: Path = cli.RESULTS) -> Figures:
    """Return all figures by name; those of a file that is not there are left out."""
    known = specs()
    files = {file: read(folder / f"{file}.csv") for file, _ in known.values()}
    found = {
        name: figure(files[file], spec)
        for name, (file, spec) in known.items()
        if files[file] and "of" not in spec
    }
    for name, (_, spec) in known.items():
        if "of" in spec and set(spec["of"]) <= set(found):
            one, other = (found[part] for part in spec["of"])
            found[name] = one / other if other else math.nan
    return found


def claims(known: Figures, part: str = "") -> list[Claim]:
    table = TABLE["claims"]
    asked = specs({part: table[part]} if part else table)
    return [
        Claim(name, known.get(name, math.nan), spec["limit"])
        for name, (_, spec) in asked.items()
        if "limit" in spec
    ]
