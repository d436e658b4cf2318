"""The figures of peers.work_precision: all solvers, and the front page's four a panel.

A panel is a family of problems, a line the median problem with a marker for each
requested tolerance, the band from the first to the third quartile; what is missed
counts as infinite. The strip above a panel has a mark for each tolerance that a solver
missed on more than half the problems.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from validation.harness import Row, charts, csv_files, tables

TITLES = {
    "contact": "Contact",
    "MPC": "Model predictive control",
    "SVM": "Support vector machines",
    "general QP": "Maros-Meszaros",
    "obstacle": "Obstacle LCPs",
    "paper": "The paper's LCPs",
    "dominant": "Dominant LCPs",
}
"""Families with the titles of their panels; the front page has all but the last."""

NAMED = 2  # others than ours that the front page names, the fastest
RANKED_AT = 1e-8  # requested tolerance at which they are ranked by time
LEAST_ERROR, MOST_ERROR = 3e-17, 1.0  # ends of the horizontal axes
OURS = ("nam", "sweep auto")
SWEEPS = ("sweep psor", "sweep namsor", "sweep modulus", "sweep lemke")
"""The methods that the front page names on the paper's LCPs."""


def summary(file: Path) -> list[Row]:
    """Return median and quartiles of time and error, by family, solver, tolerance."""
    rows = csv_files.read(file)
    found = []
    for family, solver, eps in tables.distinct(rows, "family", "solver", "eps"):
        own = tables.chosen(rows, family=family, solver=solver, eps=eps)
        solved = tables.chosen(own, missed="False")
        lost = [math.inf] * (len(own) - len(solved))
        row = {"family": family, "solver": solver, "eps": float(eps)}
        for name, key in (("error", "error"), ("time", "runtime")):
            values = [float(each[key]) for each in solved] + lost
            row[name] = np.quantile(values, (0.25, 0.5, 0.75), method="inverted_cdf")
        found.append(row | {"problems": len(own)})
    return found


def name_of(solver: str) -> str:
    """Return what a solver or sweep is called in the figure."""
    names = {"nam": "namlcp", "sweep auto": "namlcp", "sweep nam": "nam (sweep)"}
    return names.get(solver, solver.removeprefix("sweep "))


def looks(solver: str) -> dict[str, Any]:
    """Return how a line is drawn; sweeps are dashed."""
    if solver in OURS:
        colour, marker = charts.SOLVERS["nam"]
        return {"color": colour, "marker": marker, "linewidth": 2.6, "zorder": 5}
    known = charts.SOLVERS | charts.METHODS
    colour, marker = known[solver.removeprefix("sweep ")]
    style = "--" if solver.startswith("sweep ") else "-"
    return {"color": colour, "marker": marker, "linewidth": 1.2, "linestyle": style}


def named(rows: list[Row], family: str) -> list[str]:
    """Return the solvers of one family that the front page draws in colour."""
    if family == "paper":
        return ["sweep auto", *SWEEPS]
    ranked = sorted(
        (row["time"][1], row["solver"])
        for row in tables.chosen(rows, eps=RANKED_AT)
        if row["solver"] != "nam" and not row["solver"].startswith("sweep ")
    )
    return ["nam", *(solver for _, solver in ranked[:NAMED])]


def plot(results: Path, figures: Path) -> None:
    """Draw both figures, the front page's if all families were run."""
    rows = summary(results)
    known = [name for name in TITLES if tables.chosen(rows, family=name)]
    size = (charts.WIDTH * 1.22, 10.6)
    draw(rows, known, (3, 3), size, figures / "work-precision.svg", False)
    front = list(TITLES)[:6]
    if set(front) <= set(known) and tables.chosen(rows, eps=RANKED_AT):
        size = (charts.WIDTH, 5.6)
        draw(rows, front, (2, 3), size, figures / "front.svg", True)


def draw(
    rows: list[Row],
    families: list[str],
    grid: tuple[int, int],
    size: tuple[float, float],
    file: Path,
    front: bool,
) -> None:
    """Draw a panel for each family; of the front page few lines are named."""
    figure, panels = plt.subplots(*grid, figsize=size, sharex=True)
    figure.subplots_adjust(
        left=0.07, right=0.99, top=0.93, bottom=0.13, hspace=0.34, wspace=0.2
    )
    for axes, family in zip(panels.flat, families, strict=False):
        own = tables.chosen(rows, family=family)
        solvers = tables.distinct(own, "solver")
        draw_family(axes, own, named(own, family) if front else solvers, front)
        axes.set_title(f"{TITLES[family]} ({own[0]['problems']})", pad=14.0)
        axes.tick_params(labelbottom=True)
    for axes in panels.flat[len(families) :]:
        axes.set_axis_off()
    for axes in panels[:, 0]:
        axes.set_ylabel("time [s]")
    figure.supxlabel("error of the returned point", fontsize=9.0, y=0.05)
    solvers = sorted(tables.distinct(rows, "solver"), key=name_of)
    if front:
        others = {name_of(s) for s in solvers if not s.startswith("sweep ")}
        text = ", ".join(sorted(others - {"namlcp"}))
        text = f"grey: {text}; of the paper's LCPs the other sweeps"
        handles, names = [Line2D([], [], color=charts.LIGHT)], [text]
    else:
        shown = {name_of(solver): looks(solver) for solver in solvers}
        handles = [Line2D([], [], **style) for style in shown.values()]
        names = list(shown)
    figure.legend(handles, names, loc="lower center", fontsize=8.0, ncols=9)
    charts.save(figure, file)


def draw_family(axes: Axes, rows: list[Row], coloured: list[str], front: bool) -> None:
    """Draw the lines of one family, the strip of misses and, if asked, the names."""
    axes.set(xscale="log", yscale="log", xlim=(LEAST_ERROR, MOST_ERROR))
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    sweeps = rows[0]["family"] == "paper"
    lines: dict[str, tuple[list[tuple[float, float]], str]] = {}
    strip = 0
    for solver in tables.distinct(rows, "solver"):
        own = tables.chosen(rows, solver=solver)
        done = [row for row in own if math.isfinite(row["time"][1])]
        missed = [row["eps"] for row in own if not math.isfinite(row["time"][1])]
        points = [(max(row["error"][1], LEAST_ERROR), row["time"][1]) for row in done]
        style = looks(solver)
        if solver not in coloured:
            if points and solver.startswith("sweep ") == sweeps:
                across, up = zip(*points, strict=True)
                axes.plot(across, up, color=charts.LIGHT, linewidth=1.0)
            continue
        if points:
            lines[name_of(solver)] = points, style["color"]
            across, up = zip(*points, strict=True)
            axes.plot(across, up, markersize=5.0 if solver in OURS else 3.5, **style)
            if front:
                low, high = ([row["time"][k] for row in done] for k in (0, 2))
                high = [min(h, 10.0 * y) for h, y in zip(high, up, strict=True)]
                axes.fill_between(
                    across, low, high, color=style["color"], alpha=0.12, linewidth=0.0
                )
        if missed:
            height = 1.02 + 0.025 * strip if front else 1.01 + 0.012 * strip
            strip += 1
            axes.plot(
                missed, [height] * len(missed), "x", clip_on=False,
                color=style["color"], markersize=3.0, markeredgewidth=1.0,
                transform=axes.get_xaxis_transform(),
            )  # fmt: skip
    if front:
        charts.name_lines(axes, lines)
