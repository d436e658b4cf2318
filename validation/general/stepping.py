"""Discs that fall with friction for 300 steps: an LCP each, from the last one or not.

A row for every step: unknowns, method, Res over max |q_i|, processor time, energy and
deepest overlap; the figure draws them with the last state of one run. The scene:
`namlcp.scenes.stepping`. Exits with 1 if a step was not solved.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection

from namlcp.scenes.stepping import STEP, FallingDiscs
from validation.harness import Job, Row, charts, csv_files, tables
from validation.harness.suite import Args, Suite

COUNTS = (5, 10, 30, 60)
QUICK = (5, 10)
STEPS = 300
DRAWN = 30  # discs of the run that is drawn
STARTS = {"last step": (charts.BLUE, "o"), "nothing": (charts.GREY, "x")}


def work(job: Job, count: int, start: str) -> Row:
    """Let discs fall; return the rows of all steps."""
    warm_up = FallingDiscs(QUICK[0])
    for _ in range(STEPS):
        warm_up.step()
    job.ready()
    discs = FallingDiscs(count, warm=start == "last step")
    records = [discs.step()._asdict() for _ in range(STEPS)]
    return {"rows": [r | {"status": r["status"].value} for r in records]}


def requests(args: Args) -> Iterator[Row]:
    """Yield the counts of discs, each from the last step and from nothing."""
    for count in QUICK if args.quick else COUNTS:
        for start in STARTS:
            yield {"discs": count, "start": start, "solver": "nam"}


def conclude(rows: list[Row]) -> list[Row]:
    """Return a row for each step."""
    steps = rows[0].get("rows", [{"status": rows[0].get("status")}])
    return [rows[0] | {"step": k} | step for k, step in enumerate(steps)]


def markdown(rows: list[Row]) -> str:
    """Return the table of every run: unknowns, times and worst figures."""
    lines = []
    for count, start in tables.distinct(rows, "discs", "start"):
        own = tables.chosen(rows, discs=count, start=start)
        n, seconds, residual, overlap, energy = (
            np.array([float(row[key]) for row in own])
            for key in ("n", "seconds", "residual", "overlap", "energy")
        )
        unsolved = sum(row["status"] != "solved" for row in own)
        lines.append((
            count, start, int(n.max()), f"{1e3 * seconds.mean():.3g}",
            f"{1e3 * seconds.max():.3g}", unsolved, f"{residual.max():.1e}",
            f"{overlap.max():.1e}", f"{np.diff(energy).max():.1e}",
        ))  # fmt: skip
    columns = ("discs", "start from", "largest n", "ms a step", "at most", "not solved",
               "worst Res", "overlap [m]", "energy gained, at most [J]")  # fmt: skip
    return tables.markdown(columns, lines)


def draw_state(axes: Axes) -> None:
    """Draw the discs after the last step, and the normal impulses between them."""
    discs = FallingDiscs(DRAWN)
    paths = [discs.centre[:, :2]]
    for _ in range(STEPS):
        discs.step()
        paths.append(discs.centre[:, :2])
    size = 2.0 * discs.radius
    axes.add_collection(EllipseCollection(
        size, size, 0.0 * size, units="xy", offsets=paths[-1], edgecolor=charts.DARK,
        offset_transform=axes.transData, facecolor="#EEEEEE", linewidth=0.7,
    ))  # fmt: skip
    falls = np.array(paths).transpose(1, 0, 2)
    axes.add_collection(LineCollection(falls, colors=charts.CYAN, linewidths=0.4))
    contacts, _ = discs.contacts()
    names = zip(contacts.first.tolist(), contacts.second.tolist(), strict=True)
    impulse = np.array([discs.last.get(name, np.zeros(4))[0] for name in names])
    reach = 0.3 * contacts.normal[:, :2]
    lines = np.stack((contacts.point[:, :2] - reach, contacts.point[:, :2] + reach), 1)
    widths = 4.0 * np.sqrt(impulse / impulse.max())
    axes.add_collection(
        LineCollection(lines, linewidths=widths, colors=charts.PURPLE, zorder=3)
    )
    top = paths[0][:, 1].max() + 0.6
    box = np.array([[0.0, top], [0.0, 0.0], [discs.width, 0.0], [discs.width, top]])
    axes.plot(*box.T, color=charts.DARK)
    axes.set_aspect("equal")
    axes.set(xticks=[], yticks=[], title=f"{DRAWN} discs: paths and last impulses")
    axes.grid(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)


def plot(results: Path, figures: Path) -> None:
    """Draw the last state, energy, overlap and complementarity, time against n."""
    rows = csv_files.read(results)
    counts = tables.distinct(rows, "discs")
    shown = str(DRAWN) if str(DRAWN) in counts else counts[-1]
    own = tables.chosen(rows, discs=shown, start="last step")
    time = STEP * np.array([int(row["step"]) for row in own])
    figure, panels = plt.subplots(
        2, 2, figsize=(charts.WIDTH, 6.4), layout="constrained"
    )
    draw_state(panels[0, 0])
    energy = [float(row["energy"]) for row in own]
    panels[0, 1].plot(time, energy, color=charts.BLUE)
    panels[0, 1].set(title=f"energy of {shown} discs [J]", xlabel="time [s]")
    panels[0, 1].set_ylim(bottom=0.0)
    for key, colour, text in (
        ("residual", charts.BLUE, "Res over max |q|"),
        ("overlap", charts.PURPLE, "deepest overlap [m]"),
    ):
        values = np.maximum([float(row[key]) for row in own], 1e-18)
        panels[1, 0].semilogy(
            time, values, ".", color=colour, markersize=2.5, label=text
        )
    panels[1, 0].set(title="complementarity and overlap", xlabel="time [s]")
    panels[1, 0].set_ylim(1e-18, 1e-2)
    panels[1, 0].legend(loc="upper left", ncols=2)
    for start, (colour, marker) in STARTS.items():
        some = tables.chosen(rows, start=start)
        n = [max(int(row["n"]), 1) for row in some]
        panels[1, 1].loglog(
            n, [1e3 * float(row["seconds"]) for row in some], marker, color=colour,
            markersize=2.0, alpha=0.5, label=f"started from {start}",
        )  # fmt: skip
    panels[1, 1].set(title="one step", xlabel="n", ylabel="processor time [ms]")
    panels[1, 1].legend(loc="upper left")
    charts.save(figure, figures / "time-stepping.png")


SUITE = Suite(
    name="time-stepping",
    doc=__doc__,
    requests=requests,
    work=work,
    conclude=conclude,
    columns="discs start step n status method residual seconds energy overlap",
    keys="discs start",
    limit=600.0,
    shown="discs start step status residual seconds",
    table=markdown,
    plot=plot,
    failed=lambda rows: any(row["status"] != "solved" for row in rows),
)
main = SUITE.main

if __name__ == "__main__":
    sys.exit(main())
