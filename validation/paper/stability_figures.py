"""The figures of paper.stability."""

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
NAMES = {
    "msor": "MSOR",
    "maor": "MAOR, $\\beta$ = 0",
    "namsor": "NAMSOR",
    "namaor": "NAMAOR, $\\beta$ = 0",
    "amsor": "AMSOR",
    "psor": "PSOR",
    "modulus": "modulus",
    "nam": "NAM",
    "modified-nam": "modified NAM",
    "mgs": "MGS",
    "amgs": "AMGS",
    "pgs": "PGS",
    "namj": "NAMJ",
    "namgs": "NAMGS",
}
TITLES = {
    "dominant M-matrix": "dominant\nM-matrix",
    "Laplacian": "Laplacian",
    "SPD, not H": "SPD,\nnot H",
    "singular contact, discs": "singular contact,\ndiscs",
    "singular contact, bricks": "singular contact,\nbricks",
    "badly scaled rows": "badly scaled\nrows, H+",
    "nonsymmetric H+": "nonsymmetric\nH+",
    "dense positive": "dense\npositive",
}


def plot(results: Path, figures: Path) -> None:
    """Draw the three figures."""
    rows = csv_files.read(results / "stability.csv")
    plot_maps([row for row in rows if row["axes"] == "alpha c"], figures)
    plot_strips([row for row in rows if row["axes"] != "alpha c"], figures)
    plot_units(csv_files.read(results / "stability-units.csv"), figures)


@cache
def colour(cell: str) -> tuple[float, ...]:
    """Return the colour of a cell: a count, or a failure by name."""
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
    bar.set_ticks([5, 10, 20, 50, 100, 200, 500, 1000, 2000])
    bar.set_ticklabels(["5", "10", "20", "50", "100", "200", "500", "1000", "2000"])
    words = {
        "slow": "slow: falls steadily, not there in time",
        "cycles": "cycles or wanders: no measurable progress",
        "diverges": "diverges",
    }
    patches = [Patch(color=FAILURES[name], label=text) for name, text in words.items()]
    figure.legend(handles=patches, loc="outside lower center", ncols=3)


def show(axes: Axes, rows: Rows, names: list[str], extent: tuple[float, ...]) -> None:
    """Draw a table of cells, columns by name, in a thin frame without a grid."""
    cells = np.array([[colour(row[name]) for name in names] for row in rows])
    axes.imshow(cells, extent=extent, aspect="auto", interpolation="nearest")
    axes.grid(False)
    axes.tick_params(length=2, labelsize=7)
    for spine in axes.spines.values():
        spine.set(visible=True, linewidth=0.5, color=charts.DARK)


def title_of(method: str, shift: str) -> str:
    """Return the name of a method with its shift."""
    return NAMES[method] + (f"\n(E = {shift})" if shift else "")


def plot_maps(rows: Rows, figures: Path) -> None:
    """Draw c against alpha for every class (column) and method (row)."""
    classes, methods = (
        tables.distinct(rows, *keys) for keys in (("class",), ("method", "shift"))
    )
    names = [name for name in rows[0] if name[:2] in ("0.", "1.")]
    alphas = [float(name) for name in names]
    figure, grid = plt.subplots(
        len(methods), len(classes), figsize=(11.5, 10.2), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    for line, (method, shift) in zip(grid, methods, strict=True):
        for axes, name in zip(line, classes, strict=True):
            wanted = {"class": name, "method": method, "shift": shift}
            own = tables.chosen(rows, **wanted)
            powers = [np.log2(float(row["c"])) for row in own]
            dx, dy = alphas[1] - alphas[0], powers[0] - powers[1]
            sides = alphas[0] - dx / 2, alphas[-1] + dx / 2
            show(axes, own, names, (*sides, powers[-1] - dy / 2, powers[0] + dy / 2))
            x = np.linspace(alphas[0], alphas[-1], 50)
            if method in ("msor", "namsor", "maor", "namaor"):
                axes.plot(x, -1.0 - 2.0 * np.log2(x), color="white", linewidth=0.9)
            if method == "amsor":
                axes.plot(x, -np.log2(x), color="white", linewidth=0.9)
                axes.plot([1.0], [0.0], "o", color="white", markersize=3)
            axes.set_ylim(powers[-1] - dy / 2, powers[0] + dy / 2)
            axes.set_xticks([0.5, 1.0, 1.5])
            axes.set_yticks([-4, -2, 0, 2, 4], ["1/16", "1/4", "1", "4", "16"])
        line[0].set_ylabel(f"{title_of(method, shift)}\nc", fontsize=8)
    for axes, name in zip(grid[0], classes, strict=True):
        axes.set_title(TITLES[name], fontsize=8.5)
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
    classes, methods = (
        tables.distinct(rows, *keys) for keys in (("class",), ("method", "shift"))
    )
    figure, grid = plt.subplots(
        len(methods), len(classes), figsize=(11.5, 5.2), layout="constrained"
    )
    for line, (method, shift) in zip(grid, methods, strict=True):
        for axes, name in zip(line, classes, strict=True):
            wanted = {"class": name, "method": method, "shift": shift}
            own = tables.chosen(rows, **wanted)
            relaxed = own[0]["axes"] == "alpha"
            x = [float(row["c"]) for row in own]
            x = x if relaxed else [float(np.log2(value)) for value in x]
            step = (x[1] - x[0]) / 2
            line_of_cells = {str(k): row["only"] for k, row in enumerate(own)}
            extent = (x[0] - step, x[-1] + step, 0.0, 1.0)
            show(axes, [line_of_cells], list(line_of_cells), extent)
            axes.set_yticks([])
            if relaxed:
                axes.set_xticks([0.5, 1.0, 1.5])
            else:
                axes.set_xticks([-6, 0, 6], ["1/64", "1", "64"])
        unit = {
            "alpha": "$\\alpha$",
            "c": "c, $\\Omega$ = c D",
            "c I": "c, $\\Omega$ = c I",
        }
        line[0].set_ylabel(
            f"{title_of(method, shift)}\n{unit[own[0]['axes']]}",
            fontsize=8, rotation=0, ha="right", va="center",
        )  # fmt: skip
    for axes, name in zip(grid[0], classes, strict=True):
        axes.set_title(TITLES[name], fontsize=8.5)
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
        text = NAMES[method].split(",")[0] + (f", E = {shift}" if shift else "")
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
