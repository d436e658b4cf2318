"""Backward passes beside other packages: time of solve and backward, and the error.

A scalar g'x of the solution of min 1/2 x'Px + q'x, Gx <= h is differentiated in P, q, G
and h. `dense n` has n rows, `batch` is 128 dense QPs with n = 10 (one thread), `band` a
banded P with 100 sparse rows and bounds, n = 10^4, `obstacle` an LCP on a square.
`solve` and `backward` [s of processor time] are the best of several calls; backward
includes all gradients as arrays. `error` is the largest difference to the reference
over the largest entry, the worst of the four gradients.

proxqp   proxsuite, compute_backward
qpth     QPFunction of PyTorch (its own interior-point method)
diffcp   cvxpy with requires_grad=True
dqp      Magoon et al. 2024: a QP solver (daqp, or piqp if sparse), then one solve with
         the KKT matrix of the active constraints, made here with NumPy and SciPy

For the obstacle `solve` is that of the LCP, `error` the residual left and `linear` the
time of one linear solve with all of A to the same accuracy, by the same cycles.
"""

import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

import namlcp
from namlcp.lcp.multigrid.hierarchy import hierarchy_of, solve_free
from validation.derivatives import cases
from validation.harness import Job, Row, qp_solvers
from validation.harness.suite import Args, Suite
from validation.problems import known_scenes

BATCH = 128
EPS = 1e-10  # absolute tolerance of the peers


class Data(NamedTuple):
    """A QP with rows alone, and the gradient g of the scalar in x."""

    P: Any
    q: np.ndarray
    G: Any
    h: np.ndarray
    g: np.ndarray


Pass = tuple[Callable[[], Any], Callable[[Any], tuple[Any, ...]]]


def dense_case(n: int, seed: int = 0) -> Data:
    rng = np.random.default_rng(seed)
    P, G = cases.definite(n, rng), rng.standard_normal((n, n))
    h = G @ rng.standard_normal(n) + rng.random(n)
    return Data(P, 3.0 * rng.standard_normal(n), G, h, rng.standard_normal(n))


def band_case(n: int, seed: int = 0) -> Data:
    """Return a QP with a banded P; the bounds -1 <= x <= 1 are rows too."""
    rng = np.random.default_rng(seed)
    bands = [0.1 * rng.standard_normal(n - k) for k in range(1, 21)]
    upper = sp.diags_array(bands, offsets=range(1, 21))
    P = sp.csc_array(upper + upper.T + 20.0 * sp.eye_array(n))
    rows = sp.random_array((100, n), density=5.0 / n, rng=rng)
    eye = sp.eye_array(n)
    G = sp.csc_array(sp.vstack((rows, eye, -eye)))
    h = np.concatenate((np.full(100, 0.1), np.ones(2 * n)))
    return Data(P, 10.0 * rng.standard_normal(n), G, h, rng.standard_normal(n))


def nam(data: Data) -> Pass:
    *qp, g = data
    threads = {"threads": 1} if data.q.ndim > 1 else {}

    def backward(result: Any) -> tuple[Any, ...]:
        if not threads:
            result.kept = None  # nothing is kept from an earlier call
        found = result.backward(dx=g, **threads)
        return found.P, found.q, found.G, found.h

    if threads:
        return partial(namlcp.solve_batch, *qp, **threads), backward
    return partial(namlcp.solve_qp, *qp, derivative=True), backward


def proxqp(data: Data) -> Pass:
    from proxsuite import proxqp as prox

    P, q, G, h, g = data
    n, m = q.size, h.size
    low, none = np.full(m, -np.inf), np.empty((0, n))

    def solve() -> Any:
        qp = prox.dense.QP(n, 0, m)
        qp.settings.eps_abs, qp.settings.eps_rel = EPS, 0.0
        qp.init(P, q, none, np.empty(0), G, low, h)
        qp.solve()
        return qp

    def backward(qp: Any) -> tuple[Any, ...]:
        prox.dense.compute_backward(qp, np.append(g, np.zeros(m)))
        found = qp.model.backward_data
        return found.dL_dH, found.dL_dg, found.dL_dC, found.dL_du

    return solve, backward


