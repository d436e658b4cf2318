"""The figure of the front page: speed against accuracy, six panels, four lines each.

It reads the summary of `peers.work_precision` and computes nothing. A panel is a family
of problems. namlcp and the NAMED fastest of the others are drawn in colour and named at
their lines; the rest is grey. A line is the median problem, a marker for each requested
tolerance; the band is from the first to the third quartile. The strip above a panel
has a mark for each tolerance that a named solver missed on more than half the problems.
"""

import math
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from validation.harness import charts, csv_files

Rows = list[dict[str, str]]
Points = list[tuple[float, float]]
TITLES = {
    "contact": "Contact",
    "MPC": "Model predictive control",
    "SVM": "Support vector machines",
    "general QP": "Maros-Meszaros",
    "obstacle": "Obstacle LCPs",
    "paper": "The paper's LCPs",
}
NAMED = 2
RANKED_AT = 1e-8  # requested tolerance at which the others are ranked by time
LEAST_ERROR, MOST_ERROR = 3e-17, 1.0  # ends of the horizontal axes
OURS = ("nam", "sweep auto")
SWEEPS = ("sweep psor", "sweep namsor", "sweep modulus", "sweep lemke")
"""The methods that are named on the paper's LCPs."""


def name_of(solver: str) -> str:
    """Return what a solver or sweep is called in the figure."""
    return "namlcp" if solver in OURS else solver.removeprefix("sweep ")


def colour_of(solver: str) -> str:
    """Return the colour of a named line."""
    if solver in OURS:
        return charts.SOLVERS["nam"][0]
    known = charts.SOLVERS | charts.METHODS
    return known[solver.removeprefix("sweep ")][0]


def named(rows: Rows, family: str) -> list[str]:
    """Return the solvers of one family that are drawn in colour, ours first."""
    if family == "paper":
        return ["sweep auto", *SWEEPS]
    ranked = sorted(
        (float(row["time"]), row["solver"])
        for row in rows
        if float(row["eps"]) == RANKED_AT and not row["solver"].startswith("sweep ")
    )
    others = [s for time, s in ranked if s != "nam" and math.isfinite(time)]
    return ["nam", *others[:NAMED]]


def plot(results: Path, file: Path) -> None:
    """Draw the six panels."""
    rows = csv_files.read(results)
    figure, panels = plt.subplots(2, 3, figsize=(charts.WIDTH, 5.6), sharex=True)
    figure.subplots_adjust(
        left=0.07, right=0.99, top=0.93, bottom=0.13, hspace=0.3, wspace=0.2
    )
    for axes, (family, title) in zip(panels.flat, TITLES.items(), strict=True):
        own = [row for row in rows if row["family"] == family]
        draw_family(axes, own, named(own, family))
        axes.set_title(f"{title} ({own[0]['problems']})", pad=14.0)
    for axes in panels[:, 0]:
        axes.set_ylabel("time [s]")
    for axes in panels[1]:
        axes.set_xlabel("error of the returned point")
    others = {name_of(row["solver"]) for row in rows if row["family"] != "paper"}
    others -= {"namlcp", *charts.METHODS}
    text = f"grey: {', '.join(sorted(others))}; of the paper's LCPs the other sweeps"
    grey = Line2D([], [], color=charts.LIGHT)
    figure.legend([grey], [text], loc="lower center", fontsize=8.0)
    charts.save(figure, file)


def draw_family(axes: Axes, rows: Rows, coloured: list[str]) -> None:
    """Draw all lines of one family, the strip of misses and the names."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(LEAST_ERROR, MOST_ERROR)
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    lines: dict[str, Points] = {}
    missed: dict[str, list[float]] = {}
    for solver in dict.fromkeys(row["solver"] for row in rows):
        own = [row for row in rows if row["solver"] == solver]
        done = [row for row in own if math.isfinite(float(row["time"]))]
        points = [(float(row["error"]), float(row["time"])) for row in done]
        points = [(max(x, LEAST_ERROR), y) for x, y in points]
        if solver not in coloured:
            if points and solver.startswith("sweep ") == (rows[0]["family"] == "paper"):
                x, y = zip(*points, strict=True)
                axes.plot(x, y, "-", color=charts.LIGHT, linewidth=1.0)
            continue
        missed[solver] = [float(row["eps"]) for row in own if row not in done]
        if points:
            lines[solver] = points
            draw_line(axes, done, points, solver)
    draw_misses(axes, missed, lines)
    charts.name_lines(
        axes, {name_of(s): (points, colour_of(s)) for s, points in lines.items()}
    )


def draw_line(axes: Axes, rows: Rows, points: list, solver: str) -> None:
    """Draw the median with its markers and the band between the quartiles."""
    colour, ours = colour_of(solver), solver in OURS
    x, y = zip(*points, strict=True)
    width, size, top = (2.6, 6.0, 5) if ours else (1.3, 3.5, 3)
    axes.plot(x, y, "o-", color=colour, linewidth=width, markersize=size, zorder=top)
    low = [float(row["q1"]) for row in rows]
    high = [min(float(row["q3"]), 10.0 * float(row["time"])) for row in rows]
    axes.fill_between(x, low, high, color=colour, alpha=0.12, linewidth=0.0)


def draw_misses(
    axes: Axes, missed: dict[str, list[float]], lines: dict[str, Points]
) -> None:
    """Mark the tolerances that were missed in a strip above the panel.

    A solver that has no line in the panel is named there.
    """
    for k, (solver, tolerances) in enumerate(missed.items()):
        height, colour = 1.02 + 0.025 * k, colour_of(solver)
        axes.plot(
            tolerances, [height] * len(tolerances), "x", clip_on=False, color=colour,
            markersize=3.5, markeredgewidth=1.2,
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip
        if tolerances and solver not in lines:
            place = {"ha": "right", "va": "center", "transform": axes.transAxes}
            axes.text(1.0, height, name_of(solver), color=colour, fontsize=8.0, **place)
