"""Performance profiles: how many problems are solved within a factor of the fastest.

run
    profiles.csv: a row for each set, problem, solver and tolerance (1e-3, 1e-6, 1e-9),
    judged and timed as benchmark does. Model predictive control and contact are
    measured here; a run that was stopped goes on where its file ends. Maros-Meszaros
    (dense subset, strictly convex, all) is taken over from maros-meszaros.csv, which
    maros_meszaros measures: each panel's times are those of one run.
plot
    profiles.svg from profiles.csv. What is not solved has an infinite ratio and is
    never counted; the dotted line is the size of the set.

--quick: a quarter of the control problems and no contact scene above 300 unknowns.
"""

import argparse
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from qpsolvers import Problem

from validation.harness import (
    Bench,
    MissingDataError,
    Row,
    charts,
    cli,
    csv_files,
    machine,
    qps,
    tables,
)
from validation.peers.maros_meszaros import SUBSETS, at_limit, by_solver, read_results
from validation.peers.runs import (
    late_ones,
    loosest_first,
    measure,
    read_rows,
    run_problem,
)
from validation.peers.work_precision import DENSE, QUICK_LIMIT, SOLVERS
from validation.problems import data_sets

TOLERANCES = [1e-3, 1e-6, 1e-9]
COLUMNS = "set problem solver eps runtime success status".split()
MEASURED = {"mpc": "MPC", "contact": "contact"}
STORED = ("dense", "strictly convex", "all")
LIMIT = 10.0  # [s], that of maros-meszaros.csv too
FARTHEST = 1e4  # ratio up to which a line is drawn


def load_dense(data: Path, problem_set: str, name: str) -> Problem:
    """Return a problem with dense matrices."""
    return qps.filled(data_sets.load(data, problem_set, name))


def names_of(data: Path, problem_set: str, quick: bool) -> list[str]:
    """Return the names of a set that are measured."""
    names = data_sets.set_names(data, problem_set)
    if not quick:
        return names
    if problem_set == "mpc":
        return names[::4]
    return [n for n in names if data_sets.load(data, problem_set, n).q.size <= 300]


def measured(
    args: argparse.Namespace, solvers: list[str], rows: list[Row]
) -> Iterator[Row]:
    """Yield the rows of the sets that are measured here, but for those there are."""
    for problem_set, title in MEASURED.items():
        names = names_of(args.data, problem_set, args.quick)
        for solver in solvers:
            own = tables.chosen(rows, solver=solver, set=title)
            have = {(row["eps"], row["problem"]) for row in own}
            wanted = [
                (eps, name)
                for eps, name in loosest_first(TOLERANCES, names)
                if (eps, name) not in have
            ]
            if not wanted:
                continue
            work = partial(measure, load=load_dense) if solver in DENSE else measure
            with Bench(work, solver, args.limit, args.data) as child:
                slow = late_ones(rows, title, solver)
                for eps, name in wanted:
                    row = run_problem(child, problem_set, name, eps, slow)
                    yield row | {"set": title}


def stored(args: argparse.Namespace) -> Iterator[Row]:
    """Yield the rows of the Maros-Meszaros subsets from the file of their own run."""
    own = args.results / "maros-meszaros.csv"
    rows = read_results(own if own.exists() else cli.RESULTS / own.name)
    if not rows:
        print("maros-meszaros.csv: no results, left out")
        return
    rows = at_limit(rows, min(row["limit"] for row in rows))
    index = data_sets.maros_index(args.data, "all")
    for subset in STORED:
        for row in rows:
            if SUBSETS[subset](index[row["problem"]]):
                yield row | {"set": f"Maros-Meszaros, {subset}"}


