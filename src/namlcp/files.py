"""Readers of problem files, which are not trusted.

Nothing is unpickled, evaluated or extracted, and the size that a file claims is checked
before it is unpacked. Every fault is an exception whose text names it.

MPS and QPS files are free or fixed, without blanks in names; the sections ROWS,
COLUMNS, RHS, RANGES, BOUNDS as usual; OBJSENSE; the quadratic part 1/2 x'Px in QUADOBJ
or QSECTION (one triangle of P) or QMATRIX (all of P). The objective is minimised: with
OBJSENSE MAX its sign is changed. A constant in it is left out.
"""

import gzip
import re
import zipfile
from collections.abc import Iterable
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

from namlcp.qp.problem import QP

MOST_BYTES = 2**31
"""Largest size of all arrays of a file together [bytes]."""

SAVED_NONE = re.compile(rb"\](\x94|q.)Nat(\x94|q.)b\.$", re.DOTALL)
"""The end of a pickled array that holds None alone: NumPy's for an absent part."""


def read_problem(path: str) -> Any:
    """Read a qpsolvers.Problem, or A, q and the bounds of an LCP."""
    if path.lower().endswith(".npz"):
        return npz_problem(path)
    if not path.lower().removesuffix(".gz").endswith((".mps", ".qps")):
        raise ValueError("its name must end with .npz, .mps, .qps, .mps.gz or .qps.gz")
    opened: Any = gzip.open if path.lower().endswith(".gz") else open
    with opened(path, "rb") as stream:
        text = stream.read(MOST_BYTES + 1)
    bound(len(text))
    return mps_problem(text.decode("latin-1").splitlines())


def npz_problem(path: str) -> Any:
    """Read what qpsolvers.Problem.save wrote, or an LCP: A, q, and lower and upper."""
    with zipfile.ZipFile(path) as archive, np.load(path, allow_pickle=False) as arrays:
        is_lcp = "P" not in arrays and {"A", "q"} <= {*arrays}
        fields = ("A", "q", "lower", "upper") if is_lcp else QP._fields
        names = [name for name in fields if name in arrays]
        bound(sum(archive.getinfo(f"{name}.npy").file_size for name in names))
        data = {name: read_array(archive, arrays, name) for name in names}
    if is_lcp:
        return tuple(map(data.get, fields))
    for name in ("P", "q"):
        if name not in data:
            raise ValueError(f"it holds no {name}: not a qpsolvers problem")
    return qpsolvers.Problem(**data)


def read_array(archive: zipfile.ZipFile, arrays: Any, name: str) -> np.ndarray | None:
    """Return an array, None where it is a saved None."""
    try:
        array = arrays[name]
    except ValueError as error:
        if SAVED_NONE.search(archive.read(f"{name}.npy")):
            return None
        raise ValueError(
            f"{name} cannot be read (a sparse matrix? save it as a dense one): {error}"
        ) from None
    if array.dtype.kind not in "biuf":
        raise ValueError(f"{name} must hold real numbers, got dtype {array.dtype}")
    return array


def bound(size: int) -> None:
    if size > MOST_BYTES:
        raise ValueError(f"its arrays claim {size:.1e} bytes, allowed are {MOST_BYTES}")


