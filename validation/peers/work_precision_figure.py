"""The figure of peers.work_precision: reads its summary, computes nothing.

A panel for each family: error against time, a line for each solver through one marker
for each requested tolerance. Filled: every problem met the request; hollow: some
missed it; a cross above the frame, over the tolerance it stands for: more than half
did, so that there is no median.
"""

import math
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from validation.harness import charts, csv_files

Rows = list[dict[str, str]]
PLACES = {
    "dominant": (0, 0),
    "obstacle": (0, 1),
    "contact": (0, 2),
    "MPC": (1, 0),
    "SVM": (1, 1),
    "general QP": (1, 2),
    "paper": (2, 0),
}
MEASURES = {
    "distance": "distance to the solution, relative",
    "residual": "worst residual, absolute",
}
FLOOR = 1e-17  # where a distance of zero is drawn
NAMES = {"nam": "namlcp", "sweep auto": "namlcp", "sweep nam": "nam (sweep)"}
LIFT, ROW = 0.02, 0.05  # of the panel's height: first and next row of crosses


def name_of(solver: str) -> str:
    """Return what a solver or sweep is called in the figure."""
    return NAMES.get(solver, solver.removeprefix("sweep "))


def looks(solver: str) -> tuple[str, str, str]:
    """Return colour, marker and line style; sweeps are dashed."""
    if solver == "sweep auto":
        return *charts.SOLVERS["nam"], "-"
    if solver.startswith("sweep "):
        return *charts.METHODS[solver.removeprefix("sweep ")], "--"
    return *charts.SOLVERS[solver], "-"


def plot(results: Path, file: Path) -> None:
    """Draw the families that the summary has."""
    rows = csv_files.read(results)
    figure = plt.figure(figsize=(charts.WIDTH * 1.22, 10.6))
    grid = figure.add_gridspec(
        3, 3, hspace=0.6, wspace=0.2, left=0.07, right=0.985, top=0.95, bottom=0.07
    )
    panels = []
    for family, place in PLACES.items():
        own = [row for row in rows if row["family"] == family]
        axes = figure.add_subplot(grid[place])
        panels.append(axes)
        if own:
            draw_family(axes, own)
        else:
            axes.set_title(family)
            axes.text(0.5, 0.5, "not run", transform=axes.transAxes, ha="center")
        if place[1] == 0:
            axes.set_ylabel("time [s], median and quartiles")
    draw_key(figure, grid[2, 1:], rows)
    charts.caption(panels[-1], results)
    charts.save(figure, file)


def draw_family(axes: Axes, rows: Rows) -> None:
    """Draw the lines of one family and the crosses above its frame."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    crosses: list[tuple[str, list[float]]] = []
    for solver in solvers:
        own = [row for row in rows if row["solver"] == solver]
        draw_solver(axes, own, solver)
        failed = [row for row in own if math.isinf(float(row["time"]))]
        if failed:
            crosses.append((solver, [float(row["eps"]) for row in failed]))
    for k, (solver, tolerances) in enumerate(crosses):
        draw_crosses(axes, solver, tolerances, LIFT + ROW * k)
    first = rows[0]
    height = LIFT + ROW * len(crosses) + 0.02
    axes.text(
        0.0, 1.0 + height, title_of(first), transform=axes.transAxes, fontsize=9.5,
    )  # fmt: skip
    axes.set_xlabel(MEASURES[first["measure"]])


def title_of(row: dict[str, str]) -> str:
    """Return family, sizes and count."""
    least, most = (f"{int(row[key]):_}" for key in ("n_least", "n_most"))
    sizes = f"n = {least}" if least == most else f"n = {least} to {most}"
    sizes = sizes.replace("_", " ")
    return f"{row['title']}: {row['problems']} problems, {sizes}"


def draw_solver(axes: Axes, rows: Rows, solver: str) -> None:
    """Draw one line: markers, hollow where something was missed, and quartiles."""
    colour, marker, line = looks(solver)
    rows = [row for row in rows if not math.isinf(float(row["time"]))]
    x = [max(float(row["error"]), FLOOR) for row in rows]
    y = [float(row["time"]) for row in rows]
    first = solver in ("nam", "sweep auto")
    width, top, size = (2.4, 4, 6.0) if first else (1.1, 2, 4.0)
    axes.plot(x, y, line, color=colour, linewidth=width, zorder=top)
    for row, a, b in zip(rows, x, y, strict=True):
        whole = row["solved"] == row["problems"]
        axes.plot(
            a, b, marker, color=colour, zorder=top + 1, markersize=size,
            markerfacecolor=colour if whole else "white",
        )  # fmt: skip
        high = float(row["q3"])
        limit = high if math.isfinite(high) else 10.0 * b
        axes.vlines(a, float(row["q1"]), limit, color=colour, linewidth=0.8, alpha=0.4)


def draw_crosses(axes: Axes, solver: str, tolerances: list[float], lift: float) -> None:
    """Draw a cross above the frame for each tolerance missed, and the name."""
    colour = looks(solver)[0]
    height = 1.0 + lift
    place = axes.get_xaxis_transform()
    axes.plot(
        tolerances, [height] * len(tolerances), "x", color=colour, markersize=3.5,
        markeredgewidth=1.2, transform=place, clip_on=False,
    )  # fmt: skip
    axes.text(
        -0.01, height, name_of(solver), color=colour, fontsize=7.0, va="center",
        ha="right", transform=axes.transAxes,
    )  # fmt: skip


def draw_key(figure: Figure, place: object, rows: Rows) -> None:
    """Draw the key of solvers and sweeps, and say what is drawn."""
    axes = figure.add_subplot(place)
    axes.axis("off")
    present = dict.fromkeys(row["solver"] for row in rows if row["solver"] != "")
    solvers = [s for s in charts.SOLVERS if s in present]
    sweeps = [f"sweep {s}" for s in charts.METHODS if f"sweep {s}" in present]
    for names, x, title in ((solvers, 0.0, "solvers"), (sweeps, 0.27, "sweeps")):
        handles = []
        for solver in names:
            colour, marker, line = looks(solver)
            width = 2.4 if solver == "nam" else 1.1
            style = {"color": colour, "marker": marker, "linestyle": line}
            handles.append(Line2D([], [], linewidth=width, **style))
        legend = axes.legend(
            handles, [name_of(s) for s in names], loc="upper left", fontsize=8.0,
            bbox_to_anchor=(x, 1.02), title=title, alignment="left",
            handlelength=2.6,
        )  # fmt: skip
        if title == "solvers":  # the next legend would take its place
            axes.add_artist(legend)
    tolerances = [float(row["eps"]) for row in rows]
    asked = f"{max(tolerances):.0e} to {min(tolerances):.0e}"
    text = (
        "A marker for each requested tolerance,\n"
        f"{asked}: the median problem\n"
        "of the family; what is missed counts\n"
        "as infinite error and time.\n\n"
        "filled   all problems met the request\n"
        "hollow  some missed it\n"
        "$\\times$ above the frame, over the tolerance:\n"
        "     more than half missed it\n\n"
        "Errors are recomputed from the point\n"
        "that was returned. Missed: over the\n"
        "time limit, or a residual above ten\n"
        "times the tolerance."
    )
    axes.text(0.56, 0.98, text, va="top", fontsize=8.0, transform=axes.transAxes)
    axes.annotate(
        "better", (0.57, -0.07), (0.68, 0.03), xycoords="axes fraction",
        color=charts.DARK, fontsize=9.0,
        arrowprops={"arrowstyle": "->", "color": charts.DARK},
    )  # fmt: skip
