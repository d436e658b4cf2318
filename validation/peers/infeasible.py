"""What solver="nam" says of QPs without a solution, beside its peers, and how fast.

The problems and what is true of them: `infeasible_cases`. Every solver is called
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

import sys
import time

import numpy as np
from qpsolvers import Problem, Solution

from validation.harness import (
    Bench,
    Job,
    Row,
    cli,
    csv_files,
    judging,
    machine,
    processes,
    qp_solvers,
    qps,
    tables,
    timing,
)
from validation.problems import infeasible_cases as cases

SOLVERS = ["nam", "osqp", "piqp", "clarabel", "proxqp", "moreau", "qtqp"]
COLUMNS = (
    "problem group truth solver eps variables equalities inequalities outcome verdict "
    "runtime cold twin iterations form certificate status"
).split()
NUMBERS = "eps variables runtime twin iterations certificate".split()
RIGHT = {
    "infeasible": ("infeasible",),
    "unbounded": ("unbounded",),
    "both": ("infeasible", "unbounded"),
    "feasible": ("solved",),
    "not convex": ("undecided", "infeasible", "unbounded"),
}
WRONG = ("solved", "inaccurate", "infeasible", "unbounded")
NEAR = ("nearly feasible", "nearly bounded")  # closer than HiGHS's own tolerance


def farkas_residual(problem: Problem, proof: dict[str, np.ndarray]) -> float:
    """Return how far (y, z, z_box) is from proving 0 <= -1."""
    _, _, G, h, A, b, lb, ub = qps.parts(problem)
    y, z, z_box = proof["y"], proof["z"], proof["z_box"]
    z_box = z_box if z_box.size else np.zeros(lb.size)
    side = np.where(z_box > 0.0, ub, lb)
    rows, used = z != 0.0, z_box != 0.0
    value = b @ y + h[rows] @ z[rows] + side[used] @ z_box[used]
    if not value < 0.0:
        return np.inf
    error = judging.largest(A.T @ y + G.T @ z + z_box, np.minimum(z, 0.0))
    return error / -float(value)


def ray_residual(problem: Problem, d: np.ndarray) -> float:
    """Return how far d is from a direction of recession with slope -1."""
    P, q, G, h, A, _, lb, ub = qps.parts(problem)
    value = float(q @ d)
    if not value < 0.0:
        return np.inf
    rise = np.maximum((G @ d)[np.isfinite(h)], 0.0)
    up, down = d[np.isfinite(ub)], d[np.isfinite(lb)]
    wrong = np.maximum(up, 0.0), np.minimum(down, 0.0)
    return judging.largest(P @ d, A @ d, rise, *wrong) / -value


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


def outcome(truth: str, said: str) -> str:
    """Return recognised, misjudged or undecided."""
    if said in RIGHT[truth]:
        return "recognised"
    return "misjudged" if said in WRONG else "undecided"


def solve(job: Job, problem: Problem, eps: float) -> Row:
    """Time a solver on a problem and say what it makes of it: the work of a child."""
    settings = qp_solvers.detecting_settings(job.solver, eps, job.limit)
    job.ready()
    try:
        solution, cold, runtime = timing.median_time(
            lambda: qp_solvers.solve(problem, job.solver, **settings),
            time.process_time,
        )
        said, words = judging.verdict(problem, solution, eps)
    except Exception as error:
        unbounded = "unbounded below" in str(error)
        return processes.raised(error) | {
            "verdict": "unbounded" if unbounded else "undecided"
        }
    row = {"verdict": said, "status": words, "runtime": runtime, "cold": cold}
    if job.solver == "nam":
        row["certificate"] = certificate_residual(problem, solution)
        row |= {key: solution.extras[key] for key in ("iterations", "form")}
    return row


def case_row(child: Bench, name: str, case: cases.Case) -> Row:
    """Return the row of one solver on one case."""
    _, q, _, h, _, b, _, _ = qps.parts(case.problem)
    row: Row = {"problem": name, "solver": child.solver, "verdict": "undecided"}
    row |= {"group": case.group, "truth": case.truth, "eps": case.eps}
    row |= {"variables": q.size, "equalities": b.size, "inequalities": h.size}
    row |= child.ask(case.problem, case.eps)
    if child.solver == "nam" and case.twin is not None:
        row["twin"] = child.ask(case.twin, case.eps).get("runtime")
    return row | {"outcome": outcome(case.truth, row["verdict"])}


def print_groups(rows: list[Row]) -> None:
    """Print outcomes and times of all solvers, group by group."""
    solvers = tables.distinct(rows, "solver")
    print("\nrecognised / misjudged / undecided, median time [ms]")
    print(f"{'group':<28}{'cases':>6}" + "".join(f"{s:>21}" for s in solvers))
    for group in [*tables.distinct(rows, "group"), None]:
        here = [row for row in rows if group in (row["group"], None)]
        text = f"{group or 'all':<28}{len(here) // len(solvers):>6}"
        for solver in solvers:
            own = tables.chosen(here, solver=solver)
            words = "recognised", "misjudged", "undecided"
            count = [sum(row["outcome"] == word for row in own) for word in words]
            times = [row["runtime"] for row in own if row["runtime"] > 0.0]
            middle = 1e3 * float(np.median(times)) if times else np.nan
            text += f"{'/'.join(map(str, count)):>12}{middle:>9.2f}"
        print(text)


def is_failure(row: Row) -> bool:
    """Tell whether a verdict is wrong, or missing where there is no solution."""
    optional = row["truth"] == "feasible" and row["outcome"] == "undecided"
    return row["outcome"] != "recognised" and not optional


def print_own(rows: list[Row]) -> None:
    """Print what is asked of nam: proofs, times, what it did not recognise."""
    own = tables.chosen(rows, solver="nam")
    asked = [row for row in own if row["truth"] in ("infeasible", "unbounded", "both")]
    timed = [row for row in asked if row["runtime"] > 0.0]
    if not timed:
        return
    twins = [row["runtime"] / row["twin"] for row in timed if row["twin"] > 0.0]
    proofs = [row["certificate"] for row in asked if row["certificate"] >= 0.0]
    small = [row for row in timed if row["variables"] < cases.MOST]
    slowest = max(small, key=lambda row: row["runtime"])
    steps = [row["iterations"] for row in timed]
    print(
        f"\nnam, {len(asked)} infeasible or unbounded: time over the solvable twin "
        f"{timing.geometric_mean(twins):.2f} (worst {max(twins):.1f}), iterations "
        f"{np.median(steps):.0f} (at most {max(steps):.0f})\n"
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


@cli.needs_data
def main(arguments: list[str] | None = None) -> int:
    """Run all cases; return 1 if nam misjudges one or leaves a proof open."""
    parser = cli.parser(__doc__, "data", "limit", "csv", "go-on", solvers=SOLVERS)
    parser.add_argument("--step", type=int, default=3, help="1: every change of every")
    parser.add_argument("--check", action="store_true", help="ask HiGHS, then stop")
    args = parser.parse_args(arguments)
    makers = cases.all_cases(args.data, args.step)
    found = {name: case for name, make in makers.items() if (case := make())}
    if args.check:
        return int(check(found) > 0)
    solvers = machine.installed(args.solvers)
    header, keys = cli.begin(solvers), ("problem", "solver")
    with csv_files.growing(args.csv, header, COLUMNS, keys, args.go_on) as file:
        for solver in solvers:
            with Bench(solve, solver, args.limit) as child:
                for name, case in found.items():
                    if not file.has(name, solver):
                        file.add(case_row(child, name, case))
    rows = [csv_files.with_numbers(row, NUMBERS) for row in file.rows]
    print_groups(rows)
    print_own(rows)
    return int(any(is_failure(row) for row in tables.chosen(rows, solver="nam")))


if __name__ == "__main__":
    sys.exit(main())
