"""Is anything wrong ever called solved? A seeded campaign over every kind of problem.

Usage::

    python validation/campaign.py run --csv FILE [--seed 1] [--problems 100000]
        [--solvers nam osqp piqp proxqp clarabel daqp quadprog] [--eps 1e-6]
    python validation/campaign.py report --csv FILE         # the table, as Markdown
    python validation/campaign.py show --seed 1 --index 77  # one problem, once more

The problems: `campaign_problems`; problem i comes from (seed, i) alone. The judge:
`campaign_judge`, by the definition. Every solver has a child process; what hangs for
--limit seconds or crashes costs that problem, and the next child goes on. The CSV
counts outcomes for each class and lists the indices of what was not right; run again
with the same file it goes on where it stopped.

nam gets the arguments in all their representations, at its default settings, with
warnings as errors. Its peers get the convex QPs, clean, through qpsolvers with eps as
absolute tolerance (`settings`) and their default limits; theirs is a wrong "found" only
beyond tenfold eps, relative to the size of the terms. quadprog gets the definite ones.
"""

import argparse
import resource
import sys
import time
import warnings
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

import campaign_problems as problems
from benchmark import installed, machine_lines, use_one_thread
from campaign_judge import Answer, Tolerance, judge_lcp, judge_malformed, judge_qp
from campaign_problems import Case
from campaign_tally import Row, Tally, bars, print_report
from infeasible import OWN, verdict
from infeasible_problems import is_feasible, is_unbounded, joined
from measure import MEMORY, Bench, silence
from settings import solver_settings

SOLVERS = ["nam", "osqp", "piqp", "proxqp", "clarabel", "daqp", "quadprog"]
BATCH = 500  # problems between two writings of the CSV
LIMIT = 5.0  # [s] a problem; the children have GRACE more
WARM_UP = 3  # problems of each class before the clock of nam runs
COMPILING = 900.0  # [s] for that, once, with nothing on the disk
NAM = Tolerance(1e-9, 1e-10)  # its defaults
NAM_LCP = 1e-9
LOOSE = 10.0  # times eps: beyond that "found" of a peer is wrong
INFINITE = 0.999e20  # what the documentation calls no bound
# Their own limits on iterations, not those of a benchmark with a clock.
PEERS: dict[str, dict[str, Any]] = {"osqp": {"max_iter": 4000}}


def clean(qp: Any) -> Any:
    """Return the QP with sides from 1e20 on infinite, as the documentation says."""
    h = np.where(qp.h >= INFINITE, np.inf, qp.h)
    lb = np.where(qp.lb <= -INFINITE, -np.inf, qp.lb)
    ub = np.where(qp.ub >= INFINITE, np.inf, qp.ub)
    return qp._replace(h=h, lb=lb, ub=ub)


def host_problem(case: Case) -> qpsolvers.Problem:
    """Return a clean QP for qpsolvers, without rows that are switched off.

    It is sparse (csc_matrix) where P is passed sparse.
    """
    P, q, G, h, A, b, lb, ub = clean(case.problem)
    on = h < np.inf
    G, h = G[on], h[on]
    if sp.issparse(case.arguments["P"]):
        P, G, A = (sp.csc_matrix(M) for M in (P, G, A))
    bounds = [v if np.isfinite(v).any() else None for v in (lb, ub)]
    return joined(P, q, G, h, A, b, *bounds)


def truth_of(case: Case) -> str:
    """Return what is true of a QP; what was not constructed is asked of HiGHS."""
    if case.truth != "ask":
        return case.truth
    problem = host_problem(case)
    feasible, descends = is_feasible(problem), is_unbounded(problem)
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


def ask_nam(case: Case) -> Answer:
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
    if result.ray is not None:
        return Answer("unsolvable", result.ray, words=said)
    return Answer("solved" if said == "solved" else "refused", result.z, words=said)


def ask_peer(case: Case, solver: str, eps: float, limit: float) -> Answer:
    """Return what a peer says of a convex QP through qpsolvers."""
    problem = host_problem(case)
    if solver == "quadprog":
        problem = qpsolvers.Problem(*problem.unpack_as_dense())
    settings = solver_settings(solver, eps, limit) | OWN.get(solver, {})
    settings |= PEERS.get(solver, {})
    try:
        solution = qpsolvers.solve_problem(problem, solver=solver, **settings)
        said, words = verdict(problem, solution, eps)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        if "unbounded below" in words:
            return Answer("unbounded", words=words)
        return Answer("error", words=words, kind=type(error))
    if not solution.found:
        known = said in ("infeasible", "unbounded")
        return Answer(said if known else "refused", words=words)
    z = np.zeros(case.problem.h.size)
    z[case.problem.h < INFINITE] = filled(solution.z, problem.h)
    y, z_box = filled(solution.y, problem.b), filled(solution.z_box, problem.q)
    return Answer("solved", np.asarray(solution.x), y, z, z_box, words)


