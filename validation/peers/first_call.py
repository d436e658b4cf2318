"""Fresh processes that import the package and solve one small problem: the first call.

There is a path for each way through the solver. `import` are the seconds of the import
beyond that of qpsolvers, `solve` those of the call; of RUNS the quickest.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

from validation.harness import Job, Row, cli
from validation.harness.suite import Suite

RUNS = 3
SPARSE = sp.diags_array([4.0, -1.0, -1.0], offsets=[0, 2, -2], shape=(200, 200))
TRIDIAGONAL = sp.diags_array([4.0, -1.0, -1.0], offsets=[0, 1, -1], shape=(200, 200))
DENSE = SPARSE.toarray()[:40, :40]
STEPS = sp.diags_array(np.arange(200.0) // 100)
LOAD = np.tile([-3.0, 1.0, -2.0, 2.0], 50)
ROW, LONG_ROW, ONE = np.ones((1, 40)), sp.csc_matrix(np.ones((1, 200))), np.ones(1)


def lcp(A: Any, **options: Any) -> Any:
    import namlcp

    return namlcp.solve_lcp(A, LOAD[: A.shape[0]], **options)


def obstacle() -> Any:
    import namlcp
    from validation.problems.known_scenes import forced_obstacle

    return namlcp.solve_lcp(*forced_obstacle(110))


def qp(P: Any, **constraints: Any) -> qpsolvers.Solution:
    problem = qpsolvers.Problem(P, LOAD[: P.shape[0]], **constraints)
    return qpsolvers.solve_problem(problem, solver="nam")


PATHS: dict[str, Callable[[], Any]] = {
    "lcp-sparse": lambda: lcp(sp.csr_array(SPARSE)),
    "lcp-tridiagonal": lambda: lcp(sp.csr_array(TRIDIAGONAL)),
    "lcp-dense": lambda: lcp(DENSE),
    "lcp-nonsymmetric": lambda: lcp(DENSE + np.triu(np.full((40, 40), 0.01))),
    "lcp-multigrid": obstacle,
    "lcp-namgs": lambda: lcp(sp.csr_array(SPARSE), method="namgs"),
    "qp-equalities": lambda: qp(DENSE, A=ROW, b=ONE),
    "qp-bounds": lambda: qp(sp.csc_matrix(SPARSE), lb=np.zeros(200)),
    "qp-dense": lambda: qp(DENSE, G=ROW, h=ONE, lb=np.zeros(40)),
    "qp-sparse": lambda: qp(
        sp.csc_matrix(STEPS), G=LONG_ROW, h=ONE, lb=np.zeros(200), ub=np.ones(200)
    ),
}


def timed(path: str) -> None:
    start = time.perf_counter()
    import namlcp  # noqa: F401

    middle = time.perf_counter()
    PATHS[path]()
    print(middle - start, time.perf_counter() - middle)


def work(_: Job, path: str) -> Row:
    code = f"from validation.peers import first_call; first_call.timed({path!r})"
    runs = []
    for _ in range(RUNS):
        command = [sys.executable, "-c", code]
        printed = subprocess.check_output(command, cwd=cli.ROOT, text=True)
        seconds = map(float, printed.split())
        runs.append(dict(zip(("import", "solve"), seconds, strict=True)))
    return min(runs, key=lambda times: times["solve"])


SUITE = Suite(
    name="first-call", requests=lambda args: ({"path": path} for path in PATHS),
    work=work, columns="path | import solve",
)  # fmt: skip
