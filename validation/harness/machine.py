"""What the figures depend on: machine, threads, versions; and who is installed."""

import datetime
import importlib.metadata
import importlib.util
import os
import platform
import subprocess
from collections.abc import Iterable
from pathlib import Path

import qpsolvers

from validation.harness import quiet

PACKAGES = {"nam": "namlcp", "proxqp": "proxsuite"}
THREADS = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "RAYON")


def lines(solvers: Iterable[str]) -> list[str]:
    """Return what the figures depend on: machine, threads, versions, date."""
    packages = ["numpy", "scipy", "qpsolvers"]
    names = dict.fromkeys(solver.split()[0] for solver in solvers)
    packages += [PACKAGES.get(name, name) for name in names]
    versions = [f"{name} {package_version(name)}" for name in dict.fromkeys(packages)]
    return [
        f"date: {datetime.date.today()}",
        f"commit: {commit()}",
        f"load: {quiet.said()}",
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


def installed(
    solvers: Iterable[str], packages: dict[str, str] | None = None
) -> list[str]:
    """Return the solvers, known by their first words, that can run here."""
    packages = {"nam": "namlcp"} | (packages or {})
    found = []
    for solver in solvers:
        name = solver.split()[0]
        here = name in qpsolvers.available_solvers
        if name in packages:
            here = importlib.util.find_spec(packages[name]) is not None
        if here:
            found.append(solver)
        else:
            print(f"{solver}: not installed, left out")
    return found
