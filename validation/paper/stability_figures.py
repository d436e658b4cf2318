"""The figures of paper.stability."""

import textwrap
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from validation.harness import charts, csv_files, tables

Rows = list[dict[str, str]]
FAILURES = {"slow": "#F2B134", "cycles": "#D6336C", "diverges": "#222222"}
COUNTS = ListedColormap(plt.get_cmap("YlGnBu")(np.linspace(0.0, 0.87, 256)))
LIMITS = LogNorm(5.0, 2000.0)
CURVES = {"msor": 2.0, "namsor": 2.0, "maor": 2.0, "namaor": 2.0, "amsor": 1.0}
"""k of the white line c = alpha^-k / k: Omega = D/(2 alpha^2) or D/alpha."""
AXES = {"alpha": "$\\alpha$", "c": "c, $\\Omega$ = c D", "c I": "c, $\\Omega$ = c I"}


def name_of(method: str) -> str:
    names = {"modulus": "modulus", "modified-nam": "modified NAM"}
    zero = ", $\\beta$ = 0" if method in ("maor", "namaor") else ""
    return names.get(method, method.upper()) + zero


def panels(rows: Rows, height: float, **shared: bool) -> tuple[Figure, Any, Any]:
    classes = tables.distinct(rows, "class")
    methods = tables.distinct(rows, "method", "shift")
    figure, grid = plt.subplots(
        len(methods), len(classes), figsize=(11.5, height), layout="constrained",
        **shared,
    )  # fmt: skip
    for axes, name in zip(grid[0], classes, strict=True):
        title = textwrap.fill(name, 14, break_on_hyphens=False)
        axes.set_title(title, fontsize=8.5)
    found = []
    for line, (method, shift) in zip(grid, methods, strict=True):
        for axes, name in zip(line, classes, strict=True):
            wanted = {"class": name, "method": method, "shift": shift}
            found.append((axes, tables.chosen(rows, **wanted)))
    return figure, grid, found


def plot(results: Path, figures: Path) -> None:
    rows = csv_files.read(results / "stability.csv")
    plot_maps([row for row in rows if row["axes"] == "alpha c"], figures)
    plot_strips([row for row in rows if row["axes"] != "alpha c"], figures)
    plot_units(csv_files.read(results / "stability-units.csv"), figures)


@cache
def colour(cell: str) -> tuple[float, ...]:
    if cell in FAILURES:
        return to_rgb(FAILURES[cell])
    return COUNTS(LIMITS(max(float(cell), LIMITS.vmin or 1.0)))[:3]


def legend(figure: Figure, axes: Any, what: str) -> None:
    """Add the colour bar of the counts and the colours of the failures."""
    bar = figure.colorbar(
        ScalarMappable(LIMITS, COUNTS), ax=axes, location="right", shrink=0.5,
        aspect=30, pad=0.01,
    )  # fmt: skip
    bar.set_label(f"{what} to Res < $10^{{-6}}$ Res($z_0$)")
    ticks = [5, 10, 20, 50, 100, 200, 500, 1000, 2000]
    bar.set_ticks(ticks, labels=[str(tick) for tick in ticks])
    words = ("slow: falls steadily, not there in time",
             "cycles or wanders: no measurable progress", "diverges")  # fmt: skip
    pairs = zip(FAILURES.values(), words, strict=True)
    patches = [Patch(color=colour, label=text) for colour, text in pairs]
    figure.legend(handles=patches, loc="outside lower center", ncols=3)


def show(axes: Axes, rows: Rows, names: list[str], extent: tuple[float, ...]) -> None:
    cells = np.array([[colour(row[name]) for name in names] for row in rows])
    axes.imshow(cells, extent=extent, aspect="auto", interpolation="nearest")
    axes.grid(False)
    axes.tick_params(length=2, labelsize=7)
    for spine in axes.spines.values():
        spine.set(visible=True, linewidth=0.5, color=charts.DARK)


def title_of(row: dict[str, str]) -> str:
    return name_of(row["method"]) + (f"\n(E = {row['shift']})" if row["shift"] else "")


