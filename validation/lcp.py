"""LCPs: contact scenes beside PIQP, a million unknowns beside OSQP, first calls.

Usage::

    python validation/lcp.py --data DIR [--parts contact example1 first-call]
        [--results DIR]

contact
    `solve_lcp` at default settings and PIQP (through qpsolvers, 1e-9) on the contact
    scenes. Relative residual: || min(z, Az + q) ||_2 / || min(q, 0) ||_2 of the LCP
    scaled to unit diagonal.
example1
    The five-point matrix + 4 I, n = 10^6, z* = (1, 2, 1, 2, ...), by method="auto" to
    Res < 1e-10 and by OSQP to 1e-8 with polishing: time, || min(z, Az + q) ||_2, error
    and peak memory above what was there before, in units of the memory of A.
first-call
    A fresh process that imports the package and solves one small problem, with an
    empty compilation cache and with a warm one.
"""

import argparse
import csv
import multiprocessing as mp
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

import problems
from benchmark import geometric_mean, machine_lines, use_one_thread
from first_call import PATHS
from measure import median_time, silence
from settings import solver_settings

Row = dict[str, Any]
PARTS = ("contact", "example1", "first-call")
WARM_RUNS = 3


def relative_residual(A: sp.csr_matrix, q: np.ndarray, z: np.ndarray) -> float:
    """Return the relative natural residual of the LCP scaled to unit diagonal.

    With d = 1 / sqrt(diag A): A := d A d, q := d q, z := z / d.
    """
    d = 1.0 / np.sqrt(A.diagonal())
    residual = np.linalg.norm(np.minimum(z / d, d * (A @ z + q)))
    return float(residual / np.linalg.norm(np.minimum(d * q, 0.0)))


def contact(data: Path) -> list[Row]:
    """Return one row for each scene and solver."""
    import namlcp

    rows = []
    for name in problems.set_names(data, "contact"):
        A, q = problems.contact_lcp(data, name)
        problem = problems.load(data, "contact", name)
        settings = solver_settings("piqp", 1e-9, 10.0)

        def nam(A: Any = A, q: np.ndarray = q) -> Any:
            return namlcp.solve_lcp(A, q)

        def piqp(problem: Any = problem, settings: Row = settings) -> Any:
            return qpsolvers.solve_problem(problem, solver="piqp", **settings)

        for solver, call in (("nam", nam), ("piqp", piqp)):
            call()
            answer, _, runtime = median_time(call)
            z = answer.z if solver == "nam" else answer.x
            rows.append(
                {
                    "scene": name,
                    "n": q.size,
                    "solver": solver,
                    "runtime": runtime,
                    "relative_residual": relative_residual(A, q, z),
                    "status": answer.status.value if solver == "nam" else answer.found,
                }
            )
    return rows


def print_contact(rows: list[Row]) -> None:
    """Print the scenes side by side, and the geometric means."""
    print(f"\n{'scene':<18}{'n':>6}{'nam [ms]':>10}{'residual':>10}  status")
    print(f"{'':<24}{'piqp [ms]':>10}{'residual':>10}")
    for row in rows:
        scene = f"{row['scene']:<18}{row['n']:>6}" if row["solver"] == "nam" else ""
        print(
            f"{scene:<24}{1e3 * row['runtime']:>10.3f}"
            f"{row['relative_residual']:>10.1e}  {row['solver']} {row['status']}"
        )
    for solver in ("nam", "piqp"):
        own = [row for row in rows if row["solver"] == solver]
        exact = sum(row["relative_residual"] <= 1e-9 for row in own)
        mean = 1e3 * geometric_mean([row["runtime"] for row in own])
        print(f"{solver}: {exact}/{len(own)} to 1e-9, geometric mean {mean:.3f} ms")


