"""The figure of peers.work_precision: six panels, few lines named, all others grey.

A panel is a family of problems, a line the median problem with a marker for each
requested tolerance, the band from the first to the third quartile; what is missed
counts as infinite. The strip above a panel has a mark for each tolerance that a named
solver missed on more than half the problems.
"""

import math
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator

from validation.harness import Row, charts, csv_files, tables

TITLES = {
    "contact": "Contact",
    "MPC": "Model predictive control",
    "SVM": "Support vector machines",
    "general QP": "Maros-Meszaros",
    "obstacle": "Obstacle LCPs",
    "paper": "The paper's LCPs",
}
NAMED = 2  # others than ours that are named, the fastest
RANKED_AT = 1e-8  # requested tolerance at which they are ranked by time
LEAST_ERROR, MOST_ERROR = 3e-17, 1.0  # ends of the horizontal axes
OURS = ("nam", "sweep auto")
SWEEPS = ("sweep pgs", "sweep namsor", "sweep modulus", "sweep lemke")
"""The methods that are named on the paper's LCPs."""


def summary(file: Path) -> list[Row]:
    """Return quartiles of time and error, by family, solver and tolerance."""
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


def named(rows: list[Row], family: str) -> list[str]:
    """Return the solvers of one family that are drawn in colour."""
    if family == "paper":
        return ["sweep auto", *SWEEPS]
    least = min(abs(math.log(row["eps"] / RANKED_AT)) for row in rows)
    ranked = sorted(
        (row["time"][1], row["solver"])
        for row in rows
        if abs(math.log(row["eps"] / RANKED_AT)) == least
        and row["solver"] != "nam"
        and not row["solver"].startswith("sweep ")
    )
    return ["nam", *(solver for _, solver in ranked[:NAMED])]


def plot(results: Path, figures: Path) -> None:
    rows = summary(results)
    figure, panels = plt.subplots(2, 3, figsize=(charts.WIDTH, 5.6), sharex=True)
    figure.subplots_adjust(
        left=0.07, right=0.99, top=0.93, bottom=0.09, hspace=0.3, wspace=0.2
    )
    for axes, (family, title) in zip(panels.flat, TITLES.items(), strict=True):
        own = tables.chosen(rows, family=family)
        if own:
            draw_family(axes, own, named(own, family))
            axes.set_title(f"{title} ({own[0]['problems']})", pad=14.0)
    for axes in panels[:, 0]:
        axes.set_ylabel("time [s]")
    figure.supxlabel("error of the returned point", fontsize=9.0)
    charts.save(figure, figures / "front.svg")


def draw_family(axes: Axes, rows: list[Row], coloured: list[str]) -> None:
    axes.set(xscale="log", yscale="log", xlim=(LEAST_ERROR, MOST_ERROR))
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    lines = {}
    for solver in tables.distinct(rows, "solver"):
        own = tables.chosen(rows, solver=solver)
        done = [row for row in own if math.isfinite(row["time"][1])]
        missed = [row["eps"] for row in own if not math.isfinite(row["time"][1])]
        across = [max(row["error"][1], LEAST_ERROR) for row in done]
        low, middle, high = ([row["time"][k] for row in done] for k in range(3))
        if solver not in coloured:
            if solver.startswith("sweep ") == (rows[0]["family"] == "paper"):
                axes.plot(across, middle, color=charts.LIGHT, linewidth=1.0)
            continue
        name = "nam" if solver in OURS else solver.removeprefix("sweep ")
        style = charts.looks(name)
        lines[style["label"]] = [], style["color"]
        axes.plot(across, middle, markersize=6.0 if name == "nam" else 3.5, **style)
        high = [min(h, 10.0 * y) for h, y in zip(high, middle, strict=True)]
        axes.fill_between(across, low, high, color=style["color"], alpha=0.12)
        axes.plot(
            missed, [1.0 + 0.025 * len(lines)] * len(missed), "x", clip_on=False,
            color=style["color"], markersize=3.5, transform=axes.get_xaxis_transform(),
        )  # fmt: skip
    charts.name_lines(axes, lines)
