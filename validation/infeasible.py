"""What solver="nam" says of QPs without a solution, beside its peers, and how fast.

Usage::

    python validation/infeasible.py [--data DIR] [--step 3] [--solvers nam osqp ...]
        [--csv FILE] [--check]

The problems and what is true of them: `infeasible_problems`. Every solver is called
through qpsolvers in a child process, at the case's eps as absolute tolerance, each
with those of its settings that recognise most. What it says is

- recognised: "infeasible", "unbounded" (either where both are true), solved within
  ten times eps, or, of a problem that is not convex, anything but solved;
- misjudged: solved where nothing can be, infeasible or unbounded where a solution
  exists (of an infeasible problem: unbounded), or "solved" with larger residuals;
- undecided otherwise.

The time is the median of repeated calls: processor time, on one thread. For nam also:
the time on the solvable twin, the iterations, and the residual of the certificate,
scaled so that it proves -1: the largest |A'y + G'z + z_box|, or |Pd|, |Ad| and (Gd)+,
or entry of a wrong sign. With --check HiGHS confirms what is true of all cases but
those too close to call.
"""

import argparse
import sys
import time
import warnings
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
from qpsolvers import Problem, Solution

import infeasible_problems as cases
import problems
from benchmark import (
    csv_writer,
    geometric_mean,
    installed,
    machine_lines,
    use_one_thread,
)
from measure import Bench, failure, judge, median_time, silence
from settings import solver_settings

SOLVERS = ["nam", "osqp", "piqp", "clarabel", "proxqp"]
COLUMNS = (
    "problem group truth solver eps variables equalities inequalities outcome verdict "
    "runtime cold twin iterations form certificate status"
).split()
# What differs from `settings`: there these tests are all but switched off, or the
# solver would go on for the whole time limit.
OWN: dict[str, dict[str, Any]] = {
    "osqp": {"eps_prim_inf": 1e-6, "eps_dual_inf": 1e-6, "max_iter": 20_000},
    "piqp": {"max_iter": 1000},
}
RIGHT = {
    "infeasible": ("infeasible",),
    "unbounded": ("unbounded",),
    "both": ("infeasible", "unbounded"),
    "feasible": ("solved",),
    "not convex": ("undecided", "infeasible", "unbounded"),
}
WRONG = ("solved", "inaccurate", "infeasible", "unbounded")
NEAR = ("nearly feasible", "nearly bounded")  # closer than HiGHS's own tolerance
Row = dict[str, Any]


def largest(*arrays: np.ndarray) -> float:
    """Return the largest modulus of an entry, 0 of nothing."""
    return max((float(np.abs(a).max()) for a in arrays if a.size), default=0.0)


def farkas_residual(problem: Problem, proof: dict[str, np.ndarray]) -> float:
    """Return how far (y, z, z_box) is from proving 0 <= -1."""
    _, _, G, h, A, b, lb, ub = cases.parts(problem)
    y, z, z_box = proof["y"], proof["z"], proof["z_box"]
    z_box = z_box if z_box.size else np.zeros(lb.size)
    side = np.where(z_box > 0.0, ub, lb)
    rows, used = z != 0.0, z_box != 0.0
    value = b @ y + h[rows] @ z[rows] + side[used] @ z_box[used]
    if not value < 0.0:
        return np.inf
    return largest(A.T @ y + G.T @ z + z_box, np.minimum(z, 0.0)) / -float(value)


def ray_residual(problem: Problem, d: np.ndarray) -> float:
    """Return how far d is from a direction of recession with slope -1."""
    P, q, G, h, A, _, lb, ub = cases.parts(problem)
    value = float(q @ d)
    if not value < 0.0:
        return np.inf
    rise = np.maximum((G @ d)[np.isfinite(h)], 0.0)
    up, down = d[np.isfinite(ub)], d[np.isfinite(lb)]
    wrong = np.maximum(up, 0.0), np.minimum(down, 0.0)
    return largest(P @ d, A @ d, rise, *wrong) / -value


