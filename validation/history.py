"""Some twenty figures of a commit, kept with it, so that one can ask later what fell.

Runs in some minutes, in this process, and appends to results/history.csv a row for each
figure: the commit, the processor, how many of its cores were busy before, the value.
Printed beside each is the value over the last one of an earlier commit that was taken
on the same processor while it was quiet. Counts are of solved problems or of iterations; times are of the wall clock.
"""

import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from subprocess import run

from validation.applications import large
from validation.derivatives import packages
from validation.general import benchmark as general
from validation.harness import Job, cli, csv_files, machine, quiet, tables, timing
from validation.peers import benchmark
from validation.problems import data_sets, osqp_classes
from validation.repeated import batches, latency, sequences

FILE = cli.RESULTS / "history.csv"
COLUMNS = "commit date cpu load figure value".split()
SETS = (("mpc", 1e-6), ("contact", 1e-6), ("small", 1e-9))
STEPS = (("condensed MPC", 10), ("sparse MPC, definite", 30), ("contact", 120))
Figure = tuple[str, float]


def of_problems(name: str, rows: list[csv_files.Row]) -> Iterator[Figure]:
    """Yield how many problems are solved, and the geometric mean of their times."""
    yield f"{name}, solved", sum(row["success"] for row in rows)
    times = [1e3 * row["runtime"] for row in rows if row["success"]]
    yield f"{name}, ms", timing.geometric_mean(times)


def figures(data: Path) -> Iterator[Figure]:
    job = Job("nam", 10.0, data, lambda: None)
    for problem_set, eps in SETS:
        names = data_sets.set_names(data, problem_set)
        rows = [benchmark.measure(job, problem_set, name, eps) for name in names]
        yield from of_problems(f"{problem_set} at {eps:g}", rows)
    ask = partial(benchmark.measure, job, eps=1e-6, load=benchmark.load_class)
    classes = osqp_classes.CLASSES.items()
    rows = [ask(name, str(found.sizes[1])) for name, found in classes]
    yield from of_problems("classes of 10^4 entries", rows)
    for n in (5, 20, 100, 300):
        yield f"one QP of {n}, us", latency.measured(job, n, 1e-6)["microseconds"]
    row = batches.measured(job, 10, 20, 10_000, 1)
    yield "QP of 10 in a batch, us", row["microseconds"]
    for scene, size in STEPS:
        made = sequences.recorded(scene, size, "moves a little", 60)
        step = sequences.replayed(job, made, 1e-9)["microseconds"]
        yield f"step of {scene} {size}, us", step
    for family, n in (("pile", 200), ("games", 140)):
        times = [general.work(job, family, n, seed)["runtime"] for seed in range(3)]
        yield f"{family} {n}, ms", 1e3 * timing.geometric_mean(times)
    obstacle = large.SCENES["forced"].make(90_000)
    found, *_, seconds = timing.median_time(lambda: large.call(obstacle, 60.0, False))
    yield "obstacle of 90 000, ms", 1e3 * seconds
    yield "obstacle of 90 000, iterations", found.iterations
    row = packages.qp_row("nam", packages.dense_case(100))
    yield "backward, dense 100, us", 1e6 * row["backward"]


def import_time() -> float:
    """Return the time of a process that imports namlcp, over one that does not [s]."""
    times = []
    for text in ("import numpy, scipy.sparse", "import numpy, scipy.sparse, namlcp"):
        call = partial(run, [sys.executable, "-c", text], check=True)
        call()
        times.append(min(timing.median_time(call)[1:]))
    return times[1] - times[0]


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__, data=..., csv=FILE)
    args = parser.parse_args(arguments)
    cli.begin()
    about = {"commit": machine.commit(), "date": time.strftime("%Y-%m-%d")}
    about |= {"cpu": machine.cpu_name(), "load": f"{quiet.busy_cores(1.0):.1f}"}
    before = {
        row["figure"]: row["value"]
        for row in tables.chosen(csv_files.read(args.csv), cpu=about["cpu"])
        if row["commit"] != about["commit"] and float(row["load"]) <= quiet.MOST_BUSY
    }
    with csv_files.writer(args.csv, [], COLUMNS, append=True) as write:
        for name, value in (*figures(args.data), ("import, ms", 1e3 * import_time())):
            write(about | {"figure": name, "value": f"{value:.5g}"})
            ratio = value / float(before[name]) if name in before else float("nan")
            print(f"{name:<34} {tables.short(value):>8} {ratio:8.2f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
