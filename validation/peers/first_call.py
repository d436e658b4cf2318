"""Solve one small problem in a fresh process and print how long the first call took.

Without PATH the names of all paths are printed: there is one for each way through the
solver; `validation.peers.lcp` runs them all. Printed are the seconds of the import
beyond that of qpsolvers, and those of the call.
"""

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

BEGIN = time.perf_counter()
import namlcp  # noqa: E402

IMPORT = time.perf_counter() - BEGIN
from namlcp.scenes import forced_obstacle  # noqa: E402  (needs scipy.spatial)

SPARSE = sp.diags_array([4.0, -1.0, -1.0], offsets=[0, 2, -2], shape=(200, 200))
TRIDIAGONAL = sp.diags_array([4.0, -1.0, -1.0], offsets=[0, 1, -1], shape=(200, 200))
DENSE = SPARSE.toarray()[:40, :40]
LOAD = np.tile([-3.0, 1.0, -2.0, 2.0], 50)
ROWS = np.ones((1, 40))


def lcp(A: Any, **options: Any) -> namlcp.LCPResult:
    """Solve an LCP with the matrix A."""
    return namlcp.solve_lcp(A, LOAD[: A.shape[0]], **options)


def qp(P: Any, **constraints: Any) -> qpsolvers.Solution:
    problem = qpsolvers.Problem(P, LOAD[: P.shape[0]], **constraints)
    return qpsolvers.solve_problem(problem, solver="nam")


PATHS: dict[str, Callable[[], Any]] = {
    "lcp-sparse": lambda: lcp(sp.csr_array(SPARSE)),
    "lcp-tridiagonal": lambda: lcp(sp.csr_array(TRIDIAGONAL)),
    "lcp-dense": lambda: lcp(DENSE),
    "lcp-nonsymmetric": lambda: lcp(DENSE + np.triu(np.full((40, 40), 0.01))),
    "lcp-multigrid": lambda: namlcp.solve_lcp(*forced_obstacle(110)),
    "lcp-namgs": lambda: lcp(sp.csr_array(SPARSE), method="namgs"),
    "qp-equalities": lambda: qp(DENSE, A=ROWS, b=np.ones(1)),
    "qp-bounds": lambda: qp(sp.csc_matrix(SPARSE), lb=np.zeros(200)),
    "qp-dense": lambda: qp(DENSE, G=ROWS, h=np.ones(1), lb=np.zeros(40)),
    "qp-sparse": lambda: qp(
        sp.csc_matrix(sp.diags_array(np.arange(200.0) // 100)),
        G=sp.csc_matrix(np.ones((1, 200))),
        h=np.ones(1),
        lb=np.zeros(200),
        ub=np.ones(200),
    ),
}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("path", nargs="?", choices=PATHS)
    path = parser.parse_args(arguments).path
    if path is None:
        print("\n".join(PATHS))
        return 0
    call = PATHS[path]
    start = time.perf_counter()
    call()
    seconds = time.perf_counter() - start
    print(IMPORT, seconds)
    return 0
