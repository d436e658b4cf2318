"""namlcp beside others: four scenes with OSQP, if installed; a QP by solvers named."""

import importlib.util
import time
import warnings
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

import namlcp
from namlcp.options import DEFAULT_OPTIONS
from namlcp.scenes import FallingDiscs, disc_pile, forced_obstacle, preview_control

TOLERANT = ("osqp", "piqp", "proxqp", "qpalm", "scs")
"""Solvers that take `eps_abs` and `eps_rel` by these names; others have their own."""


def demonstrate() -> int:
    """Solve the problems and print residuals and times; return 0 if all are solved."""
    with_osqp = importlib.util.find_spec("osqp") is not None
    print(
        f"namlcp {namlcp.__version__}: residuals recomputed on the problem's own data"
    )
    print("(times are those of the solver)\n")
    head = f"{'scene':<26}{'size':<28}{'residual':>9} {'time':>12}"
    print(head + (f"   {'OSQP':>8} {'time':>12}" if with_osqp else ""))
    solved = True
    for name, (A, q) in (
        ("membrane over obstacle", forced_obstacle(100)),
        ("pile of discs in contact", disc_pile(12)),
    ):
        result, seconds = best_time(partial(namlcp.solve_lcp, A, q))
        solved &= result.status is namlcp.Status.SOLVED
        size = f"n = {q.size}, {np.count_nonzero(result.z)} with z > 0"
        show(name, size, result.residual, seconds, *osqp_lcp(A, q) if with_osqp else ())
    solved &= show_falling(FallingDiscs(8), 80)
    problem = preview_control(30)
    answer, seconds = best_time(partial(qpsolvers.solve_problem, problem, solver="nam"))
    solved &= answer.found
    figures = [worst_residual(answer), seconds]
    if with_osqp:
        peer, seconds = best_time(partial(osqp, problem))
        figures += worst_residual(peer), seconds
    show("walking robot (MPC)", f"n = {problem.q.size}, m = {problem.h.size}", *figures)
    print(
        f'\nMPC, solver="nam": x[:4] = {answer.x[:4].round(6)}, '
        f"objective {answer.obj:.9g}"
    )
    print("all solved" if solved else "NOT all solved")
    return 0 if solved else 1


def best_time(solve: Callable[[], Any], repeats: int = 4) -> tuple[Any, float]:
    """Return the last result and the least time [s] of a few calls."""
    best = np.inf
    for _ in range(repeats):
        start = time.perf_counter()
        result = solve()
        best = min(best, time.perf_counter() - start)
    return result, best


def show_falling(discs: FallingDiscs, steps: int) -> bool:
    """Let discs fall with friction; print the worst step; tell if all are solved."""
    records = [discs.step() for _ in range(steps)]
    worst = max(record.residual for record in records)
    seconds = float(np.median([record.seconds for record in records]))
    size = f"n = {max(record.n for record in records)}, {steps} steps"
    show("discs fall, with friction", size, worst, seconds)
    return all(record.status is namlcp.Status.SOLVED for record in records)


def show(name: str, size: str, *figures: float) -> None:
    """Print one line: residual and time [s] of namlcp, and those of OSQP, if any."""
    cells = (
        f"{residual:9.1e} {1e3 * seconds:9.2f} ms"
        for residual, seconds in zip(figures[::2], figures[1::2], strict=True)
    )
    print(f"{name:<26}{size:<28}" + "  ".join(cells))


def osqp_lcp(A: Any, q: np.ndarray) -> tuple[float, float]:
    """Return natural residual and time [s] of OSQP on LCP(q, A)."""
    zero, infinite = np.zeros(q.size), np.full(q.size, np.inf)
    problem = qpsolvers.Problem(sp.csc_matrix(A), q, lb=zero)
    answer, seconds = best_time(partial(osqp, problem), 1)
    z = zero if answer.x is None else answer.x
    return namlcp.natural_residual(z, A @ z + q, zero, infinite), seconds


def osqp(problem: qpsolvers.Problem) -> qpsolvers.Solution:
    """Solve with OSQP at tight tolerances, polished."""
    settings = {"eps_abs": 1e-8, "eps_rel": 0.0, "max_iter": 100_000}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # OSQP's interface; dense matrices
        return qpsolvers.solve_problem(problem, "osqp", polishing=True, **settings)


def worst_residual(answer: qpsolvers.Solution) -> float:
    return max(answer.primal_residual(), answer.dual_residual(), answer.duality_gap())


def compare(
    problem: qpsolvers.Problem, rivals: list[str], settings: Mapping[str, Any]
) -> None:
    """Print residuals and times of namlcp and other solvers; raise for unknown ones."""
    unknown = [name for name in rivals if name not in qpsolvers.available_solvers]
    if unknown:
        known = ", ".join(qpsolvers.available_solvers)
        raise ValueError(f"{unknown[0]} is not installed; there are {known}")
    tolerances = {
        name: settings.get(name, getattr(DEFAULT_OPTIONS, name))
        for name in ("eps_abs", "eps_rel")
    }
    print("\nbest of 3, from the call through qpsolvers to the answer")
    print("solver     found  objective          primal    dual     gap        time")
    for name in ("nam", *rivals):
        given = tolerances if name in ("nam", *TOLERANT) else {}
        call = partial(qpsolvers.solve_problem, problem, name, **given)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of conversions, and of points not found
            answer, seconds = best_time(call, 3)
        if answer.x is None:
            print(f"{name:<10} no{1e3 * seconds:62.3f} ms")
            continue
        print(
            f"{name:<10} {'yes' if answer.found else 'no':<6} "
            f"{answer.obj:<16.9g} {answer.primal_residual():8.1e} "
            f"{answer.dual_residual():8.1e} {answer.duality_gap():8.1e} "
            f"{1e3 * seconds:9.3f} ms"
        )
