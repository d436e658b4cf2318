"""Hertz contact without a matrix on growing grids, beside Hertz's formulas."""

import time
from collections.abc import Iterator

import numpy as np
from scipy.sparse.linalg import LinearOperator

from namlcp import solve_lcp
from validation.harness import Job, Row
from validation.harness.suite import Args, Suite
from validation.problems import hertz

SIZES = (64, 128, 256, 512, 1024)  # cells along a side


def work(_: Job, cells: int) -> Row:
    problem, products = hertz.hertz(cells), 0

    def product(p: np.ndarray) -> np.ndarray:
        nonlocal products
        products += 1
        return problem.A.matvec(p)

    A = LinearOperator(problem.A.shape, matvec=product, dtype=np.float64)
    start = time.perf_counter()
    result = solve_lcp(A, problem.q, diagonal=problem.diagonal)
    seconds = time.perf_counter() - start
    row = {
        "n": cells * cells,
        "status": result.status.value,
        "iterations": result.iterations,
        "products": products,
        "seconds": f"{seconds:.3g}",
        "residual": f"{result.residual:.1e}",
    }
    errors = hertz.measured(problem, result.z)
    return row | {name: f"{error:.1e}" for name, error in errors.items()}


def requests(args: Args) -> Iterator[Row]:
    yield from ({"cells": cells} for cells in SIZES[: 2 if args.quick else None])


SUITE = Suite(
    name="hertz",
    doc=__doc__,
    requests=requests,
    work=work,
    columns=(
        "cells n status iterations products seconds residual radius_error force_error "
        "pressure_error"
    ),
    keys="cells",
)
