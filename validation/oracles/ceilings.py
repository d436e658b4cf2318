"""What can be had: the residuals of exact solutions, rounded to double.

Usage::

    python -m validation.oracles.ceilings run --data DIR --csv FILE [--only NAME ...]
        [--limit 100]
    python -m validation.oracles.ceilings table --csv FILE

An absolute tolerance may be below what double precision can express: the right sides of
BOYD1 reach 4e12, whose spacing is 5e-4. For Maros-Meszaros problems that namlcp misses
at 1e-9, `run` solves the KKT system of the active set in exact arithmetic (`exact`),
starting from the best point of namlcp and correcting the set until every sign is right,
rounds the solution to double and judges that as any other point:

- rounded: each number to the nearest double, nothing else;
- corrected: then by `Judge.offer`, which moves last digits where residuals allow it.

A tolerance that the rounded or corrected solution meets is ours to reach. One that both
miss is at the ceiling: not a proof that no double point passes (other roundings of the
same solution may), but what is missed is rounding and no longer the method.

`exact` is True if the residual of the system is below FAITHFUL and all signs are right;
a multiplier or slack within NOISE of zero counts as zero. A problem is a row, written
at once; the run goes on where it stopped.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
from qpsolvers import Problem, Solution

from namlcp import solve_qp
from namlcp.limits import Limits
from namlcp.qp.judge import Judge
from namlcp.qp.problem import QP, Point, qp_data
from namlcp.residuals import qp_residuals
from validation.harness import Row, cli, csv_files, tables
from validation.oracles.exact import Active, ExactQP, Face
from validation.problems import data_sets

NAMES = (
    "QSHELL QGFRDXPN QFORPLAN QFFFFF80 QISRAEL QSTAIR HUESTIS POWELL20 LISWET7 STADAT1 "
    "CVXQP3_L CVXQP1_L BOYD1 BOYD2"
).split()
TOLERANCES = (1e-6, 1e-9)
ROUNDS = 40  # active sets at most
FAITHFUL = 1e-12
NOISE = 1e-13
COLUMNS = (
    "problem variables inequalities equalities nam nam_worst exact rounds "
    "face_residual wrong_signs primal dual gap primal_size dual_size gap_size "
    "rounded_1e-06 corrected_1e-06 rounded_1e-09 corrected_1e-09 seconds"
).split()


def guess(qp: QP, point: Point) -> Active:
    """Return the constraints whose multiplier exceeds their slack; fixed variables."""
    x, _, z, z_box = point
    fixed = qp.lb == qp.ub
    lower = (-z_box > x - qp.lb) | fixed
    upper = (z_box > qp.ub - x) & ~lower
    return Active(z > qp.h - qp.G @ x, lower, upper)


def corrected(active: Active, face: Face, fixed: np.ndarray) -> tuple[Active, int]:
    """Return the active set without wrong multipliers and with violated constraints.

    Also how many these are.
    """
    inactive = ~active.rows
    drop = active.rows & (face.z < -NOISE), active.lower & ~fixed & (face.pull > NOISE)
    drop_upper = active.upper & (face.pull < -NOISE)
    add = inactive & (face.slack < -NOISE), active.free & (face.above < -NOISE)
    add_upper = active.free & (face.below < -NOISE) & ~add[1]
    wrong = sum(int(part.sum()) for part in (*drop, drop_upper, *add, add_upper))
    lower = (active.lower & ~drop[1]) | add[1]
    upper = (active.upper & ~drop_upper) | add_upper
    return Active((active.rows & ~drop[0]) | add[0], lower, upper), wrong


def exact_solution(qp: QP, point: Point) -> tuple[Point, Face, int, int]:
    """Return the rounded solution, its face, wrong signs left, active sets tried."""
    exact, active, fixed = ExactQP(qp), guess(qp, point), qp.lb == qp.ub
    seen: set[bytes] = set()
    while True:
        face = exact.face(point, active)
        after, wrong = corrected(active, face, fixed)
        key = b"".join(part.tobytes() for part in after)
        last = key in seen or len(seen) == ROUNDS - 1
        if wrong == 0 or last or not np.isfinite(face.residual):
            break
        seen.add(key)
        active = after
        point = Point(face.x, face.y, np.maximum(face.z, 0.0), point.z_box)
    # noise that counts as zero would be a wrong sign
    z = np.where(active.rows, np.maximum(face.z, 0.0), 0.0)
    z_box = np.where(active.free, 0.0, face.pull)
    z_box = np.where(np.isinf(qp.lb), np.maximum(z_box, 0.0), z_box)
    z_box = np.where(np.isinf(qp.ub), np.minimum(z_box, 0.0), z_box)
    return Point(face.x, face.y, z, z_box), face, wrong, len(seen) + 1


def by_the_host(problem: Problem, point: Point) -> tuple[float, float, float]:
    """Return the residuals by qpsolvers' own functions."""
    found = Solution(problem, found=True)
    found.x, found.y, found.z, found.z_box = point
    residuals = found.primal_residual(), found.dual_residual(), found.duality_gap()
    return tuple(float(value) for value in residuals)  # type: ignore[return-value]


