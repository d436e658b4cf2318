"""The second figure of the front page: small calls, and a sequence, in two panels.

Usage::

    python -m validation.repeated.front_figure [--results DIR] [--figures DIR]

It reads latency.csv and sequences.csv and computes nothing. Every line is named, in its
colour; namlcp is drawn strong.
"""

import sys
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from validation.harness import Row, charts, cli, csv_files, tables

SCENE, LEVEL = "sparse MPC, definite", "moves a little"
SOLVERS = ("nam", "daqp", "quadprog", "piqp", "proxqp", "clarabel", "osqp", "qpoases")
"""Those that are drawn, where they were measured; other ways to call us are not."""


def draw_lines(axes: Axes, rows: list[Row], across: str) -> None:
    """Draw time against a column, a line for each solver, and name the lines."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    lines = {}
    for solver in SOLVERS:
        own = tables.chosen(rows, solver=solver)
        points = [
            (float(row[across]), 1e-6 * float(row["microseconds"]))
            for row in own
            if row["microseconds"]
        ]
        if not points:
            continue
        ours = solver == "nam"
        width, size, top = (2.6, 6.0, 5) if ours else (1.3, 3.5, 3)
        colour = charts.SOLVERS[solver][0]
        style = {"color": colour, "linewidth": width, "markersize": size}
        axes.plot(*zip(*points, strict=True), "o-", zorder=top, **style)
        lines["namlcp" if ours else solver] = points, colour
    sizes = tables.distinct(rows, across)
    axes.set_xticks([float(n) for n in sizes], sizes)
    axes.minorticks_off()
    charts.name_lines(axes, lines)


def draw(results: Path, file: Path) -> None:
    """Draw both panels."""
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 3.6), width_ratios=(1.5, 1.0)
    )
    figure.subplots_adjust(left=0.08, right=0.99, top=0.9, bottom=0.16, wspace=0.18)
    calls = csv_files.read(results / "latency.csv")
    left.set_title("One dense QP, n variables and 2n rows")
    left.set_ylabel("time of a call [s]")
    left.set_xlabel("n")
    draw_lines(left, calls, "n")
    steps = csv_files.read(results / "sequences.csv")
    right.set_title("One step of model predictive control")
    right.set_ylabel("time of a step [s]")
    right.set_xlabel("variables (sparse QP, same matrices)")
    draw_lines(right, tables.chosen(steps, scene=SCENE, level=LEVEL), "variables")
    charts.save(figure, file)


def main(arguments: list[str] | None = None) -> int:
    """Draw it."""
    args = cli.parser(__doc__, "results", "figures").parse_args(arguments)
    draw(args.results, args.figures / "front-repeated.svg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
