"""What all figures share: colours, markers, width, saving, and reading results.

Colours are Paul Tol's "bright" scheme, distinct for the colour-blind; a family of
methods has one colour, its members differ by marker.
"""

import math
from collections.abc import Callable
from itertools import combinations, product
from pathlib import Path
from typing import Any
from unittest import mock

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from validation.harness import tables
from validation.harness.csv_files import Row, header

mpl.use("Agg")


WIDTH = 9.0  # [in]
BLUE, CYAN, GREEN, PURPLE = "#4477AA", "#66CCEE", "#228833", "#AA3377"
YELLOW, RED = "#CCBB44", "#EE6677"
WINE, TEAL = "#882255", "#44AA99"
ORANGE, GREY, BLACK = "#EE7733", "#999999", "#000000"
DARK = "#555555"
LIGHT = "#CFCFCF"
BETWEEN = 8  # points of a line's segment that its names keep away from

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
    "lemke": (RED, "P"),
}
"""Colour and marker of every sweep method, and of Lemke's."""

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

# Where a name may stand beside a point: offset [points], and what is anchored there.
SHIFTS = {
    (7.0, 0.0): {"ha": "left", "va": "center"},
    (-7.0, 0.0): {"ha": "right", "va": "center"},
    (0.0, 7.0): {"ha": "center", "va": "bottom"},
    (0.0, -7.0): {"ha": "center", "va": "top"},
    (6.0, 6.0): {"ha": "left", "va": "bottom"},
    (-6.0, 6.0): {"ha": "right", "va": "bottom"},
    (6.0, -6.0): {"ha": "left", "va": "top"},
    (-6.0, -6.0): {"ha": "right", "va": "top"},
}

# Distance of a name from all lines [points] with which it may stand close to its own.
ROOM = 2.0

MARGIN = 4.0  # [pixels] between a name and the frame of its panel

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
    """Write a figure as the suffix of `file` says, without the date, and close it.

    Raises a ValueError if two of its texts overlap.
    """
    clashes = overlapping_texts(figure)
    if clashes:
        raise ValueError(f"{file.name}: overlapping texts, {clashes[:5]}")
    file.parent.mkdir(parents=True, exist_ok=True)
    metadata = {"Date": None} if file.suffix == ".svg" else None
    figure.savefig(file, metadata=metadata, bbox_inches="tight")
    plt.close(figure)
    print(f"{file.name}: {file.stat().st_size / 1024:.0f} KiB")


def lines(
    axes: Axes,
    rows: list[Row],
    by: str,
    across: str,
    up: str,
    looks: Callable[[str], dict[str, Any]],
    unit: float = 1.0,
) -> dict[str, tuple[list[tuple[float, float]], str]]:
    """Draw a column over another, a line for each value of the column `by`.

    Both axes are logarithmic; rows without an entry have no point; `unit` is a factor
    of what is drawn. Returns points and colour of each line, as `name_lines` takes it.
    """
    axes.set(xscale="log", yscale="log")
    drawn = {}
    for name in tables.distinct(rows, by):
        own = [row for row in tables.chosen(rows, **{by: name}) if row[up]]
        points = [(float(row[across]), unit * float(row[up])) for row in own]
        if points:
            style = {"markersize": 3.5} | looks(name)
            axes.plot(*zip(*points, strict=True), **style)
            drawn[style.get("label", name)] = points, style["color"]
    return drawn


def solver_looks(solver: str) -> dict[str, Any]:
    """Return how the line of a solver is drawn; other ways to call us are dashed."""
    colour, marker = SOLVERS[solver.split()[0]]
    first = solver == "nam"
    return {
        "color": colour, "marker": marker, "linestyle": "--" if " " in solver else "-",
        "linewidth": 2.6 if first else 1.3, "zorder": 5 if first else 3,
        "label": "namlcp" if first else solver,
    }  # fmt: skip