def run(args: argparse.Namespace) -> int:
    """Write what the file does not have yet; return 2 if the data are missing."""
    solvers = machine.installed(args.solvers)
    header = cli.begin(solvers, *machine.not_installed(args.solvers, solvers))
    file = args.results / f"{args.stem}.csv"
    rows = known(file)
    missing: list[str] = []
    with csv_files.writer(file, header, COLUMNS, append=True) as write:
        try:
            for row in measured(args, solvers, rows):
                write(row)
                tables.print_row(row, "set problem:16 solver eps:7 runtime status:30")
        except MissingDataError as error:
            missing.append(str(error))
    rows = [row for row in known(file) if row["set"] in MEASURED.values()]
    try:
        rows += stored(args)
    except MissingDataError as error:
        missing.append(str(error))
    with csv_files.writer(file, header, COLUMNS) as write:
        for row in rows:
            write(row)
    for text in missing:
        print(f"{text}; left out")
    return cli.MISSING if missing else 0


def known(file: Path) -> list[Row]:
    """Return the rows that are written, as numbers; the last one stands."""
    keys = "set problem solver eps".split()
    rows = {tuple(row[key] for key in keys): row for row in read_rows(file)}
    return list(rows.values())


def draw_profile(axes: Axes, rows: list[Row], total: int) -> None:
    """Draw how many problems each solver solves within a factor of the fastest.

    What is not solved has an infinite ratio and never counts.
    """
    best: dict[str, float] = {}
    for row in rows:
        if row["success"]:
            name = row["problem"]
            best[name] = min(best.get(name, np.inf), row["runtime"])
    for solver, own in reversed(by_solver(rows).items()):
        solved = tables.chosen(own, success=True)
        ratios = np.sort([row["runtime"] / best[row["problem"]] for row in solved])
        x = np.concatenate(([1.0], ratios, [FARTHEST]))
        y = np.concatenate(([0], np.arange(1, ratios.size + 1), [ratios.size]))
        colour = charts.SOLVERS[solver][0]
        width = 2.4 if solver == "nam" else 1.2
        name = "namlcp" if solver == "nam" else solver
        label = f"{name} {ratios.size}"
        axes.step(x, y, where="post", color=colour, linewidth=width, label=label)
    axes.axhline(total, color=charts.DARK, linestyle=":", linewidth=1.0)
    axes.set_xscale("log")
    axes.set_xlim(1.0, FARTHEST)
    axes.set_ylim(0, total * 1.04)
    axes.legend(
        loc="lower right", reverse=True, fontsize=6.5, labelspacing=0.15,
        handlelength=1.2, borderaxespad=0.2,
    )  # fmt: skip


def plot(results: Path, file: Path) -> None:
    """Draw a row of panels for each set that the file has."""
    rows = known(results)
    sets = tables.distinct(rows, "set")
    if not sets:
        print(f"{results.name} has no rows: nothing to draw")
        return
    figure, axes = plt.subplots(
        len(sets), 3, figsize=(charts.WIDTH, 2.6 * len(sets) + 0.4), sharex=True,
        layout="constrained", squeeze=False,
    )  # fmt: skip
    for line, name in zip(axes, sets, strict=True):
        total = len(tables.distinct(tables.chosen(rows, set=name), "problem"))
        for panel, eps in zip(line, TOLERANCES, strict=True):
            draw_profile(panel, tables.chosen(rows, set=name, eps=eps), total)
            panel.set_title(f"eps = {eps:.0e}", fontsize=8.5)
        line[0].set_ylabel(f"{name}\nsolved, of {total}")
    for panel in axes[-1]:
        panel.set_xlabel("time over the fastest solver's")
    charts.caption(axes[-1, 0], results)
    axes[-1, 0].texts[-1].set_in_layout(False)  # it is wider than its panel
    charts.save(figure, file)


def main(arguments: list[str] | None = None) -> int:
    """Run or plot."""
    parser = cli.parser(
        __doc__, "quick", "results", "figures", data=Path("(no --data)"),
        solvers=SOLVERS, limit=None,
    )  # fmt: skip
    parser.add_argument("task", choices=["run", "plot"])
    args = parser.parse_args(arguments)
    args.limit = args.limit or (QUICK_LIMIT if args.quick else LIMIT)
    args.stem = "profiles-quick" if args.quick else "profiles"
    if args.task == "run":
        return run(args)
    plot(args.results / f"{args.stem}.csv", args.figures / f"{args.stem}.svg")
    return 0


if __name__ == "__main__":
    sys.exit(main())
