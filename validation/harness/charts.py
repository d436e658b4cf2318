"""What all figures share: colours, markers, width, saving, and reading results.

Colours are Paul Tol's "bright" scheme, distinct for the colour-blind; a family of
methods has one colour, its members differ by marker.
"""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from validation.harness import tables
from validation.harness.tables import Row

mpl.use("Agg")

WIDTH = 9.0  # [in]
BLUE, CYAN, GREEN, PURPLE = "#4477AA", "#66CCEE", "#228833", "#AA3377"
YELLOW, RED = "#CCBB44", "#EE6677"
DARK, LIGHT = "#555555", "#CFCFCF"

LOOKS = {
    "nam": (BLUE, "o"), "osqp": (PURPLE, "s"), "piqp": (GREEN, "^"),
    "clarabel": (CYAN, "v"), "proxqp": (YELLOW, "D"), "daqp": (RED, "P"),
    "quadprog": ("#000000", "<"), "qtqp": ("#44AA99", "p"), "namsor": (BLUE, "s"),
    "pgs": (GREEN, "o"), "modulus": (DARK, "o"), "lemke": (RED, "P"),
}  # fmt: skip

mpl.rcParams |= {
    "figure.dpi": 110, "font.size": 9.0, "axes.titlesize": 10.0,
    "axes.titlelocation": "left", "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "axes.axisbelow": True, "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6, "lines.linewidth": 1.4, "lines.markersize": 5.0,
    "legend.frameon": False, "svg.hashsalt": "namlcp",
}  # fmt: skip


def save(figure: Figure, file: Path) -> None:
    file.parent.mkdir(parents=True, exist_ok=True)
    metadata = {"Date": None} if file.suffix == ".svg" else None
    figure.savefig(file, metadata=metadata, bbox_inches="tight")
    plt.close(figure)
    print(f"{file.name}: {file.stat().st_size / 1024:.0f} KiB")


def lines(
    axes: Axes, rows: list[Row], columns: str, style: Any, unit: float = 1.0
) -> dict[str, str]:
    """Draw the last of three columns over the second, a line for each of the first.

    Both axes are logarithmic; rows without an entry have no point; `unit` is a factor
    of what is drawn. Returns the colour of each line by its name.
    """
    by, across, up = columns.split()
    axes.set(xscale="log", yscale="log")
    drawn = {}
    for name in tables.distinct(rows, by):
        own = [row for row in tables.chosen(rows, **{by: name}) if row[up]]
        points = [(float(row[across]), unit * float(row[up])) for row in own]
        if points:
            look = {"markersize": 3.5} | style(name)
            axes.plot(*zip(*points, strict=True), **look)
            drawn[look.get("label", name)] = look["color"]
    return drawn


def looks(solver: str) -> dict[str, Any]:
    """Return how the line of a solver is drawn; other ways to call us are dashed."""
    colour, marker = LOOKS[solver.split()[0]]
    first = solver == "nam"
    return {
        "color": colour, "marker": marker, "linestyle": "--" if " " in solver else "-",
        "linewidth": 2.6 if first else 1.3, "zorder": 5 if first else 3,
        "label": "namlcp" if first else solver,
    }  # fmt: skip


def name_lines(axes: Axes, lines: dict[str, str]) -> None:
    """Name lines in their colours."""
    handles = [Line2D([], [], color=colour, label=k) for k, colour in lines.items()]
    if handles:
        axes.legend(
            handles=handles, labelcolor="linecolor", fontsize=7.5, handlelength=1.0,
            borderpad=0.1, labelspacing=0.2,
        )  # fmt: skip