def filled(multiplier: Any, side: Any) -> np.ndarray:
    """Return the multiplier, zeros where it is absent."""
    size = 0 if side is None else side.size
    if multiplier is None or np.size(multiplier) != size:
        return np.zeros(size)
    return np.asarray(multiplier, dtype=float)


def examine(case: Case, solver: str, eps: float, limit: float) -> Row:
    """Return what a solver makes of a problem: truth, outcome, reason, time."""
    own = solver == "nam"
    start = time.perf_counter()
    answer = ask_nam(case) if own else ask_peer(case, solver, eps, limit)
    seconds = time.perf_counter() - start
    if case.group in problems.MALFORMED:
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


def serve(pipe: Connection, seed: int, solver: str, limit: float) -> None:
    """Answer requests (index, eps) until None comes: the child process."""
    warnings.simplefilter("ignore")
    silence()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if solver == "nam":
        for i in range(WARM_UP * len(problems.CLASSES)):
            ask_nam(problems.make(0, i))
    pipe.send("warm")
    for index, eps in iter(pipe.recv, None):
        pipe.send("ready")
        pipe.send(examine(problems.make(seed, index), solver, eps, limit))


class CampaignBench(Bench):
    """A child process that makes its problems itself: `data` is the seed."""

    work = staticmethod(serve)

    def start(self) -> None:
        """Start the child process, and wait until all is loaded and compiled."""
        super().start()
        self.wait(COMPILING)

    def examine(self, index: int, eps: float) -> Row:
        """Return the row of problem `index`; a hang and a crash are outcomes."""
        row = self.ask((index, eps))
        if "outcome" in row:
            return row
        outcome = {"timeout": "hang", "crashed": "crash"}[row["status"]]
        return {"truth": "", "outcome": outcome, "why": outcome, "time": self.limit}


def is_asked(solver: str, i: int) -> bool:
    """Tell whether a solver is asked problem i."""
    if solver == "nam":
        return True
    return problems.is_definite(i) if solver == "quadprog" else problems.is_convex(i)


def run(args: argparse.Namespace) -> int:
    """Run what is not done yet; return 1 if anything of nam is not as it must be."""
    use_one_thread()
    solvers = installed(args.solvers)
    header = [f"seed: {args.seed}", f"eps of the peers: {args.eps:g}"]
    header += machine_lines(SOLVERS)  # more of them may come later
    print("\n".join(header), flush=True)
    if args.csv.exists() and args.csv.read_text().splitlines()[:2] != [
        f"# {line}" for line in header[:2]
    ]:
        print(f"{args.csv} has another seed or eps")
        return 2
    tally = Tally(args.csv, header)
    for solver in solvers:
        child = CampaignBench(args.seed, solver, args.limit)
        try:
            for i in range(tally.done[solver], args.problems):
                if is_asked(solver, i):
                    tally.add(solver, i, child.examine(i, args.eps))
                if (i + 1) % BATCH == 0 or i + 1 == args.problems:
                    tally.done[solver] = i + 1
                    tally.write()
        finally:
            child.stop()
        print(f"{solver}: {tally.done[solver]} problems", flush=True)
    print_report(args.csv)
    return int(not all(met for *_, met in bars(tally.rows.values())))


def show(args: argparse.Namespace) -> int:
    """Ask one problem once more, in this process, and print what comes of it."""
    case = problems.make(args.seed, args.index)
    print(f"{case.group}, {case.truth}, {case.problem.q.size} unknowns")
    for name, value in case.arguments.items():
        kind = f"{type(value).__name__} {getattr(value, 'dtype', '')}"
        print(f"  {name}: {kind} {np.shape(value)}")
    for solver in installed(args.solvers):
        if is_asked(solver, args.index):
            print(f"{solver}: {examine(case, solver, args.eps, args.limit)}")
    return 0


def report(args: argparse.Namespace) -> int:
    """Print the tables of a CSV."""
    print_report(args.csv)
    return 0


def parse_arguments(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, checked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(required=True)
    for name, call in (("run", run), ("report", report), ("show", show)):
        command = commands.add_parser(name)
        command.set_defaults(call=call)
        if name != "show":
            command.add_argument("--csv", type=Path, required=True)
        if name == "report":
            continue
        command.add_argument("--seed", type=int, default=1)
        command.add_argument("--solvers", nargs="+", default=["nam"], choices=SOLVERS)
        command.add_argument("--eps", type=float, default=1e-6, help="of the peers")
        command.add_argument("--limit", type=float, default=LIMIT, help="[s] a problem")
        if name == "show":
            command.add_argument("--index", type=int, required=True)
        else:
            command.add_argument("--problems", type=int, default=100_000)
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run, report or show."""
    args = parse_arguments(arguments)
    return int(args.call(args))


if __name__ == "__main__":
    sys.exit(main())
