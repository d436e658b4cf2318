"""LCPs: contact scenes beside PIQP, a million unknowns beside OSQP, first calls.

contact
    `solve_lcp` at default settings and PIQP (through qpsolvers, 1e-9) on the contact
    scenes. Relative residual: || min(z, Az + q) ||_2 / || min(q, 0) ||_2 of the LCP
    scaled to unit diagonal.
example1
    The five-point matrix + 4 I, n = 10^6, z* = (1, 2, 1, 2, ...), by method="auto" to
    Res < 1e-10 and by OSQP to 1e-8 with polishing: time, || min(z, Az + q) ||_2 and
    peak memory above what was there before, in units of the memory of A.
first-call
    A fresh process that imports the package and solves one small problem.
"""

import subprocess
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp

from validation.harness import Job, Row, cli, judging, qp_solvers, timing
from validation.harness.suite import Args, Suite
from validation.problems import data_sets, sweep_scenes

RUNS = 3
REPEATS = {"nam": 5, "osqp": 1}  # of Example 1
FIRST_CALL = "peers.first_call"


def contact(job: Job, name: str) -> Row:
    import namlcp

    A, q = data_sets.contact_lcp(job.data, name)
    problem = data_sets.load(job.data, "contact", name)
    settings = qp_solvers.settings("piqp", 1e-9, 10.0) | {"solver": "piqp"}

    def call() -> Any:
        if job.solver == "nam":
            return namlcp.solve_lcp(A, q)
        return qpsolvers.solve_problem(problem, **settings)

    call()
    job.ready()
    answer, _, runtime = timing.median_time(call)
    ours = job.solver == "nam"
    z = answer.z if ours else answer.x
    return {
        "n": q.size,
        "runtime": runtime,
        "relative_residual": judging.relative_residual(A, q, z),
        "status": answer.status.value if ours else answer.found,
    }


def contacts(args: Args) -> Iterator[Row]:
    names = data_sets.set_names(args.data, "contact")
    yield from ({"scene": name} for name in names[:: 4 if args.quick else 1])


def nam_call(A: sp.csr_array, q: np.ndarray) -> Callable[[], np.ndarray]:
    import namlcp

    return lambda: namlcp.solve_lcp(A, q, method="auto", eps_abs=1e-10).z


def osqp_call(A: sp.csr_array, q: np.ndarray) -> Callable[[], np.ndarray]:
    """Return the same for OSQP: min 1/2 z'Az + q'z, z >= 0.

    Its duality gap, a sum of terms of 10^7, is not tested: rounding alone is 1e-8.
    """
    import osqp

    P, eye = sp.csc_matrix(sp.triu(A)), sp.eye(q.size, format="csc")
    options = qp_solvers.settings("osqp", 1e-8, 600.0) | {"check_dualgap": False}

    def call() -> np.ndarray:
        solver = osqp.OSQP()
        bounds = {"l": np.zeros(q.size), "u": np.full(q.size, np.inf)}
        solver.setup(P=P, q=q, A=eye, **bounds, verbose=False, **options)
        return solver.solve().x

    return call


def example1(job: Job) -> Row:
    make = nam_call if job.solver == "nam" else osqp_call
    small, scene = (sweep_scenes.paper_example(1, m) for m in (10, 1000))
    make(small.A, small.q)()
    A, q = scene.A, scene.q
    call = make(A, q)
    before = timing.resident_memory(reset_peak=True)
    times = []
    job.ready()
    for _ in range(REPEATS[job.solver]):
        start = time.perf_counter()
        z = call()
        times.append(time.perf_counter() - start)
        if len(times) == 1:
            memory = timing.resident_memory() - before
    own = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
    return {
        "runtime": float(np.median(times)),
        "residual": float(np.linalg.norm(np.minimum(z, A @ z + q))),
        "memory": memory / own,
    }


def run_script(*command: str) -> str:
    return subprocess.run(
        cli.script(*command),
        cwd=cli.ROOT,
        capture_output=True,
        text=True,
        check=True,
    ).stdout


def fresh_process(_: Job, path: str) -> Row:
    """Return the times of a process, of import and solve in it, the best of RUNS."""
    runs = []
    for _ in range(RUNS):
        start = time.perf_counter()
        printed = run_script(FIRST_CALL, path)
        seconds = [time.perf_counter() - start, *map(float, printed.split())]
        runs.append(dict(zip(("process", "import", "solve"), seconds, strict=True)))
    return min(runs, key=lambda times: times["solve"])


SUITES = {
    "contact": Suite(
        name="contact",
        doc=__doc__,
        requests=contacts,
        work=contact,
        columns="scene n solver runtime relative_residual status",
        keys="scene solver",
        solvers=("nam", "piqp"),
        needs_data=True,
    ),
    "example1": Suite(
        name="example1",
        doc=__doc__,
        requests=lambda args: [{}],
        work=example1,
        columns="solver runtime residual memory",
        keys="solver",
        solvers=tuple(REPEATS),
        limit=600.0,
    ),
    "first-call": Suite(
        name="first-call",
        doc=__doc__,
        requests=lambda args: ({"path": p} for p in run_script(FIRST_CALL).split()),
        work=fresh_process,
        columns="path process import solve",
        keys="path",
    ),
}