def plot_maps(rows: Rows, figures: Path) -> None:
    """Draw c against alpha for every class (column) and method (row)."""
    names = [name for name in rows[0] if name[:2] in ("0.", "1.")]
    alphas = [float(name) for name in names]
    dx, x = (alphas[1] - alphas[0]) / 2, np.linspace(alphas[0], alphas[-1], 50)
    figure, grid, found = panels(rows, 10.2, sharex=True, sharey=True)
    for axes, own in found:
        powers = [np.log2(float(row["c"])) for row in own]
        dy = (powers[0] - powers[1]) / 2
        ends = powers[-1] - dy, powers[0] + dy
        show(axes, own, names, (alphas[0] - dx, alphas[-1] + dx, *ends))
        k = CURVES[own[0]["method"]]
        axes.plot(x, 1.0 - k - k * np.log2(x), color="white", linewidth=0.9)
        if k == 1.0:
            axes.plot([1.0], [0.0], "o", color="white", markersize=3)
        axes.set_ylim(ends)
        axes.set_xticks([0.5, 1.0, 1.5])
        axes.set_yticks([-4, -2, 0, 2, 4], ["1/16", "1/4", "1", "4", "16"])
    for line, (_, own) in zip(grid, found[:: grid.shape[1]], strict=True):
        line[0].set_ylabel(f"{title_of(own[0])}\nc", fontsize=8)
    for axes in grid[-1]:
        axes.set_xlabel("$\\alpha$", fontsize=8)
    legend(figure, grid, "sweeps")
    figure.suptitle(
        "Sweep methods over $\\alpha$ and c in $\\Omega$ = c D.  White line: "
        "$\\Omega = D/(2\\alpha^2)$, the paper's; in AMSOR $\\Omega = D/\\alpha$, "
        "which is projected SOR (dot: projected Gauss-Seidel)",
        fontsize=9,
    )
    charts.save(figure, figures / "stability-maps.png")


def plot_strips(rows: Rows, figures: Path) -> None:
    """Draw the methods with one parameter."""
    figure, grid, found = panels(rows, 5.2)
    for axes, own in found:
        relaxed = own[0]["axes"] == "alpha"
        x = [float(row["c"]) for row in own]
        x = x if relaxed else [float(np.log2(value)) for value in x]
        step = (x[1] - x[0]) / 2
        cells = {str(k): row["only"] for k, row in enumerate(own)}
        show(axes, [cells], list(cells), (x[0] - step, x[-1] + step, 0.0, 1.0))
        axes.set_yticks([])
        if relaxed:
            axes.set_xticks([0.5, 1.0, 1.5])
        else:
            axes.set_xticks([-6, 0, 6], ["1/64", "1", "64"])
    for line, (_, own) in zip(grid, found[:: grid.shape[1]], strict=True):
        line[0].set_ylabel(
            f"{title_of(own[0])}\n{AXES[own[0]['axes']]}",
            fontsize=8, rotation=0, ha="right", va="center",
        )  # fmt: skip
    legend(figure, grid, "iterations")
    charts.save(figure, figures / "stability-factored.png")


def plot_units(rows: Rows, figures: Path) -> None:
    """Draw delta against the unit of A and q for every method."""
    methods = tables.distinct(rows, "method", "shift")
    names = [name for name in rows[0] if name.lstrip("-").isdigit()]
    deltas = tables.distinct(rows, "delta")
    figure, grid = plt.subplots(
        3, 7, figsize=(11.5, 6.0), sharex=True, sharey=True, layout="constrained"
    )
    for axes, (method, shift) in zip(grid.flat, methods, strict=False):
        own = tables.chosen(rows, method=method, shift=shift)
        sides = float(names[0]) - 0.5, float(names[-1]) + 0.5
        show(axes, own, names, (*sides, len(deltas) - 0.5, -0.5))
        text = name_of(method).split(",")[0] + (f", E = {shift}" if shift else "")
        axes.set_title(text, fontsize=8.5)
        axes.set_xticks([-6, -3, 0, 3, 6], [f"$10^{{{k}}}$" for k in (-6, -3, 0, 3, 6)])
        axes.set_yticks(range(len(deltas)), [f"{float(d):g}" for d in deltas])
    for axes in grid.flat[len(methods) :]:
        axes.axis("off")
    for axes in grid[:, 0]:
        axes.set_ylabel("$\\delta$")
    for axes in grid[-1]:
        axes.set_xlabel("unit of A and q", fontsize=8)
    legend(figure, grid, "iterations")
    charts.save(figure, figures / "stability-units.png")
