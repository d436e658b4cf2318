"""The figures of paper.tables."""

from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from validation.harness import charts, csv_files

Rows = list[dict[str, str]]
NAMES = {"mgs": "MGS", "namgs": "NAMGS", "msor": "MSOR", "namsor": "NAMSOR"}
SHADES = {"4.0": charts.CYAN, "1.0": charts.BLUE, "0.0": charts.PURPLE}


def plot(results: Path, figures: Path) -> None:
    """Draw paper-tables.svg and paper-methods.svg."""
    tables = results / "paper-tables.csv"
    figure, axes = plt.subplots(2, 2, figsize=(charts.WIDTH, 6.2), layout="constrained")
    for column, example in enumerate(("1", "2")):
        rows = [row for row in csv_files.read(tables) if row["example"] == example]
        draw_counts(axes[0, column], rows)
        draw_times(axes[1, column], rows)
        axes[0, column].set_title(f"Example {example}, $\\delta = 4$: sweeps")
        axes[1, column].set_title(f"Example {example}, $\\delta = 4$: time")
    charts.caption(axes[1, 0], tables)
    charts.save(figure, figures / "paper-tables.svg")

    methods = results / "paper-methods.csv"
    figure, pair = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 6.6), sharey=True, layout="constrained"
    )
    for axis, example in zip(pair, ("1", "2"), strict=True):
        rows = [row for row in csv_files.read(methods) if row["example"] == example]
        draw_methods(axis, rows)
        axis.set_title(f"Example {example}, n = 10 000")
    handles, labels = pair[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3)
    charts.caption(pair[0], methods)
    charts.save(figure, figures / "paper-methods.svg")


def draw_counts(axes: Axes, rows: Rows) -> None:
    """Draw computed counts as lines, printed ones as black crosses on them."""
    lines = {}
    for method, name in NAMES.items():
        own = [row for row in rows if row["method"] == method]
        n = [int(row["n"]) for row in own]
        ours = [int(row["iterations"]) for row in own]
        colour, marker = charts.METHODS[method]
        axes.plot(n, ours, color=colour, marker=marker, markersize=7)
        printed = [int(row["printed_iterations"]) for row in own]
        axes.plot(n, printed, "+", color="black", markersize=5, markeredgewidth=0.9)
        lines[name] = list(zip(n, ours, strict=True)), colour
    axes.plot([], [], "+", color="black", label="printed in the paper")
    axes.legend(loc="lower left", handletextpad=0.0)
    axes.set_xscale("log")
    axes.set_xlim(80, 26000)
    axes.set_ylim(0, None)
    axes.set_xlabel("n")
    axes.set_ylabel("sweeps to Res < $10^{-5}$")
    charts.name_lines(axes, lines)


def draw_times(axes: Axes, rows: Rows) -> None:
    """Draw our times with quartiles, and the printed ones dotted; names are above."""
    for method in NAMES:
        own = [row for row in rows if row["method"] == method]
        n = [int(row["n"]) for row in own]
        median, low, high = (
            [1e3 * float(row[key]) for row in own]
            for key in ("time", "time_q1", "time_q3")
        )
        colour, marker = charts.METHODS[method]
        axes.plot(n, median, color=colour, marker=marker)
        axes.vlines(n, low, high, color=colour, linewidth=1.0)
        printed = [1e3 * float(row["printed_time"]) for row in own]
        axes.plot(n, printed, ":", color=colour, marker=marker, fillstyle="none")
    axes.text(1.1e4, 2.6e3, "printed\n(dense)", color=charts.DARK, va="center")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlim(80, 26000)
    axes.set_xlabel("n")
    axes.set_ylabel("time [ms], median and quartiles")


def draw_methods(axes: Axes, rows: Rows) -> None:
    """Draw the counts of every variant at the largest size, failures as crosses."""
    n = max(int(row["n"]) for row in rows)
    rows = [row for row in rows if int(row["n"]) == n]
    names = list(dict.fromkeys(row["variant"] for row in rows))
    limit = max(int(row["cap"]) for row in rows)
    words: dict[int, list[str]] = {}
    for shift, (delta, colour) in zip((-0.24, 0.0, 0.24), SHADES.items(), strict=True):
        own = {row["variant"]: row for row in rows if row["delta"] == delta}
        solved = [k for k, name in enumerate(names) if own[name]["status"] == "solved"]
        counts = [int(own[names[k]]["iterations"]) for k in solved]
        text = f"$\\delta = {float(delta):g}$"
        places = [k + shift for k in solved]
        axes.plot(counts, places, "o", color=colour, label=text, markersize=4.5)
        for k in sorted(set(range(len(names))) - set(solved)):
            row = own[names[k]]
            axes.plot([limit * 1.6], [k + shift], "x", color=colour, markeredgewidth=2)
            word = f"> {row['cap']}" if row["status"] == "max_iter" else row["status"]
            words.setdefault(k, []).append(word)
    for k, said in words.items():
        text = ", ".join(dict.fromkeys(said))
        axes.text(limit * 2.1, k, text, color=charts.DARK, va="center", fontsize=7.0)
    axes.set_xscale("log")
    axes.set_xlim(4.0, limit * 8.0)
    axes.set_yticks(range(len(names)), names)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.set_xlabel("iterations to Res < $10^{-5}$")
    axes.grid(False, axis="y")
    for k in range(1, len(names)):
        axes.axhline(k - 0.5, color="#EEEEEE", linewidth=0.6, zorder=0)
