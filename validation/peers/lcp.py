"""LCPs: contact scenes beside PIQP, a million unknowns beside OSQP, first calls.

contact
    `solve_lcp` at default settings and PIQP (through qpsolvers, 1e-9) on the contact
    scenes. Relative residual: || min(z, Az + q) ||_2 / || min(q, 0) ||_2 of the LCP
    scaled to unit diagonal.
example1
    The five-point matrix + 4 I, n = 10^6, z* = (1, 2, 1, 2, ...), by method="auto" to
    Res < 1e-10 and by OSQP to 1e-8 with polishing: time, || min(z, Az + q) ||_2, error
    and peak memory above what was there before, in units of the memory of A.
first-call
    A fresh process that imports the package and solves one small problem.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import qpsolvers
import scipy.sparse as sp

from validation.harness import (
    Row,
    cli,
    csv_files,
    judging,
    processes,
    qp_solvers,
    tables,
    timing,
)
from validation.problems import data_sets, sweep_scenes

PARTS = ("contact", "example1", "first-call")
RUNS = 3
FIRST_CALL = "environment.first_call"


def contact(data: Path) -> list[Row]:
    """Return one row for each scene and solver."""
    import namlcp

    rows = []
    for name in data_sets.set_names(data, "contact"):
        A, q = data_sets.contact_lcp(data, name)
        problem = data_sets.load(data, "contact", name)
        settings = qp_solvers.settings("piqp", 1e-9, 10.0) | {"solver": "piqp"}
        for solver, call in (
            ("nam", partial(namlcp.solve_lcp, A, q)),
            ("piqp", partial(qpsolvers.solve_problem, problem, **settings)),
        ):
            call()
            answer, _, runtime = timing.median_time(call)
            z = answer.z if solver == "nam" else answer.x
            rows.append(
                {
                    "scene": name,
                    "n": q.size,
                    "solver": solver,
                    "runtime": runtime,
                    "relative_residual": judging.relative_residual(A, q, z),
                    "status": answer.status.value if solver == "nam" else answer.found,
                }
            )
    return rows


def print_contact(rows: list[Row]) -> None:
    """Print the scenes, how many are solved to 1e-9, and the geometric means."""
    tables.print_rows(rows, "scene:18 n:6 solver runtime relative_residual:18 status")
    for solver in ("nam", "piqp"):
        own = tables.chosen(rows, solver=solver)
        exact = sum(row["relative_residual"] <= 1e-9 for row in own)
        mean = 1e3 * timing.geometric_mean([row["runtime"] for row in own])
        print(f"{solver}: {exact}/{len(own)} to 1e-9, geometric mean {mean:.3f} ms")


def nam_call(A: sp.csr_array, q: np.ndarray) -> Callable[[], np.ndarray]:
    """Return the call that is timed: data in, z out."""
    import namlcp

    return lambda: namlcp.solve_lcp(A, q, method="auto", eps_abs=1e-10).z


def osqp_call(A: sp.csr_array, q: np.ndarray) -> Callable[[], np.ndarray]:
    """Return the same for OSQP: min 1/2 z'Az + q'z, z >= 0.

    Its duality gap, a sum of terms of 10^7, is not tested: rounding alone is 1e-8.
    """
    import osqp

    P, eye = sp.csc_matrix(sp.triu(A)), sp.eye(q.size, format="csc")
    options = qp_solvers.settings("osqp", 1e-8, 600.0) | {"check_dualgap": False}

    def call() -> np.ndarray:
        solver = osqp.OSQP()
        bounds = {"l": np.zeros(q.size), "u": np.full(q.size, np.inf)}
        solver.setup(P=P, q=q, A=eye, **bounds, verbose=False, **options)
        return solver.solve().x

    return call


def example1_row(solver: str, repeats: int) -> Row:
    """Return time, accuracy and memory of a solver on Example 1, n = 10^6."""
    make = nam_call if solver == "nam" else osqp_call
    small, scene = (sweep_scenes.paper_example(1, m) for m in (10, 1000))
    make(small.A, small.q)()
    A, q = scene.A, scene.q
    call = make(A, q)
    before = timing.resident_memory(reset_peak=True)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        z = call()
        times.append(time.perf_counter() - start)
        if len(times) == 1:
            memory = timing.resident_memory() - before
    own = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
    return {
        "solver": solver,
        "runtime": float(np.median(times)),
        "cold": times[0],
        "residual": float(np.linalg.norm(np.minimum(z, A @ z + q))),
        "error": float(np.max(np.abs(z - np.tile([1.0, 2.0], z.size // 2)))),
        "memory": memory / own,
    }


def first_calls() -> list[Row]:
    """Return the times [s] of a fresh process for each path, the best of RUNS."""
    rows = []
    for path in run_script(FIRST_CALL).split():
        runs = [fresh_process(path) for _ in range(RUNS)]
        rows.append({"path": path} | min(runs, key=lambda times: times["solve"]))
    return rows


def markdown(rows: list[Row]) -> str:
    """Return the table of first solves [s]."""
    columns = "path", "import", "solve"
    lines = [
        (row["path"], *(f"{float(row[name]):.2g}" for name in columns[1:]))
        for row in rows
    ]
    return tables.markdown(("path", "import", "first solve"), lines)


def run_script(*command: str) -> str:
    """Return what a script prints."""
    return subprocess.run(
        cli.script(*command),
        cwd=cli.ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def fresh_process(path: str) -> Row:
    """Return the wall-clock times of a process, of import and solve in it."""
    start = time.perf_counter()
    printed = run_script(FIRST_CALL, path)
    seconds = [time.perf_counter() - start, *map(float, printed.split())]
    return dict(zip(("process", "import", "solve"), seconds, strict=True))


@cli.needs_data
def main(arguments: list[str] | None = None) -> int:
    """Run the parts."""
    parser = cli.parser(__doc__, data=..., results=None)
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    args = parser.parse_args(arguments)
    header = cli.begin(["nam", "piqp", "osqp"])
    for part in args.parts:
        if part == "contact":
            rows = processes.isolated(contact, args.data)
            print_contact(rows)
        elif part == "example1":
            rows = [processes.isolated(example1_row, "nam", 5)]
            rows += [processes.isolated(example1_row, "osqp", 1)]
            tables.print_rows(rows, "solver runtime cold residual error memory")
            print(f"osqp/nam: {rows[1]['runtime'] / rows[0]['runtime']:.0f}")
        else:
            rows = first_calls()
            tables.print_rows(rows, " ".join(f"{column}:16" for column in rows[0]))
        if args.results:
            csv_files.write(args.results / f"{part}.csv", header, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
