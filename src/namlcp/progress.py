"""Every character that the package prints, and the history with the same columns."""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TextIO

import numpy as np

Report = Callable[..., None] | None
"""What a loop calls for every row, as `Progress.row`; None where nobody looks."""

SILENCE = 2.0
"""So long [s] nothing is printed at the most while rows come in."""

QP_COLUMNS = ("iter", "primal", "dual", "gap", "step", "active")
LCP_COLUMNS = ("iter", "residual", "active")
COUNTS = ("iter", "active")


class Progress:
    """Rows of one solve: kept for the history, printed when verbose.

    Parameters
    ----------
    columns : tuple of str
        Names of the columns; the time [s] since the start is added as the last.
    verbose : bool
        Print, on `stream` (standard output unless given).
    """

    def __init__(
        self, columns: tuple[str, ...], verbose: bool, stream: TextIO | None = None
    ):
        self.columns = (*columns, "time")
        self.verbose = verbose
        self.stream = stream
        self.start = time.perf_counter()
        self.rows: list[tuple] = []
        self.shown = True
        self.last = self.start  # when a row was printed

    def say(self, text: str) -> None:
        """Print one line if verbose."""
        if self.verbose:
            print(text, file=self.stream or sys.stdout, flush=True)

    def announce(self, kernel: Any) -> None:
        """Say, before the first call ever of a compiled `kernel`, that it compiles."""
        if self.verbose and not is_compiled(kernel):
            self.say("  first solve of its kind: compiling for up to 20 s, once")

    def row(self, iteration: int, *values: float) -> None:
        """Take one row: the iteration and the values of the other columns."""
        row = (iteration, *values, time.perf_counter() - self.start)
        if not self.rows:
            names = ("time [s]" if c == "time" else c for c in self.columns)
            self.say("".join(f"{name:>10}" for name in names))
        self.rows.append(row)
        late = time.perf_counter() - self.last > SILENCE
        self.shown = late or is_shown(iteration)
        if self.shown:
            self.show(row)

    def show(self, row: tuple) -> None:
        """Print a row."""
        self.last = time.perf_counter()
        cells = (
            f"{value:10d}" if name in COUNTS else f"{value:10.2e}"
            for name, value in zip(self.columns, row, strict=True)
        )
        self.say("".join(cells))

    def close(self, text: str) -> None:
        """Print the last row, unless it was, and the closing sentence."""
        if not self.shown:
            self.show(self.rows[-1])
        self.say(text)

    def report(self, wanted: bool) -> Report:
        """Return `row` where rows are of use, None otherwise."""
        return self.row if wanted or self.verbose else None

    def history(self) -> np.ndarray:
        """Return the rows as a structured array with the printed columns."""
        kinds = [(name, "i8" if name in COUNTS else "f8") for name in self.columns]
        return np.array(self.rows, dtype=kinds)


def is_shown(iteration: int) -> bool:
    """Print all rows below 20, every 10th below 200, every 100th below 2000, ..."""
    while iteration >= 20:
        if iteration % 10:
            return False
        iteration //= 10
    return True


def is_compiled(kernel: Any) -> bool:
    """Tell whether `kernel` is at hand, in memory or on disk, or needs no compiling."""
    if getattr(kernel, "signatures", True):
        return True
    name = kernel.py_func.__qualname__
    return any(Path(kernel.stats.cache_path).glob(f"*.{name}-*.nbi"))
