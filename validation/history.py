"""Some twenty figures of a commit, kept with it, so that one can ask later what fell.

One child process takes less than a minute; a row for each figure is appended to
results/history.csv: commit, processor, how many of its cores were busy before, value.
Printed beside each is its ratio to the last one taken on the same processor while that
was quiet. Times are of the wall clock.
"""

import time
from collections.abc import Iterator
from typing import Any

from validation.applications import large
from validation.derivatives import packages
from validation.general import benchmark as general
from validation.harness import Bench, Job, Row, cli, machine, tables, timing
from validation.peers import benchmark
from validation.problems import data_sets, osqp_classes
from validation.repeated import benchmark as repeated

LIMIT = 900.0  # [s] for all of them
FILE = cli.RESULTS / "history.csv"
COLUMNS = "commit date cpu load figure value".split()
SETS = (("mpc", 1e-6), ("contact", 1e-6), ("small", 1e-9))
STEPS = (("condensed MPC", 10), ("sparse MPC, definite", 30), ("contact", 120))
Figure = tuple[str, float]


def of_problems(name: str, rows: list[Row]) -> Iterator[Figure]:
    """Yield how many problems are solved, and the geometric mean of their times."""
    yield f"{name}, solved", sum(row["success"] for row in rows)
    times = [1e3 * row["runtime"] for row in rows if row["success"]]
    yield f"{name}, ms", timing.geometric_mean(times)


def figures(job: Job) -> Iterator[Figure]:
    for problem_set, eps in SETS:
        names = data_sets.set_names(job.data, problem_set)
        rows = [benchmark.measure(job, problem_set, name, eps) for name in names]
        yield from of_problems(f"{problem_set} at {eps:g}", rows)
    sizes = {name: str(own.sizes[1]) for name, own in osqp_classes.CLASSES.items()}
    rows = [benchmark.measure(job, *key, 1e-6) for key in sizes.items()]
    yield from of_problems("classes of 10^4 entries", rows)
    for n in (5, 20, 100, 300):
        yield f"one QP of {n}, us", repeated.latency(job, n, 1e-6)["microseconds"]
    row = repeated.batch(job, 10, 20, 10_000, 1)
    yield "QP of 10 in a batch, us", row["microseconds"]
    for scene, size in STEPS:
        made = repeated.recorded(scene, size, "moves a little", 60)
        step = repeated.replayed(job, made, 1e-9)["microseconds"]
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


def work(job: Job) -> list[Figure]:
    job.ready()
    return list(figures(job._replace(limit=10.0, ready=lambda: None)))


def main(arguments: list[str] | None = None) -> int:
    args = cli.parser(__doc__, data=..., csv=FILE).parse_args(arguments)
    cli.begin()
    about = {"commit": machine.commit(), "cpu": machine.cpu_name()}
    about |= {"load": f"{machine.busy_cores():.1f}", "date": time.strftime("%F")}
    before = {
        row["figure"]: row["value"]
        for row in tables.read(args.csv)
        if row["cpu"] == about["cpu"] and float(row["load"]) <= machine.MOST_BUSY
    }
    child = Bench(work, "nam", LIMIT, args.data)
    found: Any = child.ask()
    child.stop()
    if isinstance(found, dict):
        raise RuntimeError(found["status"])
    with tables.growing(args.csv, [], COLUMNS) as file:
        for name, value in found:
            file.add(about | {"figure": name, "value": f"{value:.5g}"})
            ratio = value / float(before[name]) if name in before else float("nan")
            print(f"{name:<34} {value:>8.4g} {ratio:8.2f}", flush=True)
    return 0