def qpth(data: Data) -> Pass:
    import torch
    from qpth.qp import QPFunction

    *given, g = (torch.from_numpy(v) for v in data)
    arrays = [v.requires_grad_() for v in given]
    function, none = QPFunction(verbose=-1, eps=1e-12), torch.Tensor()

    def backward(x: Any) -> tuple[Any, ...]:
        found = torch.autograd.grad((x * g).sum(), arrays, retain_graph=True)
        return tuple(v.numpy() for v in found)

    return lambda: function(*arrays, none, none), backward


def diffcp(data: Data) -> Pass:
    """Return the passes of cvxpy; P enters by its Cholesky factor, without gradient."""
    import cvxpy

    P, q, G, h, g = data
    n = q.size
    if sp.issparse(P):
        raise NotImplementedError
    x = cvxpy.Variable(n)
    parameters = [cvxpy.Parameter(v.shape, value=v) for v in (q, G, h)]
    cost = 0.5 * cvxpy.sum_squares(np.linalg.cholesky(P).T @ x) + parameters[0] @ x
    problem = cvxpy.Problem(cvxpy.Minimize(cost), [parameters[1] @ x <= parameters[2]])

    def solve() -> Any:
        problem.solve(solver=cvxpy.DIFFCP, requires_grad=True, eps=EPS, mode="dense")
        return problem

    def backward(problem: Any) -> tuple[Any, ...]:
        x.gradient = g
        problem.backward()
        return (None, *(parameter.gradient for parameter in parameters))

    return solve, backward


def dqp(data: Data) -> Pass:
    import qpsolvers

    P, q, G, h, g = data
    qp = (sp.csc_matrix(v) if sp.issparse(v) else v for v in (P, q, G, h))
    problem = qpsolvers.Problem(*qp)
    solver = "piqp" if sp.issparse(P) else "daqp"
    more = qp_solvers.settings(solver, EPS, 60.0)

    def backward(solution: Any) -> tuple[Any, ...]:
        x, z = solution.x, solution.z
        active = np.flatnonzero(z > h - G @ x)
        K, rhs = kkt(P, G[active]), np.append(g, np.zeros(active.size))
        w = splu(K).solve(rhs) if sp.issparse(K) else np.linalg.solve(K, rhs)
        return gradients_of(data, x, z, active, w)

    return lambda: qpsolvers.solve_problem(problem, solver=solver, **more), backward


def kkt(P: Any, C: Any) -> Any:
    if sp.issparse(P):
        return sp.block_array([[P, C.T], [C, None]], format="csc")
    return np.block([[P, C.T], [C, np.zeros((len(C), len(C)))]])


def gradients_of(
    data: Data, x: np.ndarray, z: np.ndarray, active: np.ndarray, w: np.ndarray
) -> tuple[Any, ...]:
    n = x.size
    u, lam = w[:n], np.zeros(z.size)
    lam[active] = w[n:]
    if not sp.issparse(data.P):
        gP = -0.5 * (np.outer(u, x) + np.outer(x, u))
        return gP, -u, -np.outer(z, u) - np.outer(lam, x), lam
    (i, j), (r, c) = data.P.nonzero(), data.G.nonzero()
    gP = sp.csc_array((-0.5 * (u[i] * x[j] + x[i] * u[j]), (i, j)), data.P.shape)
    gG = sp.csc_array((-(z[r] * u[c] + lam[r] * x[c]), (r, c)), data.G.shape)
    return gP, -u, gG, lam


def reference(data: Data) -> tuple[Any, ...]:
    P, q, G, h, g = data
    active = np.flatnonzero(namlcp.solve_qp(P, q, G, h).z > 1e-8)
    n, K = q.size, kkt(P, G[active])
    right = np.column_stack(
        (np.append(-q, h[active]), np.append(g, np.zeros(active.size)))
    )
    solve = splu(K).solve if sp.issparse(K) else np.linalg.inv(K).__matmul__
    wide, found = K.astype(np.longdouble), np.zeros(right.shape, np.longdouble)
    for _ in range(6):  # refinement with residuals in extended precision
        found += solve((right - wide @ found).astype(float))
    z = np.zeros(h.size, np.longdouble)
    z[active] = found[n:, 0]
    return gradients_of(data, found[:n, 0], z, active, found[:, 1])


def error_of(found: tuple[Any, ...], exact: tuple[Any, ...]) -> float:
    return max(
        float(abs(own - true).max() / abs(true).max())
        for own, true in zip(found, exact, strict=True)
        if own is not None
    )


