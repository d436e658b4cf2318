"""The figures of applications.large, and its table."""

import math
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from validation.harness import Row, charts, csv_files, tables

Rows = list[dict[str, str]]

LIMIT = 120.0
"""Seconds that the other solvers have."""

PANELS = {
    "forced": "forced obstacle",
    "ball": "ball obstacle",
    "torsion": "torsion, two-sided",
    "biactive": "half biactive",
    "rough": "rough obstacle",
    "anisotropic": "anisotropic 1 : 0.01",
    "3-D": "3-D, seven-point",
    "mesh, jumps": "mesh, jumps 1 : 1000",
    "transport": "Example 2, $\\delta$ = 0",
    "dominant": "Example 2, $\\delta$ = 4",
    "piles": "contact piles",
    "hertz": "Hertz, matrix-free",
    "put": "American put, one step",
}
"""Scenes with the titles of their panels; what is left out leaves its place empty."""

PILES = {"heap": ("heap", "o"), "heap, wide": ("wide heap", "s"), "wall": ("wall", "^")}
LAYOUT = ("FFab", "FFcd", "efgh", "ijkl")


def plot(results: Path, figures: Path) -> None:
    """Draw large.svg: time against n, a panel for each scene, the forced one large."""
    rows = csv_files.read(results)
    figure, axes = plt.subplot_mosaic(
        [list(line) for line in LAYOUT],
        figsize=(charts.WIDTH, 9.6),
        sharex=True,
        sharey=True,
        gridspec_kw={"wspace": 0.1, "hspace": 0.34},
    )
    forced = axes["F"]
    forced.set(xscale="log", yscale="log", xlim=(600.0, 8e6), ylim=(3e-6, 1500.0))
    forced.tick_params(labelbottom=True)
    for name, (scene, title) in zip("Fabcdefghijkl", PANELS.items(), strict=True):
        panel = axes[name]
        kinds = PILES if scene == "piles" else (scene,)
        own = [row for row in rows if row["scene"] in kinds]
        panel.set_title(title, fontsize=10.0 if name == "F" else 9.0)
        if not own:
            panel.text(0.5, 0.5, "not run", transform=panel.transAxes, ha="center")
        elif scene == "piles":
            draw_piles(panel, own)
        else:
            draw_scene(panel, own, named=name == "F")
    for name in "Fei":
        axes[name].set_ylabel("time [s]")
    for name in "ijkl":
        axes[name].set_xlabel("n")
    charts.caption(axes["i"], results)
    charts.save(figure, figures / "large.svg")


def draw_scene(axes: Axes, rows: Rows, named: bool) -> None:
    """Draw our line, that of one linear solve, of one pass over A, and the peers."""
    own = [row for row in rows if row["solver"] == "nam"]
    n = [int(row["n"]) for row in own]
    middle = len(own) // 2
    for key, style, text, drop in (
        ("product", ":", "one pass over A: A @ x", -9.0),
        ("baseline", "--", "one linear solve with A\n(pyamg, CG)", -15.0),
    ):
        times = [float(row[key] or "nan") for row in own]
        axes.plot(n, times, style, color=charts.DARK, linewidth=1.1)
        if named:
            label(axes, n[middle], times[middle], text, charts.DARK, (6.0, drop))
    draw_solver(axes, own, "nam")
    if named:
        end = float(own[-1]["seconds"])
        label(axes, n[-1], end, "namlcp", charts.SOLVERS["nam"][0], (-6.0, 8.0))
    peers = {}
    for solver in dict.fromkeys(row["solver"] for row in rows):
        if solver != "nam":
            theirs = [row for row in rows if row["solver"] == solver]
            draw_solver(axes, theirs, solver)
            points = [(int(r["n"]), float(r["seconds"] or LIMIT)) for r in theirs]
            peers[solver] = points, charts.SOLVERS[solver][0]
    charts.name_lines(axes, peers)
    ratio = float(own[-1]["ratio"] or "nan")
    if math.isfinite(ratio):
        if own[-1]["scene"] == "put":
            note(axes, f"{ratio:.2f} Brennan-Schwartz\nsteps (dashed)", 0.8)
        else:
            note(axes, f"{ratio:.2f} linear solves")


def draw_solver(axes: Axes, rows: Rows, solver: str, mark: str = "") -> None:
    """Draw what a solver solved as a line, what it did not as crosses."""
    colour, marker = charts.SOLVERS[solver]
    solved = [row for row in rows if row["status"] == "solved"]
    axes.plot(
        [int(row["n"]) for row in solved],
        [float(row["seconds"]) for row in solved],
        color=colour,
        marker=mark or marker,
        linewidth=2.4 if solver == "nam" and not mark else 1.3,
        zorder=3 if solver == "nam" else 2,
    )
    failed = [row for row in rows if row["status"] != "solved"]
    axes.plot(
        [int(row["n"]) for row in failed],
        [float(row["seconds"] or LIMIT) for row in failed],
        "x",
        color=colour,
        markersize=7.0,
        markeredgewidth=2.0,
    )


def draw_piles(axes: Axes, rows: Rows) -> None:
    """Draw the contact scenes, which have no linear solve to be compared with."""
    for kind, (name, marker) in PILES.items():
        own = [row for row in rows if row["scene"] == kind]
        if own:
            draw_solver(axes, own, "nam", marker)
            axes.plot([], [], marker, color=charts.BLUE, label=name)
    line = np.array([1e3, 1e5])
    axes.plot(line, 2.0 * (line / 1e5) ** 1.5, color=charts.DARK, linewidth=0.8)
    axes.text(1.3e3, 6e-4, "$n^{1.5}$", color=charts.DARK, fontsize=8.0)
    axes.legend(loc="lower right", fontsize=7.5, handletextpad=0.1, borderpad=0.0)


def label(
    axes: Axes, x: float, y: float, text: str, colour: str, shift: tuple[float, float]
) -> None:
    """Write the name of a line to the left or right of one of its points."""
    side = "left" if shift[0] > 0.0 else "right"
    charts.label(axes, text, (x, y), shift, colour, ha=side, fontsize=8.5)


def note(axes: Axes, text: str, height: float = 0.03) -> None:
    """Write a remark at the right."""
    place = {"transform": axes.transAxes, "ha": "right"}
    axes.text(0.98, height, text, color=charts.DARK, fontsize=7.5, **place)


def value(row: Row, key: str) -> float:
    """Return an entry as a number, NaN of nothing."""
    return csv_files.number(row[key])


def markdown(rows: list[Row]) -> str:
    """Return the table of our rows."""
    heads = "scene,n,method,cycles,time [s],Res,linear solves,active".split(",")
    lines = []
    for row in tables.chosen(rows, solver="nam"):
        ratio = f"{value(row, 'ratio'):.2f}" if row["ratio"] else ""
        share = f"{100.0 * value(row, 'active'):.2g} %" if row["active"] else ""
        first = [row[key] for key in ("scene", "n", "method", "iterations")]
        seconds, residual = value(row, "seconds"), value(row, "residual")
        lines.append([*first, f"{seconds:.3g}", f"{residual:.1e}", ratio, share])
    return tables.markdown(heads, lines)
