"""The figures of this room: read the CSV files, compute nothing."""

from pathlib import Path
from typing import Any

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from validation.harness import Row, charts, csv_files, tables
from validation.problems.sequences import LEVELS, SCENES

NAMES = {"nam": "namlcp", "nam by calls": "solve_qp(warm_start=last)"}
STEP, GROUP = 1.0, 4.0  # between the levels of a size, and between sizes


def looks(solver: str) -> dict[str, Any]:
    """Return colour and marker of a solver; our other ways are dashed."""
    colour, marker = charts.SOLVERS[solver.split()[0]]
    return {
        "color": colour,
        "marker": marker,
        "linestyle": "--" if " " in solver else "-",
    }


def draw_sequences(results: Path, file: Path) -> None:
    """Draw a panel for each scene: sizes in groups, levels from left to right."""
    rows = csv_files.read(results)
    figure, panels = plt.subplots(
        (len(SCENES) + 1) // 2, 2, figsize=(charts.WIDTH, 9.6), layout="constrained"
    )
    for axes, scene in zip(panels.flat, SCENES, strict=True):
        draw_scene(axes, scene, tables.chosen(rows, scene=scene))
    for row in panels:
        row[0].set_ylabel("update and solve [µs], median")
    handles = [
        Line2D([], [], label=NAMES.get(solver, solver), **looks(solver))
        for solver in tables.distinct(rows, "solver")
    ]
    handles.append(
        Line2D(
            [], [], label="hollow: a step missed 1e-9", color=charts.DARK, marker="o",
            markerfacecolor="white", linestyle="",
        )
    )  # fmt: skip
    title = "three points of a size, from left: the active set " + ", ".join(LEVELS)
    figure.legend(handles=handles, title=title, loc="outside upper center", ncols=4)
    captioned(panels[-1, 0], results, 60.0)
    charts.save(figure, file)


def captioned(axes: Axes, results: Path, below: float = 46.0) -> None:
    """Write the caption below an axes whose place no longer depends on it."""
    figure = axes.get_figure()
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    charts.caption(axes, results, below)


def draw_scene(axes: Axes, scene: str, rows: list[Row]) -> None:
    """Draw the lines of one scene."""
    sizes = tables.distinct(rows, "size")
    for solver in tables.distinct(rows, "solver"):
        for group, size in enumerate(sizes):
            own = tables.chosen(rows, solver=solver, size=size)
            known = [row for row in own if row["microseconds"]]
            at = [GROUP * group + STEP * LEVELS.index(row["level"]) for row in known]
            times = [float(row["microseconds"]) for row in known]
            line = axes.plot(at, times, **looks(solver))[0]
            missed = [k for k, row in enumerate(known) if row["solved"] != row["steps"]]
            axes.plot(
                [at[k] for k in missed], [times[k] for k in missed], linestyle="",
                marker=line.get_marker(), color=line.get_color(),
                markerfacecolor="white",
            )  # fmt: skip
    axes.set_yscale("log")
    axes.set_title(scene)
    variables = [tables.chosen(rows, size=size)[0]["variables"] for size in sizes]
    names = [f"{size}\n{n} variables" for size, n in zip(sizes, variables, strict=True)]
    axes.set_xticks([GROUP * k + STEP for k in range(len(sizes))], names)
    axes.set_xlabel(SCENES[scene].unit)
    axes.grid(visible=False, axis="x")


def draw_latency(results: Path, file: Path) -> None:
    """Draw time against the number of variables."""
    rows = csv_files.read(results)
    figure, axes = plt.subplots(figsize=(charts.WIDTH * 0.75, 4.6))
    for solver in tables.distinct(rows, "solver"):
        own = [row for row in tables.chosen(rows, solver=solver) if row["microseconds"]]
        label = "namlcp.solve_qp" if solver == "nam by calls" else NAMES.get(solver)
        axes.plot(
            [int(row["n"]) for row in own],
            [float(row["microseconds"]) for row in own],
            label=label or solver,
            **looks(solver),
        )
    axes.set(xscale="log", yscale="log", xlabel="variables n; 2n rows, dense")
    sizes = tables.distinct(rows, "n")
    axes.set_xticks([int(n) for n in sizes], sizes)
    axes.minorticks_off()
    axes.set_ylabel("a call [µs], median")
    axes.set_title("One QP through qpsolvers")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    charts.caption(axes, results)
    charts.save(figure, file)


def draw_batches(results: Path, file: Path) -> None:
    """Draw throughput against the size of the batch, a panel for each shape."""
    rows = csv_files.read(results)
    shapes = tables.distinct(rows, "n", "m")
    figure, panels = plt.subplots(
        1, len(shapes), figsize=(charts.WIDTH, 3.4), sharey=True, layout="constrained"
    )
    names = {"nam": "solve_batch", "nam by calls": "solve_qp, a loop"}
    names["daqp"] = "daqp.solve, a loop"
    for axes, (n, m) in zip(panels, shapes, strict=True):
        for solver, threads in tables.distinct(rows, "solver", "threads"):
            own = tables.chosen(rows, n=n, m=m, solver=solver, threads=threads)
            style = looks(solver) | ({"linestyle": ":"} if threads != "1" else {})
            axes.plot(
                [int(row["items"]) for row in own],
                [float(row["throughput"]) for row in own],
                label=names[solver]
                + (f", {threads} threads" if threads != "1" else ""),
                **style,
            )
        axes.set(xscale="log", yscale="log", title=f"n = {n}, m = {m}")
        axes.set_xlabel("QPs in the batch")
    panels[0].set_ylabel("QPs a second")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside right center")
    captioned(panels[0], results)
    charts.save(figure, file)
