"""The figure of stress.comparison: one bar for each row and solver."""

import re
from collections import Counter
from pathlib import Path

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Patch, Rectangle
from matplotlib.patheffects import withStroke

from validation.harness import charts, csv_files, tables
from validation.stress.comparison import OUTCOMES, counts

# light to dark in the order of harm, so that they stay apart in grey
LOOKS = {
    "right": ("#A6D8E8", None),
    "inaccurate": ("#B07D00", None),
    "wrong": ("#7A1024", None),
    "gave up": ("#F4F4F4", None),
    "crash or hang": ("#FFFFFF", "//////"),
}
LEGEND = {
    "inaccurate": "found, up to tenfold beyond tolerance",
    "wrong": "wrong without saying so",
    "gave up": "gave up honestly",
}
HEIGHT = 0.74


def plot(csv: Path, figure_file: Path) -> None:
    """Draw the outcomes of every solver (columns) in every row of the table."""
    rows = csv_files.read(csv)
    table = counts(rows)
    names = tables.distinct(rows, "row")
    solvers = tables.distinct(rows, "solver")
    figure, axes = plt.subplots(figsize=(9.6, 0.29 * len(names) + 1.4))
    for i, name in enumerate(names):
        for j, solver in enumerate(solvers):
            bar(axes, j, i, table[name, solver])
    axes.set_xlim(-0.02, len(solvers) - 0.06)
    axes.set_ylim(len(names) - 0.4, -0.6)
    labels = [re.sub(r"10\^\(\+-(\d)\)", r"$10^{\\pm\1}$", name) for name in names]
    axes.set_yticks(range(len(names)), labels)
    axes.set_xticks([j + 0.46 for j in range(len(solvers))], solvers)
    axes.xaxis.tick_top()
    axes.get_xticklabels()[0].set_fontweight("bold")
    axes.tick_params(length=0)
    axes.grid(False)
    axes.spines[:].set_visible(False)
    handles = [
        Patch(facecolor=colour, hatch=hatch, edgecolor=charts.DARK, linewidth=0.4,
              label=LEGEND.get(word, word))
        for word, (colour, hatch) in LOOKS.items()
    ]  # fmt: skip
    axes.legend(
        handles=handles, loc="upper left", bbox_to_anchor=(0.0, 0.0), ncols=5,
        columnspacing=1.2, handlelength=1.4, borderaxespad=0.3,
    )  # fmt: skip
    charts.caption(axes, csv)
    charts.save(figure, figure_file)


def bar(axes: Axes, column: int, line: int, count: Counter[str]) -> None:
    """Draw one bar, 0.92 wide, with the number of right ones unless all are."""
    total, left = sum(count.values()), float(column)
    for word in OUTCOMES:
        width = 0.92 * count[word] / total
        colour, hatch = LOOKS[word]
        if width > 0.0:
            axes.add_patch(
                Rectangle(
                    (left, line - HEIGHT / 2), width, HEIGHT, facecolor=colour,
                    edgecolor=charts.DARK, linewidth=0.4, hatch=hatch,
                )
            )  # fmt: skip
        left += width
    if count["right"] < total:
        axes.text(
            column + 0.03, line, count["right"], va="center", fontsize=7,
            path_effects=[withStroke(linewidth=2.0, foreground="white")],
        )  # fmt: skip
