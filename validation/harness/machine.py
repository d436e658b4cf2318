"""What the figures depend on: machine, threads, versions; and who is installed."""

import datetime
import importlib.metadata
import importlib.util
import os
import platform
from collections.abc import Iterable
from pathlib import Path

import qpsolvers

PACKAGES = {"nam": "namlcp", "proxqp": "proxsuite", "highs": "highspy"}
OWN_INTERFACES = ("nam", "moreau")
"""Solvers that qpsolvers does not know, or only once their package is imported."""
THREADS = ("OMP", "OPENBLAS", "MKL", "NUMEXPR", "RAYON")
"""Libraries whose threads an environment variable limits; numba has its own."""


def lines(solvers: Iterable[str]) -> list[str]:
    """Return what the figures depend on: machine, threads, versions, date."""
    packages = ["numpy", "scipy", "numba", "qpsolvers"]
    packages += [PACKAGES.get(solver, solver) for solver in solvers]
    versions = [f"{name} {package_version(name)}" for name in packages]
    return [
        f"date: {datetime.date.today()}",
        f"cpu: {cpu_name()}, {os.cpu_count()} cores, 1 thread used",
        f"python: {platform.python_version()} on {platform.system()}",
        f"versions: {', '.join(versions)}",
    ]


def package_version(name: str) -> str:
    """Return the version of an installed package, else of its source tree."""
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "(source)"


def cpu_name() -> str:
    """Return the name of the processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text().splitlines() if info.exists() else []
    names = [line.split(":")[1].strip() for line in lines if "model name" in line]
    return names[0] if names else platform.processor()


def installed(solvers: Iterable[str]) -> list[str]:
    """Return the solvers that can run here; name the others."""
    found = []
    for solver in solvers:
        here = solver in qpsolvers.available_solvers
        if solver in OWN_INTERFACES:
            package = PACKAGES.get(solver, solver)
            here = importlib.util.find_spec(package) is not None
        if here:
            found.append(solver)
        else:
            print(f"{solver}: not installed, left out")
    return found


def not_installed(wanted: Iterable[str], found: Iterable[str]) -> list[str]:
    """Return the line of a CSV header that names who is missing, or none."""
    missing = [solver for solver in wanted if solver not in found]
    return [f"not installed: {', '.join(missing)}"] if missing else []
