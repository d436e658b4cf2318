"""Run a part of the tests with the oldest and the newest supported packages.

For each of ENVIRONMENTS a virtual environment is made in DIR (a temporary folder unless
given; one that is there is used again), the package is installed as a user would, and
PART of the tests runs. Needs PyPI and, for each environment, some ten minutes on one
core, most of them for compiling. The oldest versions are the lower bounds of
pyproject.toml, so that these are what was measured. Returns 1 if a test fails.
"""

import os
import re
import subprocess
import sys
import tempfile
import tomllib
import venv
from pathlib import Path

from validation.harness import cli, csv_files

PART = (
    "checks", "residuals", "inputs", "limits", "threads", "main", "public_api",
    "ordering", "dense", "path", "substitution", "fronts", "infeasible",
    "scaling", "solve_lcp", "monotone", "sweeps", "tridiagonal", "multigrid",
    "mprgp", "convergence", "qpsolvers", "blas_threads",
)  # fmt: skip

PACKAGES = (
    "numpy", "scipy", "pyamg", "qpsolvers", "cvxpy", "pymetis",
)  # fmt: skip


def lower_bounds(extra: str | None = None) -> dict[str, str]:
    """Return {package: oldest version} of pyproject.toml, or of one of its extras."""
    project = tomllib.loads((cli.ROOT / "pyproject.toml").read_text())["project"]
    wanted = project["dependencies"]
    if extra is not None:
        wanted = project["optional-dependencies"][extra]
    found = (re.fullmatch(r"([\w-]+)>=([\w.]+)", line) for line in wanted)
    return {match[1]: match[2] for match in found if match}


WITH_CVXPY = lower_bounds() | lower_bounds("cvxpy") | {"numpy": "2.0"}  # it asks for 2
ENVIRONMENTS: dict[str, tuple[dict[str, str], tuple[str, ...]]] = {
    "oldest": (lower_bounds() | lower_bounds("large"), PART),
    "oldest-cvxpy": (WITH_CVXPY, ("cvxpy", "qpsolvers", "public_api")),
    "newest": (dict.fromkeys(PACKAGES, ""), (*PART, "cvxpy")),
}


def environment(folder: Path, pins: dict[str, str]) -> Path:
    """Make a virtual environment with the package; return its Python."""
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if not python.exists():
        venv.create(folder, with_pip=True)
    exact = [f"{name}=={pin}" if pin else name for name, pin in pins.items()]
    quiet = "-q", "--disable-pip-version-check", "--upgrade"
    install = [str(python), "-m", "pip", "install", *quiet]
    subprocess.run([*install, str(cli.ROOT), "pytest", *exact], check=True)
    return python


def versions(python: Path) -> dict[str, str]:
    """Return the versions that are installed."""
    code = (
        "from importlib.metadata import distributions as d\n"
        "for x in d(): print(x.name.lower(), x.version)"
    )
    done = subprocess.run([str(python), "-c", code], capture_output=True, text=True)
    installed = dict(line.split() for line in done.stdout.splitlines())
    return {name: installed.get(name, "") for name in PACKAGES}


def run_tests(python: Path, part: tuple[str, ...]) -> str:
    """Run the tests; return pytest's last line."""
    files = [str(next(cli.ROOT.glob(f"tests/**/test_{name}.py"))) for name in part]
    command = [str(python), "-m", "pytest", "-q", "-p", "no:cacheprovider", *files]
    done = subprocess.run(command, cwd=cli.ROOT, capture_output=True, text=True)
    lines = done.stdout.strip().splitlines() or [done.stderr.strip()]
    for line in lines:
        if line.startswith(("FAILED", "ERROR")):
            print(f"  {line}")
    return lines[-1]


def main(arguments: list[str] | None = None) -> int:
    """Try the environments one after the other."""
    parser = cli.parser(__doc__, "csv")
    parser.add_argument("--only", nargs="+", choices=ENVIRONMENTS, default=ENVIRONMENTS)
    parser.add_argument("--folder", type=Path)
    options = parser.parse_args(arguments)
    rows, good = [], True
    with tempfile.TemporaryDirectory() as temporary:
        for name in options.only:
            pins, part = ENVIRONMENTS[name]
            python = environment((options.folder or Path(temporary)) / name, pins)
            row = {"environment": name, "python": sys.version.split()[0]}
            row |= versions(python)
            print(", ".join(f"{key} {value}" for key, value in row.items()), flush=True)
            row["tests"] = run_tests(python, part)
            print(f"  {row['tests']}", flush=True)
            good &= "passed" in row["tests"] and "failed" not in row["tests"]
            good &= "error" not in row["tests"]
            rows.append(row)
    if options.csv:
        csv_files.write(options.csv, [], rows)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