def certificate_residual(problem: Problem, solution: Solution) -> float | None:
    """Return the residual of nam's proof; None where no multipliers can say it.

    That is the case for crossed bounds and sides of -inf.
    """
    proof = solution.extras.get("certificate")
    if proof is None or any(np.isnan(part).any() for part in proof.values()):
        return None
    if "x" in proof:
        return ray_residual(problem, proof["x"])
    return farkas_residual(problem, proof)


def verdict(problem: Problem, solution: Solution, eps: float) -> tuple[str, str]:
    """Return what the solver says in our words, and in its own."""
    extras = solution.extras or {}
    said = extras.get("status", getattr(extras.get("info"), "status", ""))
    said = str(said)
    plain = said.lower().replace("_", "").replace(" ", "")
    if "primalinfeasible" in plain:
        return "infeasible", said
    if "dualinfeasible" in plain:
        return "unbounded", said
    if not solution.found:
        return "undecided", said
    accurate = judge(problem, solution, 10.0 * eps)["success"]
    return "solved" if accurate else "inaccurate", said


def outcome(truth: str, said: str) -> str:
    """Return recognised, misjudged or undecided."""
    if said in RIGHT[truth]:
        return "recognised"
    return "misjudged" if said in WRONG else "undecided"


def solve(
    pipe: Connection, problem: Problem, eps: float, solver: str, limit: float
) -> Row:
    """Time a solver on a problem and say what it makes of it."""
    settings = solver_settings(solver, eps, limit) | OWN.get(solver, {})
    pipe.send("ready")
    try:
        solution, cold, runtime = median_time(
            lambda: qpsolvers.solve_problem(problem, solver=solver, **settings),
            time.process_time,
        )
        said, words = verdict(problem, solution, eps)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        said = "unbounded" if "unbounded below" in words else "undecided"
        return failure(words) | {"verdict": said}
    row: Row = {"verdict": said, "status": words, "runtime": runtime, "cold": cold}
    if solver == "nam":
        row["certificate"] = certificate_residual(problem, solution)
        row |= {key: solution.extras[key] for key in ("iterations", "form")}
    return row


def serve(pipe: Connection, _: None, solver: str, limit: float) -> None:
    """Answer requests (problem, eps) until None comes: the child process."""
    warnings.simplefilter("ignore")
    silence()
    if solver == "nam":
        import namlcp  # noqa: F401
    for problem, eps in iter(pipe.recv, None):
        pipe.send(solve(pipe, problem, eps, solver, limit))


class CaseBench(Bench):
    """A child process that takes problems."""

    work = staticmethod(serve)


def run(solver: str, limit: float, found: dict[str, cases.Case]) -> Iterator[Row]:
    """Yield the rows of one solver on all cases."""
    child = CaseBench(Path(), solver, limit)
    try:
        for name, case in found.items():
            _, q, _, h, _, b, _, _ = cases.parts(case.problem)
            row: Row = {"problem": name, "solver": solver, "verdict": "undecided"}
            row |= {"group": case.group, "truth": case.truth, "eps": case.eps}
            row |= {"variables": q.size, "equalities": b.size, "inequalities": h.size}
            row |= child.ask((case.problem, case.eps))
            if solver == "nam" and case.twin is not None:
                row["twin"] = child.ask((case.twin, case.eps)).get("runtime")
            yield row | {"outcome": outcome(case.truth, row["verdict"])}
    finally:
        child.stop()


def print_groups(rows: list[Row]) -> None:
    """Print outcomes and times of all solvers, group by group."""
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    print("\nrecognised / misjudged / undecided, median time [ms]")
    print(f"{'group':<28}{'cases':>6}" + "".join(f"{s:>21}" for s in solvers))
    for group in [*dict.fromkeys(row["group"] for row in rows), None]:
        here = [row for row in rows if group in (row["group"], None)]
        text = f"{group or 'all':<28}{len(here) // len(solvers):>6}"
        for solver in solvers:
            own = [row for row in here if row["solver"] == solver]
            count = [
                sum(row["outcome"] == word for row in own)
                for word in ("recognised", "misjudged", "undecided")
            ]
            times = [row["runtime"] for row in own if row.get("runtime")]
            middle = 1e3 * float(np.median(times)) if times else np.nan
            text += f"{'/'.join(map(str, count)):>12}{middle:>9.2f}"
        print(text)


