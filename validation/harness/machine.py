"""What figures depend on: machine, threads, versions, load; and who is installed.

Where the environment variable QUIET is set, as by `report --full`, every request to a
child process waits until other processes keep at most MOST_BUSY cores busy.
"""

import datetime
import importlib.metadata
import importlib.util
import os
import platform
import subprocess
import time
from collections.abc import Iterable
from pathlib import Path

PACKAGES = {"nam": "namlcp", "proxqp": "proxsuite"}
THREADS = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "RAYON")
QUIET = "NAMLCP_QUIET"
MOST_BUSY = 0.3  # cores that others may keep busy on a quiet machine
SAMPLE = 0.2  # [s] over which the load is measured; this process sleeps meanwhile
LOOK_EVERY = 10.0  # [s] for which what was seen counts
PATIENCE = 3600.0  # [s] to wait for a quiet machine
last_look = -LOOK_EVERY  # when this process has seen that it was quiet


def lines(solvers: Iterable[str]) -> list[str]:
    """Return what the figures depend on: machine, threads, versions, date."""
    names = [solver.split()[0] for solver in solvers]
    packages = ["numpy", "scipy", "qpsolvers", *(PACKAGES.get(n, n) for n in names)]
    versions = [f"{name} {package_version(name)}" for name in dict.fromkeys(packages)]
    quiet = f"others kept less than {MOST_BUSY} of a core busy"
    return [
        f"date: {datetime.date.today()}",
        f"commit: {commit()}",
        f"load: {quiet if QUIET in os.environ else 'not looked at'}",
        f"cpu: {cpu_name()}, {os.cpu_count()} cores, 1 thread used",
        f"python: {platform.python_version()} on {platform.system()}",
        f"versions: {', '.join(versions)}",
    ]


def commit() -> str:
    """Return the commit, with "-dirty" if a source (no result) is not as committed."""
    here = Path(__file__).parent
    named = "git rev-parse --short=10 HEAD".split()
    changed = ["git", "diff", "--quiet", "HEAD", "--", ":/*.py", ":/*.toml"]
    try:
        done = subprocess.run(named, cwd=here, capture_output=True, text=True)
        if done.returncode:
            return "unknown"
        is_changed = subprocess.run(changed, cwd=here, capture_output=True).returncode
    except OSError:
        return "unknown"
    return done.stdout.strip() + ("-dirty" if is_changed else "")


def package_version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "(source)"


def cpu_name() -> str:
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":")[1].strip() for line in lines if "model name" in line]
    return names[0] if names else platform.processor()


def installed(solvers: Iterable[str], packages: dict[str, str] = PACKAGES) -> list[str]:
    """Return the solvers, known by their first words, whose packages are here."""
    packages, found = PACKAGES | packages, []
    for solver in solvers:
        name = solver.split()[0]
        if importlib.util.find_spec(packages.get(name, name)) is None:
            print(f"{solver}: not installed, left out")
        else:
            found.append(solver)
    return found


def busy_seconds() -> float:
    """Return the time [s] that all cores together have been busy since the start."""
    fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]
    ticks = [int(field) for field in fields[:8]]
    idle = ticks[3] + ticks[4]  # idle, and waiting for a disk
    return (sum(ticks) - idle) / os.sysconf("SC_CLK_TCK")


def busy_cores() -> float:
    """Return how many cores were busy while this process slept."""
    try:
        before, start = busy_seconds(), time.perf_counter()
        time.sleep(SAMPLE)
        return (busy_seconds() - before) / (time.perf_counter() - start)
    except OSError:
        return os.getloadavg()[0]


def wait_until_quiet() -> None:
    """Return once others keep no more busy than allowed; say so before a wait."""
    global last_look
    start, told = time.monotonic(), False
    if QUIET not in os.environ or start - last_look < LOOK_EVERY:
        return
    while (busy := busy_cores()) > MOST_BUSY:
        if time.monotonic() - start > PATIENCE:
            raise RuntimeError(f"others keep {busy:.1f} cores busy; limit {MOST_BUSY}")
        if not told:
            print(f"waiting: others keep {busy:.1f} cores busy", flush=True)
            told = True
        time.sleep(1.0)
    last_look = time.monotonic()
