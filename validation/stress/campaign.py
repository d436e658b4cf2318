"""Is anything wrong ever called solved? A seeded campaign over every kind of problem.

The problems: `problems.fuzzed`; problem i comes from (seed, i) alone. The judge:
`campaign_judge`, by the definition. Every solver has a child process; what hangs for
--limit seconds or crashes costs that problem, and the next child goes on. The CSV
counts outcomes for each class and lists the indices of what was not right; run again
with the same file it goes on where it stopped. `report` prints its tables in Markdown,
`show` asks one problem once more.

nam gets the arguments in all their representations, at its default settings, with
warnings as errors. Its peers get the convex QPs, clean, through qpsolvers with eps as
absolute tolerance (`qp_solvers.detecting_settings`) and their default limits; theirs is
a wrong "found" only beyond tenfold eps, relative to the size of the terms. quadprog
gets the definite ones.
"""

import argparse
import sys
import time
import warnings
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

from validation.harness import (
    Bench,
    Job,
    Row,
    cli,
    csv_files,
    judging,
    machine,
    qp_solvers,
    qps,
)
from validation.problems import infeasible_cases
from validation.problems.fuzzed import cases
from validation.stress.campaign_judge import (
    Answer,
    Tolerance,
    judge_lcp,
    judge_malformed,
    judge_qp,
)
from validation.stress.campaign_tally import Tally, bars, print_report

SOLVERS = ["nam", "osqp", "piqp", "proxqp", "clarabel", "daqp", "quadprog"]
BATCH = 500  # problems between two writings of the CSV
LIMIT = 5.0  # [s] a problem; the children have GRACE more
WARM_UP = 3  # problems of each class before the clock of nam runs
COMPILING = 900.0  # [s] for that, once, with nothing on the disk
NAM = Tolerance(1e-9, 1e-10)  # its defaults
NAM_LCP = 1e-9
LOOSE = 10.0  # times eps: beyond that "found" of a peer is wrong
INFINITE = 0.999e20  # what the documentation calls no bound
PEERS: dict[str, dict[str, Any]] = {"osqp": {"max_iter": 4000}}
"""Their own limits on iterations, not those of a benchmark with a clock."""


def clean(qp: Any) -> Any:
    """Return the QP with sides from 1e20 on infinite, as the documentation says."""
    h = np.where(qp.h >= INFINITE, np.inf, qp.h)
    lb = np.where(qp.lb <= -INFINITE, -np.inf, qp.lb)
    ub = np.where(qp.ub >= INFINITE, np.inf, qp.ub)
    return qp._replace(h=h, lb=lb, ub=ub)


def qpsolvers_problem(case: cases.Case) -> qpsolvers.Problem:
    """Return a clean QP for qpsolvers, without rows that are switched off.

    It is sparse (csc_matrix) where P is passed sparse.
    """
    P, q, G, h, A, b, lb, ub = clean(case.problem)
    on = h < np.inf
    G, h = G[on], h[on]
    if sp.issparse(case.arguments["P"]):
        P, G, A = (sp.csc_matrix(M) for M in (P, G, A))
    bounds = [v if np.isfinite(v).any() else None for v in (lb, ub)]
    return qps.joined(P, q, G, h, A, b, *bounds)


def truth_of(case: cases.Case) -> str:
    """Return what is true of a QP; what was not constructed is asked of HiGHS."""
    if case.truth != "ask":
        return case.truth
    problem = qpsolvers_problem(case)
    feasible = infeasible_cases.is_feasible(problem)
    descends = infeasible_cases.is_unbounded(problem)
    return {
        (True, True): "unbounded",
        (True, False): "solvable",
        (False, True): "both",
        (False, False): "infeasible",
    }.get((feasible, descends), "near")