def passes(problem: Problem, qp: QP, point: Point, eps: float) -> bool:
    """Tell whether our residuals and the host's are all within eps."""
    ours = qp_residuals(*qp, *point).solved(eps, 0.0)
    return ours and max(by_the_host(problem, point)) <= eps


def ceiling(problem: Problem, limit: float) -> Row:
    """Return the row of one problem: namlcp's answer at 1e-9, the exact one, judged."""
    start = time.perf_counter()
    qp = qp_data(*problem.unpack())
    least = min(TOLERANCES)
    ours = solve_qp(*problem.unpack(), eps_abs=least, eps_rel=0.0, time_limit=limit)
    row: Row = {"nam": ours.status.value, "nam_worst": max(ours.residuals[:3])}
    sizes = {"variables": qp.q, "inequalities": qp.h, "equalities": qp.b}
    row |= {name: vector.size for name, vector in sizes.items()}
    found = Point(ours.x, ours.y, ours.z, ours.z_box)
    point, face, wrong, rounds = exact_solution(qp, found)
    row |= {"rounds": rounds, "face_residual": face.residual, "wrong_signs": wrong}
    row["exact"] = wrong == 0 and face.residual <= FAITHFUL
    row |= zip(("primal", "dual", "gap"), by_the_host(problem, point), strict=True)
    residuals = qp_residuals(*qp, *point)
    row |= {name: getattr(residuals, name) for name in COLUMNS if "_size" in name}
    for eps in TOLERANCES:
        judge = Judge(qp, Limits(eps, 0.0))
        judge.offer(point)
        row[f"rounded_{eps:.0e}"] = passes(problem, qp, point, eps)
        row[f"corrected_{eps:.0e}"] = passes(problem, qp, judge.point, eps)
    return row | {"seconds": time.perf_counter() - start}


def run(data: Path, file: Path, names: list[str], limit: float) -> None:
    """Write the rows that the CSV file does not have yet."""
    header = cli.begin(["nam"])
    with csv_files.growing(file, header, COLUMNS, ["problem"]) as table:
        for name in names:
            if not table.has(name):
                row = ceiling(data_sets.maros_problem(data, name, dense=False), limit)
                table.add({"problem": name} | row)


def verdict(row: Row, eps: str) -> str:
    """Return in words whether a tolerance can be had."""
    if row[f"rounded_{eps}"] == "True":
        return "yes"
    if row[f"corrected_{eps}"] == "True":
        return "corrected"
    if float(row["nam_worst"]) <= float(eps):
        return "by namlcp"  # at another rounding of the solution
    return "no" if row["exact"] == "True" else "unknown"


def markdown(rows: list[Row]) -> str:
    """Return the table of the rows of a CSV file."""
    columns = (
        "problem", "nam at 1e-9", "exact solution, rounded: primal", "dual", "gap",
        "largest term of the gap", "1e-6 can be had", "1e-9 can be had",
    )  # fmt: skip
    lines = [
        (
            row["problem"],
            f"{row['nam']}, {float(row['nam_worst']):.1e}",
            *(f"{float(row[name]):.1e}" for name in ("primal", "dual", "gap")),
            f"{float(row['gap_size']):.0e}",
            *(verdict(row, f"{eps:.0e}") for eps in TOLERANCES),
        )
        for row in rows
    ]
    return tables.markdown(columns, lines)


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    """Return what the command line says."""
    parser = cli.parser(__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    command = commands.add_parser("run")
    cli.add_usual(command, data=..., csv=..., limit=100.0)
    command.add_argument("--only", nargs="+", default=NAMES, help="names of problems")
    cli.add_usual(commands.add_parser("table"), csv=...)
    return parser.parse_args(arguments)


@cli.needs_data
def main(arguments: list[str] | None = None) -> int:
    """Run or tabulate."""
    args = parsed(arguments)
    if args.command == "run":
        run(args.data, args.csv, args.only, args.limit)
    print(markdown(csv_files.read(args.csv)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
