"""LCPs: contact scenes beside PIQP, a million unknowns beside OSQP, and no matrix.

contact
    `solve_lcp` at default settings and PIQP (through qpsolvers, 1e-9) on the contact
    scenes. Relative residual: || min(z, Az + q) ||_2 / || min(q, 0) ||_2 of the LCP
    scaled to unit diagonal.
example1
    The five-point matrix + 4 I, n = 10^6, z* = (1, 2, 1, 2, ...), by method="auto" to
    Res < 1e-10 and by OSQP to 1e-8 with polishing: time, || min(z, Az + q) ||_2 and
    peak memory above what was there before, in units of the memory of A.
hertz
    Hertz contact without a matrix on growing grids, beside Hertz's formulas: errors of
    radius, force and largest pressure.
"""

import time

import numpy as np
import qpsolvers
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from namlcp import solve_lcp
from validation.harness import Job, Row, judging, qp_solvers, timing
from validation.harness.suite import Suite
from validation.problems import data_sets, hertz, sweep_scenes

REPEATS = {"nam": 5, "osqp": 1}  # of Example 1
CELLS = (64, 128, 256, 512, 1024)  # along a side of Hertz's grid


def solved(job: Job, A: sp.csr_array, q: np.ndarray, **given: float) -> np.ndarray:
    """Return z of an LCP, by a peer that of the QP min 1/2 z'Az + q'z, z >= 0.

    OSQP's duality gap is not tested: of terms of 10^7 rounding alone is 1e-8.
    """
    if job.solver == "nam":
        return solve_lcp(A, q, **given).z
    eps = {"piqp": 1e-9, "osqp": 1e-8}[job.solver]
    settings = qp_solvers.settings(job.solver, eps, job.limit)
    settings |= {"check_dualgap": False} if job.solver == "osqp" else {}
    problem = qpsolvers.Problem(sp.csc_matrix(A), q, lb=np.zeros(q.size))
    return qpsolvers.solve_problem(problem, solver=job.solver, **settings).x


def contact(job: Job, name: str) -> Row:
    A, q = data_sets.contact_lcp(job.data, name)
    solved(job, A, q)
    job.ready()
    z, _, runtime = timing.median_time(lambda: solved(job, A, q))
    residual = judging.relative_residual(A, q, z)
    return {"n": q.size, "runtime": runtime, "relative_residual": residual}


def example1(job: Job) -> Row:
    small, scene = (sweep_scenes.paper_example(1, m) for m in (10, 1000))
    solved(job, small.A, small.q)
    A, q, times = scene.A, scene.q, []
    given = {"eps_abs": 1e-10}
    before = timing.resident_memory(reset_peak=True)
    job.ready()
    for _ in range(REPEATS[job.solver]):
        start = time.perf_counter()
        z = solved(job, A, q, **given)
        times.append(time.perf_counter() - start)
        if len(times) == 1:
            memory = timing.resident_memory() - before
    own = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
    residual = float(np.linalg.norm(np.minimum(z, A @ z + q)))
    row = {"runtime": float(np.median(times)), "residual": residual}
    return row | {"memory": memory / own}


def without_matrix(_: Job, cells: int) -> Row:
    problem, products = hertz.hertz(cells), 0

    def product(p: np.ndarray) -> np.ndarray:
        nonlocal products
        products += 1
        return problem.A.matvec(p)

    A = LinearOperator(problem.A.shape, matvec=product, dtype=np.float64)
    start = time.perf_counter()
    result = solve_lcp(A, problem.q, diagonal=problem.diagonal)
    row = {"seconds": time.perf_counter() - start, "status": result.status.value}
    row |= {"products": products, "residual": result.residual}
    return row | hertz.measured(problem, result.z)


SUITES = {
    "contact": Suite(
        name="contact",
        requests=lambda args: (
            {"scene": name} for name in data_sets.set_names(args.data, "contact")
        ),
        work=contact, columns="scene solver | n runtime relative_residual",
        solvers=("nam", "piqp"), needs_data=True,
    ),
    "example1": Suite(
        name="example1", requests=lambda args: [{}], work=example1,
        columns="solver | runtime residual memory", solvers=tuple(REPEATS),
        limit=600.0,
    ),
    "hertz": Suite(
        name="hertz", requests=lambda args: ({"cells": cells} for cells in CELLS),
        work=without_matrix,
        columns=(
            "cells | status products seconds residual radius_error force_error "
            "pressure_error"
        ),
    ),
}  # fmt: skip