def name_ticks(axes: Axes, rows: list[Row], across: str) -> None:
    """Mark the values of a column, and no others, on the horizontal axis."""
    sizes = tables.distinct(rows, across)
    axes.set_xticks([float(size) for size in sizes], sizes)
    axes.minorticks_off()


def label(
    axes: Axes, text: str, point: tuple, shift: tuple, colour: str, **style: Any
) -> None:
    """Write the name of a line beside one of its points, `shift` [points] off."""
    place = {"textcoords": "offset points", "va": "center", "color": colour}
    axes.annotate(text, point, shift, **place, **style)


def name_lines(
    axes: Axes, lines: dict[str, tuple[list[tuple[float, float]], str]]
) -> None:
    """Write the name of each line, in its colour, beside one of its points.

    `lines`: by name, its points and its colour. The place is the one farthest from all
    lines, among those within the panel and off the texts that are there; it is close to
    the line, unless there is no room.
    """
    axes.figure.draw_without_rendering()  # panels and limits are as they will be
    frame = axes.get_window_extent().padded(-MARGIN)
    if not lines:
        return
    marks = np.concatenate(
        [along(axes.transData.transform(points)) for points, _ in lines.values()]
    )
    taken = [text.get_window_extent() for text in axes.texts]
    for name, (points, colour) in lines.items():
        text = axes.annotate(
            name, points[0], (0.0, 0.0), textcoords="offset points", color=colour,
            fontsize=9.0, weight="bold" if name == "namlcp" else "normal", zorder=9,
        )  # fmt: skip
        best = -math.inf
        place = points[0], (0.0, 0.0), {}
        for times, point in product((1.0, 2.5), points):
            if times > 1.0 and best >= ROOM:
                break
            for (across, up), sides in SHIFTS.items():
                shift = times * across, times * up
                text.xy, text.xyann = point, shift
                text.set(**sides)
                box = text.get_window_extent()
                inside = frame.contains(*box.min) and frame.contains(*box.max)
                if not inside or any(box.overlaps(other) for other in taken):
                    continue
                room = distance(box, marks)
                if room > best:
                    best, place = room, (point, shift, sides)
        text.xy, text.xyann, sides = place
        text.set(**sides)
        taken.append(text.get_window_extent())


def along(corners: np.ndarray) -> np.ndarray:
    """Return points along the line through the corners, close to each other."""
    at = np.arange(len(corners))
    fine = np.linspace(0.0, at[-1], BETWEEN * at[-1] + 1)
    return np.column_stack([np.interp(fine, at, side) for side in corners.T])


def distance(box: Bbox, points: np.ndarray) -> float:
    """Return how far the nearest of some points is from a box; 0 inside."""
    over = np.maximum(np.maximum(box.min - points, points - box.max), 0.0)
    return float(np.hypot(*over.T).min())


def overlapping_texts(figure: Figure) -> list[tuple[str, str]]:
    """Return the pairs of texts of a figure whose boxes overlap, of those drawn."""
    drawn: list[Text] = []
    draw = Text.draw

    def record(text: Text, *arguments: Any) -> None:
        if text.get_visible() and text.get_text():
            drawn.append(text)
        draw(text, *arguments)

    with mock.patch.object(Text, "draw", record):
        figure.draw_without_rendering()
    boxes = [(t.get_text(), t.get_window_extent()) for t in drawn]
    return [
        (a, b) for (a, one), (b, other) in combinations(boxes, 2) if one.overlaps(other)
    ]


def caption(axes: Axes, file: Path, below: float = 46.0) -> None:
    """Write CPU and date, from the first lines of a CSV file, points below an axes."""
    known = dict(line.split(": ", 1) for line in header(file) if ": " in line)
    text = f"{known['cpu']}; {known['date']}; {file.name}"
    style = {"xycoords": "axes fraction", "textcoords": "offset points", "color": DARK}
    axes.annotate(text, (0.0, 0.0), (0.0, -below), fontsize=6.5, **style)
