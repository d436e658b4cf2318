"""The table of a solve's progress, printed when verbose and kept for the history."""

import time

import numpy as np

from namlcp.status import Outcome

SILENCE = 2.0
"""Time [s] since the last printed row after which the next row is always printed."""

QP_COLUMNS = ("iter", "primal", "dual", "gap", "step", "active")
LCP_COLUMNS = ("iter", "residual", "active")
COUNTS = ("iter", "active")
"""Columns of integers; the others are of floats."""


def now() -> float:
    """Return time.perf_counter() [s], for compiled code.

    As it is a function in Python, handlers of signals run when it is called, and a
    thread takes an exception that another one has raised in it.
    """
    return time.perf_counter()


class Progress:
    """Rows of one solve: kept for the history, printed when verbose.

    To the columns the time [s] since the start is added as the last.
    """

    def __init__(self, columns: tuple[str, ...], verbose: bool):
        self.columns, self.verbose = (*columns, "time"), verbose
        self.rows: list[tuple] = []
        self.shown = True  # the last row was printed
        self.start = self.last = time.perf_counter()  # last: of a printed row

    def say(self, text: str) -> None:
        if self.verbose:
            print(text, flush=True)

    def row(self, iteration: int, *values: float) -> None:
        """Keep a row, the iteration and the values of the other columns; print some."""
        row = (iteration, *values, time.perf_counter() - self.start)
        if not self.rows:
            names = ("time [s]" if c == "time" else c for c in self.columns)
            self.say("".join(f"{name:>10}" for name in names))
        self.rows.append(row)
        self.shown = row[-1] > self.last - self.start + SILENCE or is_shown(iteration)
        if self.shown:
            self.show(row)

    def show(self, row: tuple) -> None:
        self.last = time.perf_counter()
        cells = (
            f"{value:10d}" if name in COUNTS else f"{value:10.2e}"
            for name, value in zip(self.columns, row, strict=True)
        )
        self.say("".join(cells))

    def close(self, answer: Outcome, start: float) -> None:
        """Print the last row, if it was not printed, and how a solve ended."""
        if not self.shown:
            self.show(self.rows[-1])
        r, seconds = answer.residuals, time.perf_counter() - start
        if isinstance(r, float):
            found = f"residual {r:.1e}"
        else:
            found = f"primal {r.primal:.0e}, dual {r.dual:.0e}, gap {r.gap:.0e}"
        ending = f"{answer.method}, {answer.iterations} it, {seconds:.1e} s, {found}"
        self.say(f"{answer.status}: {ending}")

    def history(self) -> np.ndarray:
        kinds = [(name, "i8" if name in COUNTS else "f8") for name in self.columns]
        return np.array(self.rows, dtype=kinds)


def is_shown(iteration: int) -> bool:
    """Tell whether to print a row: all below 20, every 10th below 200, and so on."""
    while iteration >= 20:
        if iteration % 10:
            return False
        iteration //= 10
    return True
