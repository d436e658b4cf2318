"""All that is measured, in a list: a run makes anew what is out of date.

JOBS names the CSV files and the commands that make them. A file is up to date while its
stamp, a hash of the sources that its commands depend on, is that of now. --full waits
until the machine is quiet (`harness.machine`). What a command printed is in OUT/logs.
`--full --out validation` renews the repository's own files, and its README files. Jobs
whose data are missing are named and left out.
"""

import hashlib
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from validation.claims import documents
from validation.harness import cli, machine

LOWER_ROOMS = ("harness", "problems", "applications", "derivatives")


class Job(NamedTuple):
    """CSV files, the commands that make them one a line, and the minutes they take.

    {csv}, {data}, {results} and {figures} stand for paths, {quick} for --quick where
    there is a quick version. A job that `grows` goes on where its files stop. Of one
    that is not `timed` no time is claimed: two of them run side by side.
    """

    files: str
    commands: str
    minutes: float
    quick: float = 0.0
    grows: bool = False
    timed: bool = True

    @property
    def name(self) -> str:
        return self.files.split()[0]

    def lines(self, quick: bool) -> list[str]:
        text = self.commands.replace("{quick}", "--quick" if quick else "")
        return [line.strip() for line in text.splitlines() if line.strip()]


def suite(
    file: str, script: str, minutes: float, quick: float = 0.0, *,
    plot: bool = False, timed: bool = True,
) -> Job:  # fmt: skip
    """Return the job of a suite: one file, and a chart of it with `plot`."""
    commands = f"{script} {{quick}} --csv {{csv}} --go-on --data {{data}}"
    if plot:
        commands += f"\n{script} plot --csv {{csv}} --figures {{figures}}"
    return Job(file, commands, minutes, quick, True, timed)


JOBS = (
    suite("maros-meszaros", "peers.benchmark maros-meszaros", 45.0),
    suite("benchmark", "peers.benchmark sets", 17.0),
    suite("work-precision-problems", "peers.work_precision", 12.0, 3.0, plot=True),
    suite("large", "applications.large", 9.0, plot=True),
    suite("general-lcps", "general.benchmark families", 4.5, 1.5),
    suite("sequences", "repeated.benchmark sequences", 8.0, 0.5),
    suite("classes", "peers.benchmark classes", 3.0),
    suite("cvxpy-models", "applications.modelled models", 4.5),
    suite("infeasible", "peers.benchmark infeasible", 3.0),
    suite("generalisation", "peers.benchmark changes --solvers nam", 4.0),
    suite("latency", "repeated.benchmark latency", 2.0, 0.3, plot=True),
    suite("cvxpy-resolve", "applications.modelled steps", 1.0),
    suite("derivatives-peers", "derivatives.packages", 1.5, 1.0),
    suite("closest", "derivatives.closest", 6.0, 1.0),
    suite("generalisation-families",
          "peers.benchmark families --solvers nam piqp", 2.0),
    suite("batches", "repeated.benchmark batches", 0.3, 0.2),
    suite("time-stepping", "general.benchmark steps", 0.5, 0.5),
    suite("contact", "peers.lcp contact", 0.1),
    suite("example1", "peers.lcp example1", 0.5),
    suite("hertz", "peers.lcp hertz", 0.6),
    suite("first-call", "peers.first_call", 0.3),
    suite("american-put", "applications.american_put", 0.1),
    Job("paper-tables", "paper.sweeps paper-tables --results {results}", 0.5),
    Job("h_plus h_plus-definition convergence-proofs",
        "paper.h_plus --results {results}", 2.0),
    Job("campaign", """
        stress.campaign --csv {csv} --seeds 1 2 3
        stress.campaign --csv {csv} --seeds 1 --problems 10000 \
        --classes general values sequences batches derivatives closest
        stress.campaign --csv {csv} --seeds 1 --problems 30000 \
        --solvers osqp piqp clarabel daqp quadprog
        """, 22.0, grows=True, timed=False),
    suite("oracles", "oracles.agreement", 6.0, 1.0, timed=False),
    Job("stability stability-units", "paper.sweeps stability stability-units plot "
        "--results {results} --figures {figures}", 3.0, timed=False),
    suite("parameters", "paper.parameters", 4.0, timed=False),
    suite("derivatives", "derivatives.differences", 3.0, 1.0, timed=False),
    Job("paper-large", "paper.sweeps paper-large --results {results}", 2, timed=False),
)  # fmt: skip


