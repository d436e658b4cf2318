"""qpsolvers' own benchmark, qpbenchmark, with solver="nam", on Maros-Meszaros.

qpbenchmark (`pip install qpbenchmark`) knows the solvers in its settings only, so "nam"
is added there, and reads its problems from files, so the test set is told to take those
of the data folder. Runs, tolerances, tables and their meaning are qpbenchmark's. It
solves in its own process and cannot end a solver that knows no time limit: --timeouts
names a result file of maros_meszaros, and what was late there is not run. The whole
report is written beside the CSV file.
"""

import logging
import sys
from collections.abc import Iterator
from pathlib import Path

import qpbenchmark
import qpsolvers
from qpbenchmark.report import Report
from qpbenchmark.results import Results
from qpbenchmark.run import run
from qpbenchmark.solver_settings import SolverSettings
from qpbenchmark.test_set import TestSet

import namlcp  # noqa: F401  (makes solver="nam" known to qpsolvers)
from validation.harness import LATE, cli
from validation.peers.runs import read_rows
from validation.problems import data_sets

NAME = "nam"
SAMPLES = ("QAFIRO", "HS118", "DUALC1")  # solved once before anything is timed
FOLDER_OF = {"dense": "dense_subset", "sparse": "sparse_subset"}
EPS = {"low_accuracy": 1e-3, "mid_accuracy": 1e-6, "high_accuracy": 1e-9}


class MarosMeszaros(TestSet):
    """The problems of the data folder, all sparse, or the dense subset dense.

    `subset` is "all", "dense" or "sparse", `limit` the time of a solve [s].
    """

    def __init__(self, data: Path, subset: str, limit: float) -> None:
        self.data, self.subset, self.limit = data, subset, limit
        index = data_sets.maros_index(data, "all")
        self.names = [
            name
            for name, row in sorted(index.items())
            if subset == "all" or row["subset"] == FOLDER_OF[subset]
        ]
        SolverSettings.IMPLEMENTED_SOLVERS.add(NAME)
        super().__init__()

    def __iter__(self) -> Iterator[qpbenchmark.Problem]:
        """Yield the problems by name."""
        for name in self.names:
            dense = self.subset == "dense"
            problem = data_sets.maros_problem(self.data, name, dense)
            yield qpbenchmark.Problem.from_qpsolvers(problem, name)

    @property
    def description(self) -> str:
        """Say what the problems are."""
        return f"Maros and Meszaros' convex quadratic programs, {self.subset}."

    @property
    def sparse_only(self) -> bool:
        """Leave out solvers of dense problems, except on the dense subset."""
        return self.subset != "dense"

    @property
    def title(self) -> str:
        """Head the report."""
        return f"Maros-Meszaros ({self.subset})"

    def define_tolerances(self, runtime: float = 10.0) -> None:
        """Take qpbenchmark's own, with our time limit."""
        super().define_tolerances(self.limit)

    def define_solver_settings(self) -> None:
        """Tell `nam` what qpbenchmark tells the others."""
        super().define_solver_settings()
        for name, settings in self.solver_settings.items():
            settings.set_param(NAME, "time_limit", self.tolerances[name].runtime)
            settings.set_param("clarabel", "time_limit", self.limit)
            if name in EPS:
                settings.set_param(NAME, "eps_abs", EPS[name])
                settings.set_param(NAME, "eps_rel", 0.0)


def late_runs(file: Path, limit: float) -> dict[tuple[str, str, str], float]:
    """Return what ran into the limit in maros_meszaros, as qpbenchmark has it."""
    names = {eps: name for name, eps in EPS.items()}
    return {
        (row["problem"], row["solver"], names[row["eps"]]): 2.0 * limit
        for row in read_rows(file)
        if row["status"] in LATE and row["solver"] != NAME and row["eps"] in names
    }


def warm_up(data: Path) -> None:
    """Let the compiled code be loaded before the first problem is timed."""
    for name in SAMPLES:
        for dense in (False, True):
            problem = data_sets.maros_problem(data, name, dense)
            qpsolvers.solve_problem(problem, solver=NAME)


@cli.needs_data
def main(arguments: list[str] | None = None) -> int:
    """Run qpbenchmark and print its tables."""
    parser = cli.parser(
        __doc__, "limit", data=..., csv=..., solvers=[NAME, "piqp", "clarabel"]
    )
    parser.add_argument("--subset", choices=["all", *FOLDER_OF], default="all")
    parser.add_argument(
        "--settings", nargs="+", default=list(EPS), choices=["default", *EPS]
    )
    parser.add_argument("--timeouts", type=Path, help="a file of maros_meszaros")
    parser.add_argument("--only", nargs="+", help="names of problems")
    args = parser.parse_args(arguments)
    logging.getLogger().setLevel(logging.ERROR)
    test_set = MarosMeszaros(args.data, args.subset, args.limit)
    if args.only:
        test_set.names = [name for name in test_set.names if name in args.only]
        if not test_set.names:
            print(f"none of these problems in the subset {args.subset!r}")
            return cli.MISSING
    test_set.solvers &= set(args.solvers)
    for name in set(test_set.solver_settings) - set(args.settings):
        del test_set.solver_settings[name], test_set.tolerances[name]
    if args.timeouts is not None:
        test_set.known_solver_timeouts = late_runs(args.timeouts, args.limit)
    cli.begin(sorted(test_set.solvers))
    warm_up(args.data)
    results = Results(args.csv, test_set)
    run(test_set, results)
    report = args.csv.with_suffix(".md")
    Report("namlcp", results).write(str(report))
    text = report.read_text()
    first, last = text.index("## Results by settings"), text.index("## Settings")
    print(text[first:last])
    return 0


if __name__ == "__main__":
    sys.exit(main())
