"""A suite: problems, solvers and tolerances as data, and the one way to run them.

A request is a row with the keys of the suite; one that names no solver asks all of
them. Requests that follow each other and differ in the solver alone are one problem.
Each solver answers in a child process (`processes.Bench`). A row is in the CSV file as
soon as it is known; with --go-on a run leaves out what the file has.
"""

import argparse
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from validation.harness import cli, machine, tables
from validation.harness.processes import LATE, OURS, Bench, Work
from validation.harness.tables import Growing, Row

PEER_TIMES, PEER_LEAST = 10.0, 1.0  # times of namlcp's, [s]: see `limit_beside`
SHOWN = 12  # columns that are printed
Args = argparse.Namespace


class Late(NamedTuple):
    """What is late is not asked for more.

    A solver that ran into the time limit `times` times is not asked again where the
    columns `same` are the same and `by` is as hard: a tolerance as small, a size as
    large. If `copied`, a row says so all the same. `words` are what it says then.
    """

    by: str = "eps"
    same: tuple[str, ...] = ("set", "problem")
    copied: bool = True
    times: int = 1
    words: frozenset[str] = frozenset(LATE)

    def hardness(self, row: Row) -> float:
        value = float(row[self.by])
        return -value if self.by == "eps" else value

    def alike(self, row: Row) -> tuple[str, ...]:
        return row["solver"], *(str(row[name]) for name in self.same)


NEVER_LATE = Late(same=(), words=frozenset())


def solved(row: Row) -> bool:
    return str(row.get("success")) == "True"


def is_ours(solver: str) -> bool:
    return solver.split()[0] in OURS


def limit_beside(ours: list[float], most: float) -> float:
    """Return the limit [s] of a peer where namlcp has taken `ours`, if it solved."""
    return min(most, max(PEER_LEAST, PEER_TIMES * min(ours, default=most)))


@dataclass(frozen=True, kw_only=True)
class Suite:
    """Problems, solvers and tolerances, what a child does, and what is made of it.

    `columns` are those of the file, the keys of a request before the bar.
    `requests(args)` yields what is asked, in this order, and may raise a
    MissingDataError at its end. The child does `work(job, *values)` with those of the
    keys but the solver, or with the entry "ask" of a request. `complete`
    makes of a request and its answer a row of the file, `conclude` of those of all
    solvers the rows of the problem. `quick` replaces usual options in a quick run. With
    `beside` a peer has the limit `limit_beside`, with `alone` every request has a
    process of its own.
    """

    name: str  # of the CSV file
    requests: Callable[[Args], Iterable[Row]]
    work: Work
    columns: str
    solvers: tuple[str, ...] = ("nam",)
    packages: dict[str, str] = field(default_factory=dict)  # of other solvers
    tolerances: tuple[float, ...] = ()
    limit: float = 10.0  # [s] a request
    peer_limit: float = math.inf  # [s] of other solvers
    quick: dict[str, Any] = field(default_factory=dict)
    complete: Callable[[Row], Row] | None = None
    conclude: Callable[[list[Row]], list[Row]] | None = None
    late: Late = NEVER_LATE
    needs_data: bool = False
    beside: bool = False
    alone: bool = False
    success: Callable[[Row], bool] = solved
    plot: Callable[[Path, Path], None] | None = None  # from a CSV file into a folder

    def main(self, arguments: list[str] | None = None) -> int:
        doc = sys.modules[self.requests.__module__].__doc__
        parser = cli.parser(doc, "data", "quick", "go-on", "csv", "figures", limit=None)
        tasks = ["run", *["plot"] * bool(self.plot)]
        parser.add_argument("task", nargs="?", choices=tasks, default="run")
        parser.add_argument("--solvers", nargs="+", choices=self.solvers)
        parser.add_argument("--eps", nargs="+", type=float, help="tolerances")
        parser.add_argument("--only", nargs="+", help="names of sets or problems")
        args = parser.parse_args(arguments)
        if self.needs_data and args.task == "run" and args.data is None:
            parser.error("--data is required")
        usual = {"solvers": self.solvers, "eps": self.tolerances, "limit": self.limit}
        for name, value in (usual | (self.quick if args.quick else {})).items():
            if getattr(args, name, None) is None:
                setattr(args, name, value)
        stem = self.name + "-quick" * args.quick
        args.csv = args.csv or cli.RESULTS / f"{stem}.csv"
        if args.task == "run":
            return self.run(args)
        self.plot(args.csv, args.figures)
        return 0

    def run(self, args: Args) -> int:
        """Measure what the file does not have yet; return MISSING if data are."""
        wanted = args.solvers
        args.solvers = machine.installed(wanted, self.packages)
        missing = [solver for solver in wanted if solver not in args.solvers]
        header = cli.begin(
            [self.packages.get(solver, solver) for solver in args.solvers],
            *([f"not installed: {', '.join(missing)}"] if missing else []),
            f"limit: {args.limit:g} s",
        )
        keys, others = (part.split() for part in self.columns.split("|"))
        with (
            tables.growing(args.csv, header, keys + others, keys, args.go_on) as file,
            ExitStack() as stack,
        ):
            try:
                Run(self, args, file, stack).all()
            except cli.MissingDataError as error:
                print(f"{error}; --data must be the folder of validation/README.md")
                return cli.MISSING
        return 0


