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

from validation.harness.csv_files import header

mpl.use("Agg")


WIDTH = 9.0  # [in]
BLUE, CYAN, GREEN, PURPLE = "#4477AA", "#66CCEE", "#228833", "#AA3377"
YELLOW, RED = "#CCBB44", "#EE6677"
WINE, TEAL = "#882255", "#44AA99"
ORANGE, GREY, BLACK = "#EE7733", "#999999", "#000000"
DARK = "#555555"

METHODS = {
    "mgs": (PURPLE, "o"),
    "msor": (PURPLE, "s"),
    "maor": (PURPLE, "^"),
    "namj": (BLUE, "v"),
    "namgs": (BLUE, "o"),
    "namsor": (BLUE, "s"),
    "namaor": (BLUE, "^"),
    "amgs": (GREEN, "v"),
    "amsor": (GREEN, "^"),
    "pgs": (GREEN, "o"),
    "psor": (GREEN, "s"),
    "modulus": (DARK, "o"),
    "nam": (DARK, "s"),
    "modified-nam": (DARK, "^"),
}
"""Colour and marker of every sweep method."""

SOLVERS = {
    "nam": (BLUE, "o"),
    "osqp": (PURPLE, "s"),
    "piqp": (GREEN, "^"),
    "clarabel": (CYAN, "v"),
    "proxqp": (YELLOW, "D"),
    "daqp": (RED, "P"),
    "quadprog": (BLACK, "<"),
    "scs": (GREY, ">"),
    "highs": (ORANGE, "h"),
    "moreau": (WINE, "X"),
    "qtqp": (TEAL, "p"),
}
"""Colour and marker of every solver."""

mpl.rcParams.update(
    {
        "figure.dpi": 110,
        "font.size": 9.0,
        "axes.titlesize": 10.0,
        "axes.titlelocation": "left",
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.grid": True,
        "axes.axisbelow": True,
        "grid.color": "#DDDDDD",
        "grid.linewidth": 0.6,
        "lines.linewidth": 1.4,
        "lines.markersize": 5.0,
        "legend.frameon": False,
        "svg.hashsalt": "namlcp",
    }
)


def save(figure: Figure, file: Path) -> None:
    """Write a figure as the suffix of `file` says, without the date, and close it."""
    file.parent.mkdir(parents=True, exist_ok=True)
    metadata = {"Date": None} if file.suffix == ".svg" else None
    figure.savefig(file, metadata=metadata, bbox_inches="tight")
    plt.close(figure)
    print(f"{file.name}: {file.stat().st_size / 1024:.0f} KiB")


def label(
    axes: Axes, text: str, point: tuple, shift: tuple, colour: str, **style: Any
) -> None:
    """Write the name of a line beside one of its points, `shift` [points] off."""
    place = {"textcoords": "offset points", "va": "center", "color": colour}
    axes.annotate(text, point, shift, **place, **style)


def caption(axes: Axes, file: Path) -> None:
    """Write CPU and date, from the first lines of a CSV file, below an axes."""
    known = dict(line.split(": ", 1) for line in header(file) if ": " in line)
    text = f"{known['cpu']}; {known['date']}; {file.name}"
    style = {"xycoords": "axes fraction", "textcoords": "offset points", "color": DARK}
    axes.annotate(text, (0.0, 0.0), (0.0, -46.0), fontsize=6.5, **style)