def example1(m: int) -> tuple[sp.csr_array, np.ndarray, np.ndarray]:
    """Return A, q and the solution of Example 1 with delta = 4 and n = m^2."""
    line = sp.diags_array([-1.0, -1.0], offsets=[-1, 1], shape=(m, m))
    A = sp.csr_array(sp.kronsum(line, line) + 8.0 * sp.eye_array(m * m))
    z = np.tile([1.0, 2.0], m * m // 2)
    return A, -(A @ z), z


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
    options = solver_settings("osqp", 1e-8, 600.0) | {"check_dualgap": False}

    def call() -> np.ndarray:
        solver = osqp.OSQP()
        bounds = {"l": np.zeros(q.size), "u": np.full(q.size, np.inf)}
        solver.setup(P=P, q=q, A=eye, **bounds, verbose=False, **options)
        return solver.solve().x

    return call


def example1_row(solver: str, repeats: int) -> Row:
    """Return time, accuracy and memory of a solver on Example 1, n = 10^6."""
    make = nam_call if solver == "nam" else osqp_call
    A, q, _ = example1(10)
    make(A, q)()
    A, q, exact = example1(1000)
    call = make(A, q)
    before = resident_memory(reset_peak=True)
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        z = call()
        times.append(time.perf_counter() - start)
        if len(times) == 1:
            memory = resident_memory() - before
    own = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
    return {
        "solver": solver,
        "runtime": float(np.median(times)),
        "cold": times[0],
        "residual": float(np.linalg.norm(np.minimum(z, A @ z + q))),
        "error": float(np.max(np.abs(z - exact))),
        "memory": memory / own,
    }


def resident_memory(reset_peak: bool = False) -> float:
    """Return the peak resident memory of this process in bytes (Linux), else NaN."""
    status = Path("/proc/self/status")
    if not status.exists():
        return np.nan
    if reset_peak:
        Path("/proc/self/clear_refs").write_text("5")
    lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
    return 1024.0 * float(lines["VmHWM"].split()[0])


def print_example1(rows: list[Row]) -> None:
    """Print the two solvers and the ratio of their times."""
    columns = (
        "Example 1, n = 10^6",
        "time [s]",
        "cold [s]",
        "Res",
        "error",
        "memory/A",
    )
    print(f"\n{columns[0]:<20}" + "".join(f"{name:>10}" for name in columns[1:]))
    for row in rows:
        print(
            f"{row['solver']:<20}{row['runtime']:>10.3f}{row['cold']:>10.3f}"
            f"{row['residual']:>10.1e}{row['error']:>10.1e}{row['memory']:>10.1f}"
        )
    times = {row["solver"]: row["runtime"] for row in rows}
    print(f"osqp/nam: {times['osqp'] / times['nam']:.0f}")


def first_calls() -> list[Row]:
    """Return the times of a fresh process for each path, compiling and not.

    From a wheel with machine code neither compiles.
    """
    rows = []
    for path in PATHS:
        with tempfile.TemporaryDirectory() as cache:
            row = {"path": path} | fresh_process(path, cache, "empty")
            warm = [fresh_process(path, cache, "warm") for _ in range(WARM_RUNS)]
        best = min(warm, key=lambda times: times["warm_process"])
        rows.append(row | best)
    return rows


def fresh_process(path: str, cache: str, kind: str) -> Row:
    """Return the wall-clock times of a process, of import and solve in it."""
    script = Path(__file__).with_name("first_call.py")
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, str(script), path],
        env=os.environ | {"NUMBA_CACHE_DIR": cache},
        capture_output=True,
        text=True,
        check=True,
    )
    seconds = [time.perf_counter() - start, *map(float, done.stdout.split())]
    names = ("process", "import", "solve", "compiling")
    return {f"{kind}_{name}": s for name, s in zip(names, seconds, strict=True)}


def print_first_calls(rows: list[Row]) -> None:
    """Print the paths; process means interpreter, imports and solve together."""
    print(f"\n{'first call [s]':<20}{'empty cache':>44}{'warm cache':>44}")
    columns = [name.partition("_")[2] for name in list(rows[0])[1:]]
    print(f"{'':<20}" + "".join(f"{name:>11}" for name in columns))
    for row in rows:
        times = [f"{value:>11.3f}" for value in list(row.values())[1:]]
        print(f"{row['path']:<20}{''.join(times)}")


def isolated(function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the value of a function, computed in a fresh process."""
    context = mp.get_context("spawn")
    with ProcessPoolExecutor(1, context, silence) as pool:
        return pool.submit(function, *arguments).result()


def write_csv(file: Path, header: list[str], rows: list[Row]) -> None:
    """Write the rows below the lines that describe the machine."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="") as stream:
        stream.writelines(f"# {line}\n" for line in header)
        writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def main(arguments: list[str] | None = None) -> int:
    """Run the parts; return 2 if the data folder lacks something."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the data folder")
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS)
    parser.add_argument("--results", type=Path, help="folder for one CSV file a part")
    args = parser.parse_args(arguments)
    use_one_thread()
    header = machine_lines(["nam", "piqp", "osqp"])
    print("\n".join(header))
    for part in args.parts:
        try:
            if part == "contact":
                rows = isolated(contact, args.data)
                print_contact(rows)
            elif part == "example1":
                rows = [isolated(example1_row, "nam", 5)]
                rows += [isolated(example1_row, "osqp", 1)]
                print_example1(rows)
            else:
                rows = first_calls()
                print_first_calls(rows)
        except problems.MissingDataError as error:
            print(f"{error}; --data must be the data folder")
            return 2
        if args.results:
            write_csv(args.results / f"{part}.csv", header, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