def stamp(commands: list[str]) -> str:
    rooms = {*LOWER_ROOMS, *(command.split(".")[0] for command in commands)}
    found = hashlib.sha256("\n".join(commands).encode())
    for folder in ("src", *(f"validation/{room}" for room in sorted(rooms))):
        for path in sorted((cli.ROOT / folder).rglob("*.py")):
            found.update(path.read_bytes())
    return found.hexdigest()


def run(job: Job, data: Path, out: Path, quick: bool, again: bool) -> str:
    """Make the files of a job if they are out of date; return what is wrong."""
    lines = job.lines(quick)
    now, mark = stamp(lines), out / "stamps" / job.name
    was = mark.read_text() if mark.exists() else ""
    if not again and was == f"done {now}":
        return ""
    paths = {"data": data, "results": out / "results", "figures": out / "figures"}
    paths["csv"] = paths["results"] / f"{job.name}.csv"
    if job.grows and was != f"begun {now}":
        paths["csv"].unlink(missing_ok=True)
    mark.write_text(f"begun {now}")
    fault = ""
    with (out / "logs" / f"{job.name}.txt").open("w") as log:
        for line in lines:
            script, *words = line.split()
            given = dict(os.environ)
            if job.timed:
                machine.wait_until_quiet()
            else:
                given.pop(machine.QUIET, None)
            command = [sys.executable, "-u", "-m", "validation", script]
            command += [word.format(**paths) for word in words]
            streams = {"stdout": log, "stderr": subprocess.STDOUT}
            done = subprocess.run(command, cwd=cli.ROOT, env=given, **streams)
            code = done.returncode
            if code == cli.MISSING:
                return "data are missing"
            if code:  # the campaign's, too, where it has found what is wrong
                fault = f"{script} ended with {code}, see {log.name}"
    if not fault:
        mark.write_text(f"done {now}")
    return fault


def run_all(jobs: list[Job], data: Path, out: Path, args: list[bool]) -> Iterator[str]:
    """Run timed jobs one after the other, then two by two the others; yield faults."""

    def told(job: Job) -> str:
        start = time.monotonic()
        fault = run(job, data, out, *args)
        minutes = (time.monotonic() - start) / 60.0
        print(f"{job.name}: {fault or 'done'}, {minutes:.1f} min", flush=True)
        return f"{job.name}: {fault}" if fault else ""

    yield from filter(None, map(told, (job for job in jobs if job.timed)))
    with ThreadPoolExecutor(2) as pool:
        others = [job for job in jobs if not job.timed]
        yield from filter(None, pool.map(told, others))


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__, data=Path(os.environ.get("NAMLCP_DATA", "data")))
    size = parser.add_mutually_exclusive_group(required=True)
    size.add_argument("--quick", action="store_true", help="under ten minutes")
    size.add_argument("--full", action="store_true", help="hours")
    parser.add_argument("--out", type=Path, default=Path("report"))
    parser.add_argument("--only", nargs="+", choices=[job.name for job in JOBS])
    parser.add_argument("--again", action="store_true", help="nothing is up to date")
    parser.add_argument("--list", action="store_true", help="the jobs and minutes")
    args = parser.parse_args(arguments)
    out = args.out.resolve()
    jobs = [job for job in JOBS if not args.only or job.name in args.only]
    jobs = [job for job in jobs if args.full or job.quick]
    if args.list:
        for job in jobs:
            print(f"{job.quick if args.quick else job.minutes:5.1f}  {job.files}")
        return 0
    for folder in ("results", "figures", "logs", "stamps"):
        (out / folder).mkdir(parents=True, exist_ok=True)
    if args.full:
        os.environ[machine.QUIET] = "1"
    sizes = [args.quick, args.again]
    faults = list(run_all(jobs, args.data.resolve(), out, sizes))
    if args.full and out == cli.ROOT / "validation":
        documents.main([])
    print("\n".join(faults))
    return int(any("missing" not in fault for fault in faults))
