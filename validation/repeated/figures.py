"""The figures of this room: read the CSV files, compute nothing."""

from pathlib import Path
from typing import Any

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from validation.harness import Row, charts, csv_files, tables
from validation.problems.sequences import LEVELS, SCENES

WAYS = {
    "sequences": "solve_qp(warm_start=last)",
    "latency": "namlcp.solve_qp",
    "batches": "solve_qp, a loop",
}
"""What "nam by calls" is in each figure."""
STEP, GROUP = 1.0, 4.0  # between the levels of a size, and between sizes
SCENE, LEVEL = "sparse MPC, definite", "moves a little"  # on the front page
FRONT = ("nam", "daqp", "quadprog", "piqp", "proxqp", "clarabel", "osqp", "qpoases")
"""Solvers of the front page, where they were measured."""


def looks(solver: str, figure: str) -> dict[str, Any]:
    """Return how a line is drawn."""
    style = charts.looks(solver)
    return style | ({"label": WAYS[figure]} if solver == "nam by calls" else {})


def captioned(axes: Axes, results: Path, below: float = 46.0) -> None:
    """Write the caption below an axes whose place no longer depends on it."""
    figure = axes.get_figure()
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    charts.caption(axes, results, below)


def draw_sequences(results: Path, figures: Path) -> None:
    """Draw a panel for each scene: sizes in groups, levels from left to right."""
    rows = csv_files.read(results)
    figure, panels = plt.subplots(
        (len(SCENES) + 1) // 2, 2, figsize=(charts.WIDTH, 9.6), layout="constrained"
    )
    for axes, scene in zip(panels.flat, SCENES, strict=True):
        draw_scene(axes, scene, tables.chosen(rows, scene=scene))
    for row in panels:
        row[0].set_ylabel("update and solve [µs], median")
    title = "three points of a size, from left: the active set " + ", ".join(LEVELS)
    entries = panels[0, 0].get_legend_handles_labels()
    shown = dict(zip(*reversed(entries), strict=True))
    figure.legend(
        shown.values(), shown.keys(), title=title, loc="outside upper center", ncols=4
    )
    captioned(panels[-1, 0], results, 60.0)
    charts.save(figure, figures / "sequences.svg")


def draw_scene(axes: Axes, scene: str, rows: list[Row]) -> None:
    """Draw the lines of one scene."""
    sizes = tables.distinct(rows, "size")
    for solver in tables.distinct(rows, "solver"):
        for group, size in enumerate(sizes):
            own = tables.chosen(rows, solver=solver, size=size)
            known = [row for row in own if row["microseconds"]]
            at = [GROUP * group + STEP * LEVELS.index(row["level"]) for row in known]
            times = [float(row["microseconds"]) for row in known]
            axes.plot(at, times, **looks(solver, "sequences"))
    axes.set_yscale("log")
    axes.set_title(scene)
    variables = [tables.chosen(rows, size=size)[0]["variables"] for size in sizes]
    names = [f"{size}\n{n} variables" for size, n in zip(sizes, variables, strict=True)]
    axes.set_xticks([GROUP * k + STEP for k in range(len(sizes))], names)
    axes.set_xlabel(SCENES[scene].unit)
    axes.grid(visible=False, axis="x")


def draw_latency(results: Path, figures: Path) -> None:
    """Draw time against the number of variables; then the front page's figure."""
    rows = csv_files.read(results)
    figure, axes = plt.subplots(figsize=(charts.WIDTH * 0.75, 4.6))
    charts.lines(
        axes, rows, "solver", "n", "microseconds", lambda s: looks(s, "latency")
    )
    charts.name_ticks(axes, rows, "n")
    axes.set(xlabel="variables n; 2n rows, dense", ylabel="a call [µs], median")
    axes.set_title("One QP through qpsolvers")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    charts.caption(axes, results)
    charts.save(figure, figures / "latency.svg")
    steps = csv_files.read(results.parent / "sequences.csv")
    steps = tables.chosen(steps, scene=SCENE, level=LEVEL)
    if steps:
        draw_front(rows, steps, figures / "front-repeated.svg")


def draw_front(calls: list[Row], steps: list[Row], file: Path) -> None:
    """Draw small calls and a sequence, every line named in its colour."""
    figure, panels = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 3.6), width_ratios=(1.5, 1.0)
    )
    figure.subplots_adjust(left=0.08, right=0.99, top=0.9, bottom=0.16, wspace=0.18)
    for axes, rows, across, title, below, beside in (
        (panels[0], calls, "n", "One dense QP, n variables and 2n rows", "n", "call"),
        (panels[1], steps, "variables", "One step of model predictive control",
         "variables (sparse QP, same matrices)", "step"),
    ):  # fmt: skip
        rows = [row for row in rows if row["solver"] in FRONT]
        drawn = charts.lines(
            axes, rows, "solver", across, "microseconds", charts.looks, 1e-6
        )
        charts.name_ticks(axes, rows, across)
        axes.set(title=title, xlabel=below, ylabel=f"time of a {beside} [s]")
        charts.name_lines(axes, drawn)
    charts.save(figure, file)


def draw_batches(results: Path, figures: Path) -> None:
    """Draw throughput against the size of the batch, a panel for each shape."""
    rows = csv_files.read(results)
    shapes = tables.distinct(rows, "n", "m")
    figure, panels = plt.subplots(
        1, len(shapes), figsize=(charts.WIDTH, 3.4), sharey=True, layout="constrained"
    )
    names = {"nam": "solve_batch", "daqp": "daqp.solve, a loop"}
    for axes, (n, m) in zip(panels, shapes, strict=True):
        for threads in tables.distinct(rows, "threads"):
            more = {"linestyle": ":"} if threads != "1" else {}
            text = f", {threads} threads" if threads != "1" else ""

            def style(solver: str, more: Any = more, text: str = text) -> Any:
                found = looks(solver, "batches") | more
                return found | {"label": names.get(solver, found["label"]) + text}

            own = tables.chosen(rows, n=n, m=m, threads=threads)
            charts.lines(axes, own, "solver", "items", "throughput", style)
        axes.set(title=f"n = {n}, m = {m}", xlabel="QPs in the batch")
    panels[0].set_ylabel("QPs a second")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center")
    captioned(panels[0], results)
    charts.save(figure, figures / "batches.svg")