def best_times(both: Pass, seconds: float = 1.0) -> tuple[Row, Any]:
    solve, backward = both
    backward(solve())  # compiles, or loads what is compiled
    times, begin = [], time.process_time()
    while not times or (time.process_time() - begin < seconds and len(times) < 300):
        start = time.process_time()
        state = solve()
        middle = time.process_time()
        found = backward(state)
        times.append((middle - start, time.process_time() - middle))
    first, second = (min(column) for column in zip(*times, strict=True))
    return {"solve": first, "backward": second, "ratio": second / first}, found


MAKERS = {"nam": nam, "proxqp": proxqp, "qpth": qpth, "diffcp": diffcp, "dqp": dqp}


def qp_row(solver: str, data: Data) -> Row:
    exact = reference(data)
    row, found = best_times(MAKERS[solver](data))
    return row | {"error": error_of(found, exact)}


def batch_row(solver: str) -> Row:
    """Return the row of a batch: at once by ours and qpth, else a loop."""
    every = [dense_case(10, seed) for seed in range(BATCH)]
    exact = [np.stack(v) for v in zip(*map(reference, every), strict=True)]
    if solver in ("nam", "qpth"):
        both = MAKERS[solver](Data(*map(np.stack, zip(*every, strict=True))))
    else:
        passes = [MAKERS[solver](data) for data in every]

        def backward(states: list[Any]) -> tuple[Any, ...]:
            pairs = zip(passes, states, strict=True)
            found = [back(state) for (_, back), state in pairs]
            return tuple(map(np.stack, zip(*found, strict=True)))

        both = (lambda: [solve() for solve, _ in passes], backward)
    row, found = best_times(both)
    return row | {"error": error_of(found, exact)}


def obstacle_row(n: int, seconds: float = 20.0) -> Row:
    """Return the row of an obstacle with n unknowns; `error` is the residual left."""
    A, q, lower, _ = known_scenes.obstacle(round(n**0.5))
    matrix = namlcp.Prepared(A)
    g = np.random.default_rng(0).standard_normal(q.size)

    def backward(result: namlcp.LCPResult) -> np.ndarray:
        result.kept = None
        return result.backward(dz=g).q

    solve = partial(namlcp.solve_lcp, matrix, q, lower)
    row, rho = best_times((solve, backward), seconds)
    result = solve()
    free = result.derivative.side == 0
    error = np.linalg.norm((A @ rho + g)[free]) / np.linalg.norm(g[free])
    every = np.ones(q.size, dtype=bool)

    def linear(_: Any) -> Any:
        return solve_free(hierarchy_of(matrix), every, g, 1e-12)

    whole, _ = best_times((lambda: None, linear), seconds)
    return row | {"error": float(error), "linear": whole["backward"]}


CASES = {
    "dense 10": ("nam", "proxqp", "qpth", "diffcp", "dqp"),
    "dense 100": ("nam", "proxqp", "qpth", "diffcp", "dqp"),
    "dense 500": ("nam", "proxqp", "qpth", "dqp"),  # diffcp needs minutes
    "batch": ("nam", "proxqp", "dqp", "qpth"),
    "band": ("nam", "dqp"),  # the others take no sparse matrices, or need minutes
    "obstacle": ("nam",),
}


def work(job: Job, case: str, quick: bool) -> Row:
    warnings.simplefilter("ignore")
    job.ready()
    if case == "batch":
        return batch_row(job.solver)
    if case == "obstacle":
        return obstacle_row(10_000 if quick else 1_000_000)
    if case == "band":
        return qp_row(job.solver, band_case(1000 if quick else 10_000))
    return qp_row(job.solver, dense_case(int(case.split()[1])))


def requests(args: Args) -> Iterator[Row]:
    for case, solvers in CASES.items():
        for solver in (s for s in solvers if s in args.solvers):
            yield {"case": case, "solver": solver, "ask": (case, args.quick)}


SUITE = Suite(
    name="derivatives-peers", requests=requests, work=work,
    columns="case solver | solve backward error ratio linear", solvers=tuple(MAKERS),
    packages={"qpth": "qpth", "diffcp": "diffcp", "dqp": "daqp"}, limit=600.0,
)  # fmt: skip
