"""Tables 1 and 2 of the paper, checked, and the rows that the paper does not have.

paper-tables
    The 48 printed runs (delta = 4), iterations and Res beside the
    printed ones. Times are of whole calls of `solve_lcp` with a sparse matrix.
paper-large
    Sizes that the paper does not have, up to n = 10^6, beside a plain
    transcription of the matrix formula.

The paper does not say what Omega is; with Omega =
D/(2 alpha^2) all printed counts come out.
"""

import itertools
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from namlcp import LCPResult, solve_lcp
from validation.harness import Row, timing
from validation.harness.suite import Parts
from validation.problems import sweep_scenes
from validation.problems.known_scenes import BoxLCP

EPS = 1e-5  # Res at which a run ends

SIZES = (10, 30, 50, 60, 80, 100)

PRINTED = """
1 mgs    -    | 36 40 41 41 42 42 | 97 80 79 89 74 84 | .0039 .0293 .2699 .6400 2.0785 4.5712
1 namgs  -    | 16 17 17 17 18 18 | 63 63 85 95 45 51 | .0024 .0146 .1089 .2688 .8179 2.0175
1 msor   0.85 | 15 17 18 18 18 19 | 95 76 53 65 89 43 | .0034 .0141 .1201 .2903 .7826 2.0791
1 namsor 0.91 | 12 12 13 13 13 13 | 27 76 32 37 48 59 | .0028 .0116 .0905 .2017 .6467 2.1918
2 mgs    -    | 24 26 26 26 27 27 | 90 65 87 96 65 73 | .0034 .0208 .1707 .3961 1.1542 2.9471
2 namgs  -    | 12 12 13 13 13 13 | 38 84 31 35 44 53 | .0026 .0141 .0837 .1998 .2987 1.4461
2 msor   0.88 | 14 14 15 15 15 15 | 38 82 41 46 55 63 | .0029 .0123 .1040 .2505 .6543 1.6363
2 namsor 0.88 |  8  9  9  9  9  9 | 22 15 27 37 46 59 | .0022 .0096 .0655 .1409 .0441 1.7340
"""  # noqa: E501
"""example, method, alpha | IT | Res in units of 1e-7 | CPU [s]; misprints included."""

Key = tuple[int, str, float | None]
TABLES: dict[Key, tuple[tuple[float, ...], ...]] = {}
for line in PRINTED.strip().splitlines():
    key, counts, *columns = line.split("|")
    example, method, alpha = key.split()
    entries = [tuple(map(float, column.split())) for column in columns]
    name = int(example), method, None if alpha == "-" else float(alpha)
    TABLES[name] = (tuple(map(int, counts.split())), *entries)

HELD_OUT = (20, 70, 120, 316, 1000)  # m


def solve(scene: BoxLCP, m: int, method: str, max_iter: int, **given: Any) -> LCPResult:
    given |= {"s0": sweep_scenes.paper_start(m), "eps_abs": EPS, "max_iter": max_iter}
    return solve_lcp(scene.A, scene.q, method=method, **given)


def printed_run(key: Key, m: int) -> Callable[[], LCPResult]:
    example, method, alpha = key
    given: Row = {} if alpha is None else {"alpha": alpha}
    if method.startswith("nam"):
        given["shift"] = 1.0
    scene = sweep_scenes.paper_example(example, m)
    return partial(solve, scene, m, method, 100, **given)


def table_rows() -> Iterator[Row]:
    for key, printed in TABLES.items():
        example, method, alpha = key
        for m, count, digits, cpu in zip(SIZES, *printed, strict=True):
            result, _, seconds = timing.median_time(printed_run(key, m))
            close = f"{result.residual:.1e}" == f"{digits / 1e7:.1e}"
            row: Row = {"example": example, "method": method, "alpha": alpha or 1.0}
            row |= {"n": m * m, "iterations": result.iterations}
            row |= {"residual": result.residual, "time": seconds}
            row |= {"printed_iterations": count, "printed_residual": digits / 1e7}
            row |= {"printed_time": cpu, "count_agrees": result.iterations == count}
            yield row | {"residual_agrees": close}


def large_rows() -> Iterator[Row]:
    cases = itertools.product((1, 2), ((4.0, 0.5), (1.0, 0.8)), HELD_OUT)
    for example, (delta, c), m in cases:
        scene = sweep_scenes.paper_example(example, m, delta)
        omega = c * scene.A.diagonal()
        start = time.perf_counter()
        result = solve(scene, m, "namgs", 1000, omega=omega, shift=1.0)
        seconds = time.perf_counter() - start
        count, residual = transcription(scene, m, omega)
        error = np.max(np.abs(result.z - sweep_scenes.paper_solution(m)))
        row: Row = {"example": example, "delta": delta, "Omega": f"{c:g} D"}
        row |= {"n": m * m, "iterations": result.iterations, "transcription": count}
        row |= {"residual": result.residual, "transcription_residual": residual}
        yield row | {"error": float(error), "time": seconds}


def transcription(scene: BoxLCP, m: int, omega: np.ndarray) -> tuple[int, float]:
    """Return count and Res of NAMGS written down as the paper does, r = 2.

    (D - 2L + Omega + I) s+ = (U + I - L) s + (Omega - A)|s| - 2 q
    """
    A, q, s = scene.A, scene.q, sweep_scenes.paper_start(m)
    D = sp.csr_array(sp.diags_array(A.diagonal()))
    L, U = sp.csr_array(-sp.tril(A, -1)), sp.csr_array(-sp.triu(A, 1))
    Omega, eye = sp.diags_array(omega), sp.eye_array(q.size)
    left = splu(sp.csc_array(D - 2 * L + eye + Omega), permc_spec="NATURAL")
    N, B = sp.csr_array(U + eye - L), sp.csr_array(Omega - A)
    for count in itertools.count():
        z = 0.5 * (np.abs(s) + s)
        residual = float(np.linalg.norm(np.minimum(z, A @ z + q)))
        if residual < EPS or count == 1000:
            break
        s = left.solve(N @ s + B @ np.abs(s) - 2.0 * q)
    return count, residual


SUITE = Parts(__doc__, {"paper-tables": table_rows, "paper-large": large_rows})