def snapshot(arguments: dict[str, Any]) -> list[bytes]:
    """Return the numbers of the arguments, to see whether they change."""
    found = []
    for value in arguments.values():
        parts = [value]
        if sp.issparse(value):
            names = ("data", "indices", "indptr", "row", "col", "offsets")
            parts = [getattr(value, name, None) for name in names]
        found += [part.tobytes() for part in parts if isinstance(part, np.ndarray)]
    return found


SAID = {
    "solved": "solved",
    "primal_infeasible": "infeasible",
    "dual_infeasible": "unbounded",
}


def ask_nam(case: cases.Case) -> Answer:
    """Return what namlcp says at its default settings."""
    import namlcp

    before = snapshot(case.arguments)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            if "P" in case.arguments:
                answer = qp_answer(namlcp.solve_qp(**case.arguments))
            else:
                answer = lcp_answer(namlcp.solve_lcp(**case.arguments))
    except Exception as error:
        answer = Answer("error", words=f"{error}", kind=type(error))
    if snapshot(case.arguments) != before:
        return Answer("error", words="an input was changed", kind=RuntimeError)
    return answer


def qp_answer(result: Any) -> Answer:
    """Return a QPResult in the judge's terms."""
    said = result.status.value
    arrays = result.x, result.y, result.z, result.z_box
    return Answer(SAID.get(said, "refused"), *arrays, said)


def lcp_answer(result: Any) -> Answer:
    """Return an LCPResult in the judge's terms."""
    said = result.status.value
    if said == "unsolvable":
        kind = "exhausted" if result.ray is None else said
        return Answer(kind, result.ray, words=said)
    return Answer("solved" if said == "solved" else "refused", result.z, words=said)


def ask_peer(case: cases.Case, solver: str, eps: float, limit: float) -> Answer:
    """Return what a peer says of a convex QP through qpsolvers."""
    problem = qpsolvers_problem(case)
    if solver == "quadprog":
        problem = qpsolvers.Problem(*problem.unpack_as_dense())
    settings = qp_solvers.detecting_settings(solver, eps, limit) | PEERS.get(solver, {})
    try:
        solution = qpsolvers.solve_problem(problem, solver=solver, **settings)
        said, words = judging.verdict(problem, solution, eps)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        if "unbounded below" in words:
            return Answer("unbounded", words=words)
        return Answer("error", words=words, kind=type(error))
    if not solution.found:
        known = said in ("infeasible", "unbounded")
        return Answer(said if known else "refused", words=words)
    on = case.problem.h < INFINITE
    z = np.zeros(on.size)
    z[on] = judging.filled(solution.z, int(on.sum()))
    y = judging.filled(solution.y, case.problem.b.size)
    z_box = judging.filled(solution.z_box, problem.q.size)
    return Answer("solved", np.asarray(solution.x), y, z, z_box, words)


def examine(case: cases.Case, solver: str, eps: float, limit: float) -> Row:
    """Return what a solver makes of a problem: truth, outcome, reason, time."""
    own = solver == "nam"
    start = time.perf_counter()
    answer = ask_nam(case) if own else ask_peer(case, solver, eps, limit)
    seconds = time.perf_counter() - start
    if case.group in cases.MALFORMED:
        outcome, why = judge_malformed(answer, case.truth)
        return {"truth": "malformed", "outcome": outcome, "why": why, "time": seconds}
    if "P" not in case.arguments:
        truth = case.truth
        outcome, why = judge_lcp(case.problem, truth, answer, NAM_LCP)
    else:
        truth = truth_of(case)
        tolerance = NAM if own else Tolerance(eps, eps, LOOSE)
        outcome, why = judge_qp(clean(case.problem), truth, answer, tolerance, own)
    return {"truth": truth, "outcome": outcome, "why": why, "time": seconds}


def work(job: Job, index: int | None, eps: float = 0.0) -> Row:
    """Return the row of problem `index` (None: load and compile what nam needs)."""
    if index is None:
        for i in range(WARM_UP * len(cases.CYCLES[job.data[1]])):
            ask_nam(cases.make(0, i, job.data[1]))
        return {}
    job.ready()
    seed, cycle = job.data
    return examine(cases.make(seed, index, cycle), job.solver, eps, job.limit)