@dataclass(frozen=True)
class Parts:
    """CSV files by name, each made anew from rows that this process makes in order."""

    doc: str | None
    rows: dict[str, Callable[[], Iterable[Row]]]
    packages: tuple[str, ...] = ()
    plot: Callable[[Path, Path], None] | None = None  # from results into figures

    def main(self, arguments: list[str] | None = None) -> int:
        parts = [*self.rows, *["plot"] * bool(self.plot)]
        parser = cli.parser(self.doc, "results", "figures")
        parser.add_argument("parts", nargs="*", default=parts, help=", ".join(parts))
        args = parser.parse_args(arguments)
        header = cli.begin(self.packages)
        for part in args.parts:
            print(part, flush=True)
            if part in self.rows:
                rows = list(self.rows[part]())
                tables.write(args.results / f"{part}.csv", header, rows)
            else:
                self.plot(args.results, args.figures)
        return 0


class Run:
    """A suite under way: its child processes, what was late, how fast namlcp was."""

    def __init__(
        self, suite: Suite, args: Args, file: Growing, stack: ExitStack
    ) -> None:
        self.suite, self.args, self.file, self.stack = suite, args, file, stack
        self.shown = " ".join(suite.columns.replace("|", " ").split()[:SHOWN])
        self.children: dict[str, Bench] = {}
        self.late: dict[Any, list[Row]] = defaultdict(list)
        self.ours: dict[Any, list[float]] = defaultdict(list)
        for row in file.rows:
            self.note(row)

    def all(self) -> None:
        suite, keys, only = self.suite, self.file.keys, set(self.args.only or ())
        tables.print_rows([], self.shown)
        for _, group in groupby(suite.requests(self.args), self.problem):
            requests = [
                {"solver": solver} | request
                for request in group
                if not only or not only.isdisjoint(str(request.get(k)) for k in keys)
                for solver in ([""] if "solver" in request else self.args.solvers)
            ]
            new = [r for r in requests if self.file.key(r) not in self.file.known]
            if not new or (suite.conclude and len(new) < len(requests)):
                continue
            found = []
            for request in new:
                row = self.answer(request)
                if row is None:
                    continue
                if suite.complete:
                    row = suite.complete(row)
                self.note(row)
                found.append(row)
                if not suite.conclude:
                    tables.print_row(self.file.add(row), self.shown)
            if suite.conclude and found:
                for row in suite.conclude(found):
                    self.file.add(row)
                tables.print_row(self.file.rows[-1], self.shown)

    def problem(self, row: Row) -> tuple[str, ...]:
        return tuple(str(row[key]) for key in self.file.keys if key != "solver")

    def note(self, row: Row) -> None:
        if (row.get("status") or row.get("said")) in self.suite.late.words:
            self.late[self.suite.late.alike(row)].append(row)
        if self.suite.beside and is_ours(row["solver"]) and self.suite.success(row):
            self.ours[self.problem(row)].append(float(row["runtime"]))

    def answer(self, request: Row) -> Row | None:
        suite, solver, late = self.suite, request["solver"], self.suite.late
        known = self.late[late.alike(request)]
        known = [r for r in known if late.hardness(r) <= late.hardness(request)]
        if len(known) >= late.times:
            return known[-1] | request if late.copied else None
        child = self.child(solver)
        child.limit = self.args.limit
        if not is_ours(solver):
            child.limit = min(child.limit, suite.peer_limit)
            if suite.beside:
                ours = self.ours[self.problem(request)]
                child.limit = limit_beside(ours, child.limit)
        values = [request[key] for key in self.file.keys if key != "solver"]
        return request | child.ask(*request.get("ask", values))

    def child(self, solver: str) -> Bench:
        if self.suite.alone and solver in self.children:
            self.children.pop(solver).stop()
        if solver not in self.children:
            args = self.suite.work, solver, self.args.limit, self.args.data
            self.children[solver] = Bench(*args)
            self.stack.callback(self.children[solver].stop)
        return self.children[solver]