def is_failure(row: Row) -> bool:
    """Tell whether a verdict is wrong, or missing where there is no solution."""
    optional = row["truth"] == "feasible" and row["outcome"] == "undecided"
    return row["outcome"] != "recognised" and not optional


def print_own(rows: list[Row]) -> None:
    """Print what is asked of nam: proofs, times, what it did not recognise."""
    own = [row for row in rows if row["solver"] == "nam"]
    asked = [row for row in own if row["truth"] in ("infeasible", "unbounded", "both")]
    timed = [row for row in asked if row.get("runtime")]
    if not timed:
        return
    twins = [row["runtime"] / row["twin"] for row in timed if row.get("twin")]
    proofs = [row["certificate"] for row in asked if row.get("certificate") is not None]
    small = [row for row in timed if row["variables"] < cases.MOST]
    slowest = max(small, key=lambda row: row["runtime"])
    steps = [row["iterations"] for row in timed]
    print(
        f"\nnam, {len(asked)} infeasible or unbounded: time over the solvable twin "
        f"{geometric_mean(twins):.2f} (worst {max(twins):.1f}), iterations "
        f"{np.median(steps):.0f} (at most {max(steps)})\n"
        f"worst residual of {len(proofs)} certificates {max(proofs):.0e}, "
        f"median {np.median(proofs):.0e}\n"
        f"slowest: {slowest['problem']} {slowest['runtime']:.3f} s"
    )
    for row in own:
        if row["outcome"] != "recognised":
            print(f"{row['outcome']}: {row['problem']} ({row['status']})")


def check(found: dict[str, cases.Case]) -> int:
    """Compare what is said to be true with HiGHS; return the number of differences."""
    wrong = 0
    for name, case in found.items():
        if case.group in (*NEAR, "treacherous", "not convex"):
            continue
        feasible = cases.is_feasible(case.problem)
        descends = cases.is_unbounded(case.problem)
        agrees = {
            "infeasible": feasible is False and not descends,
            "unbounded": feasible is True and descends is True,
            "both": feasible is False and descends is True,
            "feasible": feasible is True and not descends,
        }[case.truth]
        if not agrees:
            wrong += 1
            print(f"{name}: {case.truth}, HiGHS: {feasible}, {descends}")
    print(f"{wrong} cases where HiGHS says otherwise, or nothing")
    return wrong


def parse_arguments(arguments: list[str] | None) -> argparse.Namespace:
    """Return the command line, checked."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, help="the data folder")
    parser.add_argument("--step", type=int, default=3, help="1: every change of every")
    parser.add_argument("--solvers", nargs="+", default=SOLVERS)
    parser.add_argument("--limit", type=float, default=10.0, help="[s] a problem")
    parser.add_argument("--csv", type=Path, help="write all rows to this file")
    parser.add_argument("--check", action="store_true", help="ask HiGHS, then stop")
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> int:
    """Run all cases; return 1 if nam misjudges one or leaves a proof open."""
    args = parse_arguments(arguments)
    use_one_thread()
    try:
        makers = cases.all_cases(args.data, args.step)
    except problems.MissingDataError as error:
        print(f"{error}; --data must be a folder with the set 'all'")
        return 2
    found = {name: case for name, make in makers.items() if (case := make())}
    if args.check:
        return int(check(found) > 0)
    solvers = installed(args.solvers)
    header = machine_lines(solvers)
    print("\n".join(header))
    rows: list[Row] = []
    with csv_writer(args.csv, header, COLUMNS, "ignore") as write:
        for solver in solvers:
            for row in run(solver, args.limit, found):
                write(row)
                rows.append(row)
    print_groups(rows)
    print_own(rows)
    own = [row for row in rows if row["solver"] == "nam"]
    return int(any(is_failure(row) for row in own))


if __name__ == "__main__":
    sys.exit(main())