class CampaignBench(Bench):
    """A child process that makes its problems itself: `data` is (seed, cycle)."""

    def start(self) -> None:
        """Start the child process, and wait until all is loaded and compiled."""
        super().start()
        if self.solver == "nam":
            self.pipe.send((None,))
            self.wait(COMPILING)

    def examine(self, index: int, eps: float) -> Row:
        """Return the row of problem `index`; a hang and a crash are outcomes."""
        row = self.ask(index, eps)
        if "outcome" not in row:
            outcome = {"timeout": "hang", "crashed": "crash"}[row["status"]]
            row = {"truth": "", "outcome": outcome, "why": outcome, "time": self.limit}
        return row | {"group": cases.group_of(index, self.data[1])}


def is_asked(solver: str, i: int, cycle: str) -> bool:
    """Tell whether a solver is asked problem i."""
    if solver == "nam":
        return True
    asked = cases.is_definite if solver == "quadprog" else cases.is_convex
    return asked(i, cycle)


def run(args: argparse.Namespace) -> int:
    """Run what is not done yet; return 1 if anything of nam is not as it must be."""
    solvers = machine.installed(args.solvers)
    own = [f"seed: {args.seed}", f"eps of the peers: {args.eps:g}"]
    own += [f"classes: {args.classes}"] * (args.classes != "every")
    if args.csv.exists() and csv_files.header(args.csv)[: len(own)] != own:
        print(f"{args.csv} has another seed, eps or classes")
        return cli.MISSING
    tally = Tally(args.csv, own + cli.begin(SOLVERS))  # more of them may come later
    for solver in solvers:
        data = args.seed, args.classes
        with CampaignBench(work, solver, args.limit, data) as child:
            for i in range(tally.done[solver], args.problems):
                if is_asked(solver, i, args.classes):
                    tally.add(solver, i, child.examine(i, args.eps))
                if (i + 1) % BATCH == 0 or i + 1 == args.problems:
                    tally.done[solver] = i + 1
                    tally.write()
        print(f"{solver}: {tally.done[solver]} problems", flush=True)
    print_report(args.csv)
    return int(not all(met for *_, met in bars(tally.rows.values())))


def show(args: argparse.Namespace) -> int:
    """Ask one problem once more, in this process, and print what comes of it."""
    case = cases.make(args.seed, args.index, args.classes)
    print(f"{case.group}, {case.truth}, {case.problem.q.size} unknowns")
    for name, value in case.arguments.items():
        kind = f"{type(value).__name__} {getattr(value, 'dtype', '')}"
        print(f"  {name}: {kind} {np.shape(value)}")
    for solver in machine.installed(args.solvers):
        if is_asked(solver, args.index, args.classes):
            print(f"{solver}: {examine(case, solver, args.eps, args.limit)}")
    return 0


def report(args: argparse.Namespace) -> int:
    """Print the tables of a CSV."""
    print_report(args.csv)
    return 0


def main(arguments: list[str] | None = None) -> int:
    """Run, report or show."""
    parser = cli.parser(__doc__)
    commands = parser.add_subparsers(required=True)
    for name, call in (("run", run), ("report", report), ("show", show)):
        command = commands.add_parser(name)
        command.set_defaults(call=call)
        if name != "show":
            cli.add_usual(command, csv=...)
        if name == "report":
            continue
        cli.add_usual(command, limit=LIMIT)
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--solvers", nargs="+", default=["nam"], choices=SOLVERS)
        command.add_argument("--classes", default="every", choices=cases.CYCLES)
        command.add_argument("--eps", type=float, default=1e-6, help="of the peers")
        if name == "show":
            command.add_argument("--index", type=int, required=True)
        else:
            command.add_argument("--problems", type=int, default=100_000)
    args = parser.parse_args(arguments)
    return int(args.call(args))


if __name__ == "__main__":
    sys.exit(main())