class Model:
    """What the lines of a file say."""

    def __init__(self) -> None:
        self.kinds: dict[str, str] = {}  # by row: L, G, E, or N (an objective)
        self.columns: dict[str, int] = {}
        self.entries: list[tuple[str, int, float]] = []
        self.squares: list[tuple[int, int, float]] = []
        self.sides: dict[str, float] = {}
        self.ranges: dict[str, float] = {}
        self.bounds: dict[int, list[float]] = {}
        self.sign = 1.0

    def read(self, section: str, words: list[str]) -> None:
        if section == "ROWS":
            kind, row = words
            if kind not in ("N", "L", "G", "E"):
                raise ValueError(f"row {row} is of the unknown kind {kind}")
            self.kinds[row] = kind
        elif section == "COLUMNS":
            if "'MARKER'" in words:
                raise ValueError("it has integer variables")
            column = self.columns.setdefault(words[0], len(self.columns))
            pairs = self.pairs(words[1:], self.kinds)
            self.entries += [(row, column, value) for row, value in pairs]
        elif section in ("RHS", "RANGES"):
            sides = self.sides if section == "RHS" else self.ranges
            sides.update(self.pairs(words[len(words) % 2 :], self.kinds))
        elif section == "BOUNDS":
            self.bound(words)
        elif section in ("QUADOBJ", "QSECTION", "QMATRIX"):
            i = self.columns[words[0]]
            for name, value in self.pairs(words[1:], self.columns, "column"):
                j = self.columns[name]
                self.squares.append((i, j, value))
                if section != "QMATRIX" and i != j:
                    self.squares.append((j, i, value))
        elif section == "OBJSENSE":
            sense = words[0].upper()
            if not sense.startswith(("MIN", "MAX")):
                raise ValueError(f"the sense {sense} is unknown")
            self.sign = -1.0 if sense.startswith("MAX") else 1.0
        else:
            raise ValueError(f"the section {section} is unknown")

    def pairs(
        self, words: list[str], known: dict[str, Any], kind: str = "row"
    ) -> list[tuple[str, float]]:
        """Return names and numbers, which alternate; raise for other names, and NaN."""
        if len(words) % 2:
            raise ValueError(f"a line has a name without a number: {' '.join(words)}")
        found = [(words[k], float(words[k + 1])) for k in range(0, len(words), 2)]
        for name, value in found:
            if name not in known:
                raise ValueError(f"there is no {kind} {name}")
            if np.isnan(value):
                raise ValueError(f"the number of the {kind} {name} is NaN")
        return found

    def bound(self, words: list[str]) -> None:
        kind = words[0]
        if kind not in ("FR", "MI", "PL", "UP", "LO", "FX"):
            raise ValueError(f"bounds of the kind {kind} are not of a QP")
        has_value = kind in ("UP", "LO", "FX")
        name = words[1 if len(words) < 3 + has_value else 2]  # the set may have no name
        ends = self.bounds.setdefault(self.columns[name], [0.0, np.inf])
        value = float(words[-1]) if has_value else np.inf
        if kind in ("LO", "FX"):
            ends[0] = value
        elif kind in ("FR", "MI") or (kind == "UP" and value < 0.0 == ends[0]):
            ends[0] = -np.inf  # the last as other readers take it
        if kind in ("FR", "PL", "UP", "FX"):
            ends[1] = value

    def problem(self) -> qpsolvers.Problem:
        n = len(self.columns)
        if n == 0:
            raise ValueError("it has no columns")
        place = {row: i for i, row in enumerate(self.kinds)}
        entries = [(place[row], j, value) for row, j, value in self.entries]
        C = matrix(entries, (len(place), n)).tocsr()
        costs = [place[row] for row, kind in self.kinds.items() if kind == "N"]
        q = C[costs[:1]].toarray().sum(axis=0)
        low, high = np.array([self.interval(row) for row in place]).reshape(-1, 2).T
        P = self.sign * matrix(self.squares, (n, n))
        ends = np.array([self.bounds.get(j, [0.0, np.inf]) for j in range(n)])
        return two_sided(P, self.sign * q, C, low, high, *ends.T)

    def interval(self, row: str) -> tuple[float, float]:
        """Return the sides of a row; those of an objective are infinite."""
        side, kind = self.sides.get(row, 0.0), self.kinds[row]
        width = self.ranges.get(row)
        low = side if kind in "GE" else -np.inf
        high = side if kind in "LE" else np.inf
        if width is None or kind == "N":
            return low, high
        if kind == "G" or (kind == "E" and width >= 0.0):
            return low, side + abs(width)
        return side - abs(width), high


def two_sided(
    P: Any, q: np.ndarray, C: Any, low: np.ndarray, high: np.ndarray, *box: np.ndarray
) -> qpsolvers.Problem:
    """Return the QP with the rows low <= C x <= high, C by rows; box: its bounds."""
    equal = low == high
    above, below = ~equal & np.isfinite(high), ~equal & np.isfinite(low)
    G, h = sp.vstack([C[above], -C[below]], "csc"), np.append(high[above], -low[below])
    A, b = sp.csc_matrix(C[equal]), high[equal]
    rows = (G, h) if h.size else (None, None)
    return qpsolvers.Problem(P, q, *rows, *((A, b) if b.size else (None, None)), *box)


def matrix(
    entries: list[tuple[int, int, float]], shape: tuple[int, int]
) -> sp.csc_matrix:
    """Return a matrix by its entries, row, column and value; repeated ones add up."""
    rows, columns, values = zip(*entries, strict=True) if entries else ((), (), ())
    return sp.csc_matrix((np.array(values, float), (rows, columns)), shape=shape)


def mps_problem(lines: Iterable[str]) -> qpsolvers.Problem:
    model, section = Model(), ""
    for number, line in enumerate(lines, 1):
        words = line.split()
        if not words or line.startswith("*"):
            continue
        if not line[0].isspace():
            section, *words = words[0].upper(), *words[1:]
            if section == "ENDATA":
                break
            if section != "OBJSENSE" or not words:
                continue
        try:
            model.read(section, words)
        except (ValueError, KeyError, IndexError) as error:
            raise ValueError(f"line {number}: {error}") from None
    return model.problem()
