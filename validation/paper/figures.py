"""The figures of paper.tables."""

from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from validation.harness import charts, csv_files, tables

Rows = list[dict[str, str]]
NAMES = {"mgs": "MGS", "namgs": "NAMGS", "msor": "MSOR", "namsor": "NAMSOR"}
SHADES = {"4.0": charts.CYAN, "1.0": charts.BLUE, "0.0": charts.PURPLE}


def plot(results: Path, figures: Path) -> None:
    file = results / "paper-tables.csv"
    figure, axes = plt.subplots(2, 2, figsize=(charts.WIDTH, 6.2), layout="constrained")
    for column, example in enumerate(("1", "2")):
        rows = tables.chosen(csv_files.read(file), example=example)
        for line, (word, key, unit) in enumerate(
            (("sweeps", "iterations", 1.0), ("time", "time", 1e3))
        ):
            draw_lines(axes[line, column], rows, key, unit)
            title = f"Example {example}, $\\delta = 4$: {word}"
            axes[line, column].set_title(title)
        axes[0, column].set_ylim(0, None)
        axes[0, column].set_ylabel("sweeps to Res < $10^{-5}$")
        axes[1, column].set_yscale("log")
        axes[1, column].set_ylabel("time [ms], median and quartiles")
    charts.caption(axes[1, 0], file)
    charts.save(figure, figures / "paper-tables.svg")

    file = results / "paper-methods.csv"
    figure, pair = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 6.6), sharey=True, layout="constrained"
    )
    for axis, example in zip(pair, ("1", "2"), strict=True):
        draw_methods(axis, tables.chosen(csv_files.read(file), example=example))
        axis.set_title(f"Example {example}, n = 10 000")
    handles, labels = pair[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper right", ncols=3)
    charts.caption(pair[0], file)
    charts.save(figure, figures / "paper-methods.svg")


def draw_lines(axes: Axes, rows: Rows, key: str, unit: float) -> None:
    """Draw computed numbers as lines, printed ones as hollow marks, dotted."""
    lines = {}
    for method, name in NAMES.items():
        own = tables.chosen(rows, method=method)
        n = [int(row["n"]) for row in own]
        ours, printed = (
            [unit * float(row[column]) for row in own]
            for column in (key, f"printed_{key}")
        )
        colour, marker = charts.METHODS[method]
        axes.plot(n, ours, color=colour, marker=marker)
        axes.plot(n, printed, ":", color=colour, marker=marker, fillstyle="none",
                  markersize=8)  # fmt: skip
        if key == "time":
            ends = (
                [unit * float(row[q]) for row in own] for q in ("time_q1", "time_q3")
            )
            axes.vlines(n, *ends, color=colour, linewidth=1.0)
        lines[name] = list(zip(n, ours, strict=True)), colour
    axes.plot([], [], "o:", color=charts.DARK, fillstyle="none", label="printed")
    axes.legend(loc="best", handletextpad=0.3)
    axes.set_xscale("log")
    axes.set_xlim(80, 26000)
    axes.set_xlabel("n")
    charts.name_lines(axes, lines)


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
