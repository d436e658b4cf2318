"""The command line: ``python -m namlcp`` shows real scenes, with FILE solves one.

With ``--warmup`` all machine code is compiled, for containers.

FILE is a qpsolvers ``.npz`` (Problem.save) or a Maros-Meszaros ``.mat`` (P, q, A, l, u,
the last n rows of A being the bounds; 1e20 means none).
"""

import argparse
import importlib.util
import sys
import time
import warnings
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

import namlcp
from namlcp.checks import INFINITE
from namlcp.cli.files import read_mat, read_npz
from namlcp.compiled import compile_time
from namlcp.scenes import disc_pile, forced_obstacle, preview_control


def npz_problem(path: str) -> qpsolvers.Problem:
    """Read what qpsolvers.Problem.save wrote."""
    return qpsolvers.Problem(**read_npz(path))


def mat_problem(path: str) -> qpsolvers.Problem:
    """Read a Maros-Meszaros problem, l <= A x <= u with the bounds as its last rows."""
    data = read_mat(path)
    P, C = sp.csc_matrix(data["P"]), sp.csr_matrix(data["A"])
    q, low, high = data["q"], data["l"], data["u"]
    m = C.shape[0] - q.size
    if m < 0 or low.size != C.shape[0] or high.size != C.shape[0]:
        raise ValueError(
            "A, l, u must have as many rows, at least one for each entry of "
            f"q, got {C.shape[0]}, {low.size}, {high.size} for {q.size}"
        )
    low[low <= -INFINITE], high[high >= INFINITE] = -np.inf, np.inf
    C, (lb, ub), low, high = C[:m], (low[m:], high[m:]), low[:m], high[:m]
    equal = low == high
    above, below = ~equal & np.isfinite(high), ~equal & np.isfinite(low)
    G = sp.vstack([C[above], -C[below]], format="csc")
    h = np.concatenate((high[above], -low[below]))
    A, b = sp.csc_matrix(C[equal]), high[equal]
    return qpsolvers.Problem(
        P,
        q,
        *((G, h) if h.size else (None, None)),
        *((A, b) if b.size else (None, None)),
        lb,
        ub,
    )


def solve_file(path: str, settings: dict[str, Any]) -> int:
    """Solve the problem in a file and print the outcome; 0 if solved."""
    try:
        problem = mat_problem(path) if path.endswith(".mat") else npz_problem(path)
    except Exception as error:  # whatever a hostile file provokes in its reader
        reason = str(error) or type(error).__name__
        print(f"cannot read {path}: {reason}", file=sys.stderr)
        return 2
    before = compile_time()
    try:
        answer = qpsolvers.solve_problem(problem, solver="nam", **settings)
    except qpsolvers.exceptions.QPError as error:
        print(f"{path}: {error}", file=sys.stderr)
        return 2
    compiling = compile_time() - before
    residuals = answer.extras["residuals"]
    print(f"status     {answer.extras['status']}: {answer.extras['message']}")
    print(
        f"form       {answer.extras['form']}, {answer.extras['iterations']} iterations"
    )
    print(f"objective  {answer.obj:.12g}")
    print(
        f"primal residual {residuals.primal:.1e}  dual residual {residuals.dual:.1e}  "
        f"duality gap {residuals.gap:.1e}"
    )
    print(f"time       {answer.build_time + answer.solve_time - compiling:.3g} s")
    if compiling:
        print(f"compiling  {compiling:.3g} s, once on this machine")
    return 0 if answer.found else 1


