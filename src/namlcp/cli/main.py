"""Solve the problem in FILE or run an EXAMPLE; without both show a demonstration.

EXAMPLE is mpc, frontier, lasso or discs; ``--picture FILE`` draws it (matplotlib).

FILE is a qpsolvers ``.npz`` (Problem.save) or a Maros-Meszaros ``.mat`` (P, q, A, l, u,
the last n rows of A being the bounds; 1e20 means none).
"""

import argparse
import sys
from typing import Any

import qpsolvers

import namlcp
from namlcp.cli.demonstration import demonstrate
from namlcp.cli.examples import EXAMPLES, show_example
from namlcp.cli.files import mat_problem, npz_problem


def solve_file(path: str, settings: dict[str, Any]) -> int:
    """Solve the problem in a file and print the outcome; return the exit status.

    That is 0 if solved, 1 if not, 2 if the file or an option is wrong.
    """
    try:
        problem = mat_problem(path) if path.endswith(".mat") else npz_problem(path)
    except Exception as error:  # a hostile file may provoke any
        reason = str(error) or type(error).__name__
        print(f"cannot read {path}: {reason}", file=sys.stderr)
        return 2
    try:
        answer = qpsolvers.solve_problem(problem, solver="nam", **settings)
    except qpsolvers.exceptions.QPError as error:
        print(f"{path}: {error}", file=sys.stderr)
        return 2
    extras, residuals = answer.extras, answer.extras["residuals"]
    print(f"status     {extras['status']}: {extras['message']}")
    print(f"form       {extras['form']}, {extras['iterations']} iterations")
    print(f"objective  {answer.obj:.12g}")
    print(
        f"primal residual {residuals.primal:.1e}  dual residual {residuals.dual:.1e}  "
        f"duality gap {residuals.gap:.1e}"
    )
    print(f"time       {answer.build_time + answer.solve_time:.3g} s")
    return 0 if answer.found else 1


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m namlcp", description=__doc__)
    version = f"namlcp {namlcp.__version__}"
    parser.add_argument("--version", action="version", version=version)
    parser.add_argument("file", nargs="?", help="a .npz or .mat problem, or an example")
    parser.add_argument("--eps-abs", type=float, help="absolute tolerance")
    parser.add_argument("--time-limit", type=float, help="limit [s]")
    parser.add_argument("--verbose", action="store_true", help="print the progress")
    parser.add_argument("--warmup", action="store_true", help="does nothing")
    parser.add_argument("--picture", help="draw an example into this file")
    given = vars(parser.parse_args(arguments))
    path, warmup = given.pop("file"), given.pop("warmup")
    picture = given.pop("picture")
    if path in EXAMPLES:
        return show_example(path, picture)
    if picture is not None:
        parser.error(f"--picture is for an example: {', '.join(EXAMPLES)}")
    if warmup:
        if path is not None:
            parser.error(f"--warmup is for no file, got {path}")
        print("nothing to do: namlcp is compiled when it is installed")
        return 0
    if path is None:
        return demonstrate()
    return solve_file(path, {k: v for k, v in given.items() if v is not None})
