"""Solve a problem file, or tell what is installed."""

import argparse
import json
import os
import platform
import sys
import time
import warnings
from collections.abc import Mapping
from dataclasses import fields
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers
from qpsolvers.exceptions import QPError, SolverError

import namlcp
from namlcp.files import read_problem
from namlcp.options import DEFAULT_OPTIONS, RELAXATIONS, Options

FILES = """FILE: a QP as qpsolvers' Problem.save writes it (.npz), or in MPS or QPS
(.mps, .qps, .gz); an LCP as .npz of A, q and, if there are bounds, lower and upper.
Exit status: 0 solved, 1 not solved, 2 wrong file or option."""
PACKAGES = """numpy scipy pyamg qpsolvers cvxpy torch jax cvxpylayers joblib dask
pymetis matplotlib osqp piqp daqp clarabel highspy""".split()

TOLERANT = ("osqp", "piqp", "proxqp", "qpalm", "scs")
"""Solvers that take `eps_abs` and `eps_rel` by these names; others have their own."""


def solve_file(path: str, args: dict[str, Any]) -> int:
    """Solve the problem in a file and print the outcome; return the exit status."""
    rivals, as_json, output = (args.pop(k) for k in ("compare", "json", "output"))
    settings = {name: value for name, value in args.items() if value is not None}
    try:
        problem = read_problem(path)
    except Exception as error:  # a hostile file may provoke any
        reason = str(error) or type(error).__name__
        print(f"cannot read {path}: {reason}", file=sys.stderr)
        return 2
    is_qp = isinstance(problem, qpsolvers.Problem)
    try:
        if rivals and not is_qp:
            raise ValueError("--compare is for QPs")
        if is_qp:
            result: Any = namlcp.solve_qp(*problem.unpack(), **settings)
        else:
            result = namlcp.solve_lcp(*problem, **settings)
        if as_json:
            print(json.dumps(record_of(result)))
        else:
            print(f"{result}\n{result.status.explanation}")
        if output is not None:
            arrays: Any = arrays_of(result)
            np.savez(output, **arrays, status=result.status.value)
        if rivals:
            compare(problem, rivals.split(","), settings)
    except (TypeError, ValueError, OSError, QPError) as error:
        print(f"{path}: {error}", file=sys.stderr)
        return 2
    return 0 if result.status is namlcp.Status.SOLVED else 1


def arrays_of(result: Any) -> dict[str, np.ndarray]:
    names = ("x", "y", "z", "z_box") if hasattr(result, "x") else ("z", "w", "ray")
    found = {name: getattr(result, name) for name in names}
    closest = getattr(result, "closest", None)
    if closest is not None:
        found["closest"] = closest.x
    return {name: array for name, array in found.items() if array is not None}


def record_of(result: Any) -> dict[str, Any]:
    """Return a result as an object of JSON; null stands for what is not finite."""
    is_qp = hasattr(result, "x")
    record = {
        "status": result.status.value,
        "message": result.message or result.status.explanation,
        "method": result.form if is_qp else result.method,
        "iterations": result.iterations,
        "setup_time": result.setup_time,
        "solve_time": result.solve_time,
    }
    if is_qp:
        record |= result.residuals._asdict() | {"objective": result.obj}
    else:
        record["residual"] = result.residual
    record |= arrays_of(result)
    for name, value in record.items():  # JSON has finite numbers alone
        if not isinstance(value, str):
            record[name] = np.where(np.isfinite(value), value, np.array(None)).tolist()
    return record


def compare(
    problem: qpsolvers.Problem, rivals: list[str], settings: Mapping[str, Any]
) -> None:
    """Print residuals and times of namlcp and other solvers."""
    tolerances = {
        name: settings.get(name, getattr(DEFAULT_OPTIONS, name))
        for name in ("eps_abs", "eps_rel")
    }
    print("\nbest of 3, from the call through qpsolvers to the answer")
    print("solver     found  objective          primal    dual     gap        time")
    for name in ("nam", *rivals):
        given = tolerances if name in ("nam", *TOLERANT) else {}
        seconds = np.inf
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of conversions, and of points not found
            for _ in range(3):
                start = time.perf_counter()
                try:
                    answer = qpsolvers.solve_problem(problem, name, **given)
                except QPError:
                    raise
                except Exception as error:  # of any kind, as bad bounds of OSQP
                    raise SolverError(f"{name} failed: {error!r}") from error
                seconds = min(seconds, time.perf_counter() - start)
        if answer.x is None:
            print(f"{name:<10} no{1e3 * seconds:62.3f} ms")
            continue
        objective = answer.x @ (0.5 * (problem.P @ answer.x) + problem.q)
        print(
            f"{name:<10} {'yes' if answer.found else 'no':<6} "
            f"{objective:<16.9g} {answer.primal_residual():8.1e} "
            f"{answer.dual_residual():8.1e} {answer.duality_gap():8.1e} "
            f"{1e3 * seconds:9.3f} ms"
        )


def show_info() -> int:
    blas = np.show_config(mode="dicts")["Build Dependencies"]["blas"]  # type: ignore
    print(f"namlcp {namlcp.__version__}, {Path(namlcp.__file__).parent}")
    print(f"Python {platform.python_version()} on {platform.platform()}")
    print(f"{os.cpu_count()} cores, BLAS: {blas['name']} {blas.get('version', '')}")
    for package in PACKAGES:
        try:
            print(f"  {package} {version(package)}")
        except PackageNotFoundError:
            print(f"  {package} is not installed")
    return 0


def add_options(parser: argparse.ArgumentParser) -> None:
    for field in fields(Options):
        name = f"--{field.name.replace('_', '-')}"
        if isinstance(field.default, bool):
            parser.add_argument(name, action="store_true", default=None)
        elif isinstance(field.default, str):
            parser.add_argument(name, choices=[*RELAXATIONS])
        else:
            kind = type(field.default)
            parser.add_argument(name, type=kind, metavar=kind.__name__.upper())


def parser_of_arguments() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="namlcp", description=__doc__)
    title = f"namlcp {namlcp.__version__}"
    parser.add_argument("--version", action="version", version=title)
    parser.add_argument("--warmup", action="store_true", help=argparse.SUPPRESS)
    commands = parser.add_subparsers(dest="command", metavar="solve | info")
    solve = commands.add_parser("solve", help="solve a problem file", epilog=FILES)
    solve.add_argument("file", metavar="FILE")
    add_options(solve)
    solve.add_argument("--method", help="of an LCP, as for solve_lcp")
    solve.add_argument("--json", action="store_true", help="print one JSON object")
    solve.add_argument("--output", metavar="FILE.npz", help="save the arrays")
    solve.add_argument("--compare", metavar="NAMES", help="e.g. osqp,piqp")
    commands.add_parser("info", help="versions and machine")
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = parser_of_arguments()
    args = vars(parser.parse_args(arguments))
    command, is_warmup = args.pop("command"), args.pop("warmup")
    if is_warmup:  # of earlier versions, for one release
        print("--warmup does nothing: nothing is compiled later", file=sys.stderr)
        return 0
    if command is None:
        parser.print_help()
        return 0
    if command == "info":
        return show_info()
    return solve_file(args.pop("file"), args)


if __name__ == "__main__":
    sys.exit(main())
