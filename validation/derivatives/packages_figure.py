"""The figure of `packages`: time of solve and backward, and errors, beside others.

Usage::

    python -m validation.derivatives.packages_figure [--results DIR] [--figures DIR]
"""

import sys
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from validation.harness import Row, charts, cli, csv_files, tables

LOOKS = {
    "nam": (*charts.SOLVERS["nam"], "namlcp"),
    "proxqp": (*charts.SOLVERS["proxqp"], "proxqp"),
    "qpth": (charts.PURPLE, "s", "qpth"),
    "diffcp": (charts.CYAN, "v", "diffcp (cvxpy)"),
    "dqp": (charts.RED, "P", "dQP over daqp or piqp"),
}
"""Colour, marker and name of each package."""

NAMES = {
    "dense 10": "dense\nn = 10",
    "dense 100": "dense\nn = 100",
    "dense 500": "dense\nn = 500",
    "batch": "batch\n128 of 10",
    "band": "band\nn = 10 000",
}
"""The cases from left to right."""


def plot(results: Path, file: Path) -> None:
    """Draw a panel of times and one of errors."""
    rows = csv_files.read(results)
    figure, (left, right) = plt.subplots(1, 2, figsize=(charts.WIDTH, 3.6))
    figure.subplots_adjust(left=0.07, right=0.99, top=0.9, bottom=0.3, wspace=0.2)
    for solver in LOOKS:
        own = [
            row for row in tables.chosen(rows, solver=solver) if row["case"] in NAMES
        ]
        draw(left, own, [float(row["solve"]) + float(row["backward"]) for row in own])
        draw(right, own, [float(row["error"]) for row in own])
    left.set_title("solve and backward [s of processor time]")
    right.set_title("relative error of the gradients, the worst entry")
    handles, names = left.get_legend_handles_labels()
    figure.legend(handles, names, loc="lower right", ncols=len(LOOKS), fontsize=8.0)
    charts.caption(left, results)
    charts.save(figure, file)


def draw(axes: Axes, rows: list[Row], values: list[float]) -> None:
    """Draw the points of one package; a line joins those that differ in size alone."""
    colour, marker, name = LOOKS[rows[0]["solver"]]
    cases = list(NAMES)
    at = [cases.index(row["case"]) for row in rows]
    dense = sum(row["case"].startswith("dense") for row in rows)
    axes.plot(at[:dense], values[:dense], "-", color=colour)
    axes.plot(at, values, color=colour, marker=marker, linestyle="", label=name)
    axes.set_yscale("log")
    axes.set_xticks(range(len(cases)), list(NAMES.values()))
    axes.grid(visible=False, axis="x")


def main(arguments: list[str] | None = None) -> int:
    """Draw it."""
    args = cli.parser(__doc__, "results", "figures").parse_args(arguments)
    plot(args.results / "derivatives-peers.csv", args.figures / "derivatives.svg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
