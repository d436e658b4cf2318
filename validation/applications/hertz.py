"""Hertz contact without a matrix on growing grids, beside Hertz's formulas.

--quick: 64^2 and 128^2 cells, nothing written.
"""

import sys
import time

import numpy as np
from scipy.sparse.linalg import LinearOperator

from namlcp import solve_lcp
from validation.harness import cli, csv_files
from validation.problems import hertz

SIZES = (64, 128, 256, 512, 1024)  # cells along a side


def main(arguments: list[str] | None = None) -> int:
    """Solve on growing grids at the default tolerance, print and write the table."""
    args = cli.parser(__doc__, "quick", "results").parse_args(arguments)
    header, rows = cli.begin(["nam"]), []
    for cells in SIZES[:2] if args.quick else SIZES:
        problem = hertz.hertz(cells)
        count = [0]

        def product(p: np.ndarray, problem=problem, count=count) -> np.ndarray:
            count[0] += 1
            return problem.A.matvec(p)

        A = LinearOperator(problem.A.shape, matvec=product, dtype=np.float64)
        start = time.perf_counter()
        result = solve_lcp(A, problem.q, diagonal=problem.diagonal)
        seconds = time.perf_counter() - start
        row = {
            "cells": cells,
            "n": cells * cells,
            "status": result.status.value,
            "iterations": result.iterations,
            "products": count[0],
            "seconds": f"{seconds:.3g}",
            "residual": f"{result.residual:.1e}",
        }
        row |= {k: f"{v:.1e}" for k, v in hertz.measured(problem, result.z).items()}
        rows.append(row)
        print(row, flush=True)
    if not args.quick:
        csv_files.write(args.results / "hertz.csv", header, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
