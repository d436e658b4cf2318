"""The figures of applications.large, and its table."""

import math
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from validation.harness import Row, charts, csv_files, tables

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
}
"""Scenes with the titles of their panels; what is left out leaves its place empty."""

PILES = {"heap": "o", "heap, wide": "s", "wall": "^"}
LAYOUT = ("FFab", "FFcd", "efgh", "ijk.")


def plot(results: Path, figures: Path) -> None:
    """Draw large.svg: time against n, a panel for each scene, the forced one large."""
    rows = csv_files.read(results)
    figure, axes = plt.subplot_mosaic(
        [list(line) for line in LAYOUT],
        figsize=(charts.WIDTH, 9.6),
        sharex=True,
        sharey=True,
        gridspec_kw={"wspace": 0.1, "hspace": 0.42},
    )
    forced = axes["F"]
    forced.set(xscale="log", yscale="log", xlim=(600.0, 8e6), ylim=(3e-6, 1500.0))
    forced.tick_params(labelbottom=True)
    for name, (scene, title) in zip("Fabcdefghijk", PANELS.items(), strict=True):
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
    figure.supxlabel("n", fontsize=9.0, y=0.07)
    charts.save(figure, figures / "large.svg")


def draw_scene(axes: Axes, rows: list[Row], named: bool) -> None:
    """Draw our line, that of one linear solve, of one pass over A, and the peers."""
    ours = tables.chosen(rows, solver="nam")
    dark = {"color": charts.DARK, "linewidth": 1.1}
    for key, style, text in (
        ("product", ":", "one pass over A: A @ x"),
        ("baseline", "--", "one linear solve with A (pyamg, CG)"),
    ):
        look = dark | {"linestyle": style, "label": text}
        charts.lines(axes, ours, "solver", "n", key, lambda _, look=look: look)
    solved = tables.chosen(rows, status="solved")
    charts.lines(axes, solved, "solver", "n", "seconds", charts.looks)
    for row in (row for row in rows if row["status"] != "solved"):
        colour = charts.looks(row["solver"])["color"]
        seconds = float(row["seconds"] or LIMIT)
        axes.plot(int(row["n"]), seconds, "x", color=colour, markersize=7.0)
    if named:
        axes.legend(loc="upper left")
    ratio = csv_files.number(ours[-1]["ratio"])
    if math.isfinite(ratio):
        axes.set_xlabel(f"{ratio:.2f} linear solves at the end", fontsize=7.5)


def draw_piles(axes: Axes, rows: list[Row]) -> None:
    """Draw the contact scenes, which have no linear solve to be compared with."""
    charts.lines(
        axes, rows, "scene", "n", "seconds",
        lambda scene: {"color": charts.BLUE, "marker": PILES[scene], "label": scene},
    )  # fmt: skip
    axes.legend(loc="lower right", fontsize=7.5, handletextpad=0.1, borderpad=0.0)
