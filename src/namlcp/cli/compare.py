"""A QP by namlcp and by other solvers of qpsolvers: residuals and times."""

import time
import warnings
from collections.abc import Mapping
from typing import Any

import numpy as np
import qpsolvers

from namlcp.options import DEFAULT_OPTIONS

TOLERANT = ("osqp", "piqp", "proxqp", "qpalm", "scs")
"""Solvers that take `eps_abs` and `eps_rel` by these names; others have their own."""


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
        seconds = np.inf
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of conversions, and of points not found
            for _ in range(3):
                start = time.perf_counter()
                answer = qpsolvers.solve_problem(problem, name, **given)
                seconds = min(seconds, time.perf_counter() - start)
        if answer.x is None:
            print(f"{name:<10} no{1e3 * seconds:62.3f} ms")
            continue
        print(
            f"{name:<10} {'yes' if answer.found else 'no':<6} "
            f"{answer.obj:<16.9g} {answer.primal_residual():8.1e} "
            f"{answer.dual_residual():8.1e} {answer.duality_gap():8.1e} "
            f"{1e3 * seconds:9.3f} ms"
        )
