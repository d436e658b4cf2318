"""The second figure of the front page: small calls, and a sequence, in two panels."""

from pathlib import Path

from matplotlib import pyplot as plt

from validation.harness import charts, csv_files, tables

SCENE, LEVEL = "sparse MPC, definite", "moves a little"
SOLVERS = ("nam", "daqp", "quadprog", "piqp", "proxqp", "clarabel", "osqp", "qpoases")
"""Those that are drawn, where they were measured; other ways to call us are not."""


def plot(results: Path, figures: Path) -> None:
    calls = csv_files.read(results)
    steps = csv_files.read(results.parent / "sequences.csv")
    steps = tables.chosen(steps, scene=SCENE, level=LEVEL)
    figure, panels = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 3.6), width_ratios=(1.5, 1.0)
    )
    figure.subplots_adjust(left=0.08, right=0.99, top=0.9, bottom=0.16, wspace=0.18)
    for axes, rows, across, title, below, beside in (
        (panels[0], calls, "n", "One dense QP, n variables and 2n rows", "n", "call"),
        (panels[1], steps, "variables", "One step of model predictive control",
         "variables (sparse QP, same matrices)", "step"),
    ):  # fmt: skip
        rows = [row for row in rows if row["solver"] in SOLVERS]
        drawn = charts.lines(
            axes, rows, "solver", across, "microseconds", charts.looks, 1e-6
        )
        sizes = tables.distinct(rows, across)
        axes.set_xticks([float(size) for size in sizes], sizes)
        axes.minorticks_off()
        axes.set(title=title, xlabel=below, ylabel=f"time of a {beside} [s]")
        charts.name_lines(axes, drawn)
    charts.save(figure, figures / "front-repeated.svg")