def best_time(solve: Callable[[], Any], repeats: int = 3) -> tuple[Any, float]:
    """Return the last result and the least time [s] of a few calls."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        result = solve()
        best = min(best, time.perf_counter() - start)
    return result, best


def osqp_lcp(A: Any, q: np.ndarray) -> tuple[float, float] | None:
    """Return (natural residual, time [s]) of OSQP on an LCP, None if not installed."""
    if importlib.util.find_spec("osqp") is None:
        return None
    problem = qpsolvers.Problem(sp.csc_matrix(A), q, lb=np.zeros(q.size))
    answer, seconds = best_time(lambda: osqp(problem), 1)
    z = np.zeros(q.size) if answer.x is None else answer.x
    n = q.size
    zero, infinite = np.zeros(n), np.full(n, np.inf)
    return namlcp.natural_residual(z, A @ z + q, zero, infinite), seconds


def osqp(problem: qpsolvers.Problem) -> qpsolvers.Solution:
    """Solve with OSQP at tight tolerances, polished."""
    P, q, G, h, A, b, lb, ub = problem.unpack()
    P, G, A = (None if C is None else sp.csc_matrix(C) for C in (P, G, A))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the peer's, about its own interface
        return qpsolvers.solve_problem(
            qpsolvers.Problem(P, q, G, h, A, b, lb, ub),
            solver="osqp",
            eps_abs=1e-8,
            eps_rel=0.0,
            polishing=True,
            max_iter=100_000,
        )


def show(
    name: str,
    size: str,
    residual: float,
    seconds: float,
    other: tuple[float, float] | None,
) -> None:
    """Print one line of the demonstration."""
    line = f"{name:<26}{size:<28}{residual:9.1e} {seconds * 1e3:9.2f} ms"
    if other is not None:
        line += f"   {other[0]:8.1e} {other[1] * 1e3:9.2f} ms"
    print(line)


def demonstrate() -> int:
    """Solve three scenes, print residuals and times beside OSQP's if installed."""
    with_osqp = importlib.util.find_spec("osqp") is not None
    print(
        f"namlcp {namlcp.__version__}: residuals recomputed on the problem's own data"
    )
    print("(times are those of the solver, without what is compiled once)\n")
    head = f"{'scene':<26}{'size':<28}{'residual':>9} {'time':>12}"
    print(head + (f"   {'OSQP':>8} {'time':>12}" if with_osqp else ""))
    solved = True
    for name, scene in (
        ("membrane over obstacle", forced_obstacle(100)),
        ("pile of discs in contact", disc_pile(12)),
    ):
        A, q = scene
        namlcp.solve_lcp(A, q)
        result, seconds = best_time(partial(namlcp.solve_lcp, A, q))
        solved &= result.status is namlcp.Status.SOLVED
        size = f"n = {q.size}, {np.count_nonzero(result.z)} with z > 0"
        show(name, size, result.residual, seconds, osqp_lcp(A, q))
    problem = preview_control(30)
    answer = qpsolvers.solve_problem(problem, solver="nam")
    answer, seconds = best_time(lambda: qpsolvers.solve_problem(problem, solver="nam"))
    solved &= answer.found
    other = None
    if with_osqp:
        peer, peer_seconds = best_time(lambda: osqp(problem))
        other = worst_residual(peer), peer_seconds
    size = f"n = {problem.q.size}, m = {problem.h.size}"
    show("walking robot (MPC)", size, worst_residual(answer), seconds, other)
    print(
        f'\nMPC, solver="nam": x[:4] = {answer.x[:4].round(6)}, '
        f"objective {answer.obj:.9g}"
    )
    if compile_time():
        print(f"compiled for {compile_time():.1f} s, once on this machine")
    print("all solved" if solved else "NOT all solved")
    return 0 if solved else 1


def worst_residual(answer: qpsolvers.Solution) -> float:
    """Return the largest of the host's three residuals."""
    return max(answer.primal_residual(), answer.dual_residual(), answer.duality_gap())


def main(arguments: list[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    parser = argparse.ArgumentParser(prog="python -m namlcp", description=__doc__)
    parser.add_argument("file", nargs="?", help="a .npz or .mat problem")
    parser.add_argument("--eps-abs", type=float, help="absolute tolerance")
    parser.add_argument("--time-limit", type=float, help="limit [s]")
    parser.add_argument("--verbose", action="store_true", help="print the progress")
    parser.add_argument("--warmup", action="store_true", help="compile all there is")
    options = parser.parse_args(arguments)
    if options.warmup:
        if options.file is not None:
            parser.error(f"--warmup is for no file, got {options.file}")
        namlcp.warmup()
        return 0
    if options.file is None:
        return demonstrate()
    settings = {
        name: value
        for name in ("eps_abs", "time_limit", "verbose")
        if (value := getattr(options, name)) is not None
    }
    return solve_file(options.file, settings)
