"""Limits that hold: time, iterations, Ctrl-C, memory.

What is counted is tested here, what is timed is only bounded generously.
"""

import math
import signal
import threading
import time
from functools import partial

import cvxpy
import numpy as np
import problems_lcp as problems
import pytest
from qpsolvers import Problem
from scipy import sparse
from scipy.sparse.linalg import LinearOperator
from solves import QPS, large_dense, sparse_qp

import namlcp
import namlcp.cvxpy
from namlcp import (
    Prepared,
    Solver,
    Status,
    qp_residuals,
    solve_batch,
    solve_lcp,
    solve_qp,
)
from namlcp.limits import Deadline, OutOfTime
from namlcp.qp.intake import qp_data
from namlcp.qp.reductions import substitute
from namlcp.qpsolvers import nam_solve_problem


def is_consistent(result):
    """The point is finite, and its residuals are those that the result says."""
    if result.status is Status.PRIMAL_INFEASIBLE:
        return np.isnan(result.x).all()
    point = result.x, result.y, result.z, result.z_box
    exact = qp_residuals(*result.problem[0], *point)
    return result.residuals == pytest.approx(exact)


# ---- iterations


@pytest.mark.parametrize("name", QPS)
def test_max_iter_is_held(name):
    """To the iteration where one method alone counts; `lcp/test_relations` has LCPs."""
    solve = QPS[name]
    whole = solve()
    for most in range(1, min(whole.iterations, 9)):
        result = solve(max_iter=most)
        assert result.iterations <= most
        assert is_consistent(result)
        if name not in ("dual", "infeasible"):  # that may go on by another method
            assert (result.status, result.iterations) == (Status.MAX_ITER, most)
    enough = solve(max_iter=max(whole.iterations, 1))
    assert enough.status is whole.status
    if name != "dual":
        assert enough.iterations == whole.iterations


# ---- time


def lasso(rows=400, columns=60):
    """Return a least-squares problem whose residuals are variables of their own."""
    rng = np.random.default_rng(1)
    C, b = sparse.csc_array(rng.standard_normal((rows, columns))), rng.random(rows)
    P = sparse.block_diag((0.0 * sparse.eye_array(columns), sparse.eye_array(rows)))
    A = sparse.hstack((C, -sparse.eye_array(rows)))
    return P, np.zeros(rows + columns), None, None, A, b


@pytest.mark.parametrize("limit", [0.02, 0.2])
@pytest.mark.parametrize("form", ["dual", "path"])
def test_time_limits_of_long_solves(form, limit):
    P, q, G, h = large_dense(600, 6000) if form == "dual" else large_dense(800, 800)
    if form == "path":
        P, G = sparse.csc_array(P), sparse.csc_array(np.vstack((G, -G)))
        h = np.concatenate((h, h))
    result = solve_qp(P, q, G, h, time_limit=limit)
    assert result.setup_time + result.solve_time < limit + 2.0  # on a busy machine
    assert result.status is Status.TIME_LIMIT
    assert np.isfinite(result.residuals.primal)


def test_time_limit_before_a_long_factorisation():
    A = sparse.lil_array(problems.laplacian(100))
    A[0, 0] = 0.0  # neither for sweeps nor for multigrid
    A = sparse.csr_array(A)
    result = solve_lcp(A, -np.ones(10_000), 0.1, time_limit=1e-9)
    assert (result.status, result.iterations) == (Status.TIME_LIMIT, 0)
    np.testing.assert_array_equal(result.w, A @ result.z - 1.0)


def test_the_substitution_looks_at_the_clock(monkeypatch):
    """Between two strips of rows, ten at a time here; each look takes a second."""
    qp, now = qp_data(*lasso(), None, None), [0.0]
    monkeypatch.setattr("namlcp.linalg.csc.STRIP", 600)
    monkeypatch.setattr(time, "perf_counter", lambda: now.append(0.0) or len(now))
    assert substitute(qp, None, Deadline()).columns.size == 400
    looks = len(now)
    for limit in (0.0, looks / 2):
        now.clear()
        with pytest.raises(OutOfTime):
            substitute(qp, None, Deadline(limit))
        assert len(now) <= limit + 2


def definite():
    """Return a sparse QP whose P must be factored to see that it is definite."""
    rng = np.random.default_rng(0)
    C = sparse.random_array((300, 300), density=0.05, rng=rng)
    P, G = C.T @ C + sparse.eye_array(300), sparse.random_array((300, 300), rng=rng)
    return sparse.csc_array(P), np.ones(300), sparse.csc_array(G), np.ones(300)


def dense_lp():
    G = np.random.default_rng(0).standard_normal((300, 150))
    return np.zeros((150, 150)), -G.sum(0), G, np.ones(300)


@pytest.mark.parametrize("data", [definite, dense_lp])
def test_nothing_begins_after_the_deadline(monkeypatch, data):
    """Each look at the clock takes a second: at most three are late."""
    arguments, clock, looks = data(), time.perf_counter, []
    start = 0.0
    monkeypatch.setattr(
        time, "perf_counter", lambda: looks.append(0) or start + len(looks)
    )
    for limit in range(1, 9):
        looks.clear()
        start = clock()
        result = solve_qp(*arguments, time_limit=limit)
        assert result.status is Status.TIME_LIMIT
        assert len(looks) <= limit + 3


def test_time_limit_before_a_method_begins():
    result = solve_qp(*lasso(), time_limit=1e-9)
    assert (result.status, result.form) == (Status.TIME_LIMIT, "none")
    assert np.isfinite(result.residuals.primal)


def test_time_limit_of_the_second_try_without_huge_bounds(monkeypatch):
    first = namlcp.qp.route.solve_transformed

    def forms(qp, *arguments):
        status = Status.STALLED if qp.ub[0] < np.inf else Status.TIME_LIMIT
        return first(qp, *arguments)._replace(status=status)

    monkeypatch.setattr("namlcp.qp.route.solve_transformed", forms)
    # without a history it would be solved before that
    result = solve_qp(np.eye(1), np.ones(1), ub=np.full(1, 1e10), history=True)
    assert result.status is Status.TIME_LIMIT
    assert np.isfinite(result.x).all()


# ---- Ctrl-C


def test_ctrl_c_within_a_product():
    A, products = problems.laplacian(30), []

    def multiply(x):
        products.append(x)
        if len(products) == 20:
            signal.raise_signal(signal.SIGINT)
        return A @ x

    operator = LinearOperator(A.shape, matvec=multiply, dtype=float)
    with pytest.raises(KeyboardInterrupt):
        solve_lcp(operator, -np.ones(900))
    assert len(products) == 20
    assert solve_lcp(operator, -np.ones(900)).status is Status.SOLVED


def repeat(call, seconds):
    """Outside of `try`: `while` of Python 3.13.0 loses KeyboardInterrupt there."""
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        call()


def press_after(seconds, go):
    """Press Ctrl-C in a thread so long after `go`; its `pressed` is when."""

    def wait():
        go.wait()
        time.sleep(seconds)
        thread.pressed = time.perf_counter()
        signal.raise_signal(signal.SIGINT)

    thread = threading.Thread(target=wait)
    thread.start()
    return thread


P, Q, G, H = large_dense(300, 1500)
LAPLACIAN, GRID, SMALL_GRID = (problems.laplacian(n) for n in (300, 100, 50))
GRID_ROWS = sparse.csc_array(sparse.eye_array(10_000))
SKEW = problems.skew(np.random.default_rng(0), 400, 1e-2)
SOLVERS = Solver(P, Q, G, H), Solver(GRID, np.ones(10_000), GRID_ROWS, np.ones(10_000))
PREPARED = Prepared(SKEW)


def step(solver, q):
    solver.update(q=q)
    return solver.solve().x


def cvxpy_step(q):
    x = cvxpy.Variable(q.size)
    cost = 0.5 * cvxpy.quad_form(x, cvxpy.psd_wrap(P)) + q @ x
    cvxpy.Problem(cvxpy.Minimize(cost), [G @ x <= H]).solve(solver=namlcp.cvxpy.NAM())
    return x.value


# Solutions for a linear term, and one for which this takes some time.
DOORS = {
    "solve_qp": (lambda q: solve_qp(P, q, G, H).x, Q),
    "path": (lambda q: solve_qp(GRID, q, GRID_ROWS, 1.0 + 0.0 * q).x, 10_000),
    "Solver": (partial(step, SOLVERS[0]), Q),
    "sparse Solver": (partial(step, SOLVERS[1]), 10_000),
    "solve_batch": (lambda q: solve_batch(P, [q] * 4, G, H, threads=2).x, Q),
    "one thread": (lambda q: solve_batch(P, [q] * 4, G, H, threads=1).x, Q),
    "qpsolvers": (lambda q: nam_solve_problem(Problem(P, q, G, H)).x, Q),
    "cvxpy": (cvxpy_step, Q),
    "namgs": (lambda q: solve_lcp(SMALL_GRID, q, method="namgs").z, 2500),
    "multigrid": (lambda q: solve_lcp(LAPLACIAN, q, method="multigrid").z, 90_000),
    "lemke": (lambda q: solve_lcp(SKEW, q, method="lemke").z, 400),
    "Prepared": (lambda q: solve_lcp(PREPARED, q).z, 400),
}


@pytest.mark.parametrize("name", DOORS)
def test_ctrl_c_ends_a_long_solve(name):
    """Or a loop of some; soon, and the next solve is as good as before."""
    solve, q = DOORS[name]
    if isinstance(q, int):
        q = -1.0 - np.cos(np.arange(float(q)) ** 2)
    go = threading.Event()
    solve(q)  # while code is loaded, LLVM swallows signals
    for wait in (0.1, 0.5):
        go.clear()
        thread = press_after(wait, go)
        with pytest.raises(KeyboardInterrupt):  # noqa: PT012
            go.set()
            repeat(lambda: solve(q), math.inf)
        assert time.perf_counter() - thread.pressed < 1.0
        thread.join()
        assert np.abs(solve(np.zeros(q.size))).max() < 1e-9


EYE, ONE, SMALL = np.eye(2), np.ones(2), problems.laplacian(4)
KEPT = Solver(EYE, ONE, lb=0.0 * ONE)
LOOPS = {
    "solves": lambda: (solve_qp(EYE, ONE, lb=0.0 * ONE), solve_lcp(EYE, ONE)),
    "sparse solves": lambda: solve_qp(*sparse_qp()),
    "bounds": QPS["bounds"],
    "steps": lambda: (KEPT.update(q=-ONE), KEPT.solve()),
    "batches": lambda: namlcp.solve_batch(EYE, np.ones((3, 2)), threads=2),
    "verdicts": lambda: (
        namlcp.is_h_plus(SMALL), namlcp.converges(SMALL, "psor", alpha=1.5),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LOOPS)
def test_a_loop_can_be_left(name):
    """At 20 moments, whatever the signal meets; the next call is as good as before."""
    call, left = LOOPS[name], 0
    call()  # while code is loaded, LLVM swallows signals
    for k in range(20):
        go = threading.Event()
        thread = press_after(1e-4 * k, go)
        try:
            go.set()
            repeat(call, 5.0)
        except KeyboardInterrupt:
            left += 1
        thread.join()
    assert left == 20
    KEPT.update(q=-ONE)
    assert KEPT.solve().x.tolist() == [1.0, 1.0]


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no timers here")
def test_what_a_handler_raises_is_raised():
    """Another signal, whose handler raises, comes out of compiled code soon."""

    def handler(*_):
        raise TimeoutError("by a handler")

    data = large_dense(900, 9000)
    before = signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    try:
        with pytest.raises(TimeoutError, match="by a handler"):
            solve_qp(*data)
    finally:
        signal.signal(signal.SIGALRM, before)


# ---- memory


def test_a_sparse_vector_of_a_wrong_shape_is_not_made_dense():
    wide = sparse.csc_array((10**9, 10**9))
    for call in (
        lambda: solve_qp(EYE, wide),
        lambda: solve_lcp(EYE, wide),
        lambda: solve_qp(EYE, ONE, lb=wide),
    ):
        with pytest.raises(ValueError, match=r"must have shape \(2,\).*1000000000"):
            call()


@pytest.mark.parametrize("layout", ["csr", "coo", "lil"])
def test_more_entries_than_int32_counts_are_refused(layout, monkeypatch):
    monkeypatch.setattr("namlcp.arrays.MOST_ENTRIES", 99)
    P = sparse.csc_array(np.ones((10, 10))).asformat(layout)
    with pytest.raises(MemoryError, match=r"P would have 1\.0e\+02 entries"):
        solve_qp(P, np.ones(10))
    with pytest.raises(MemoryError, match=r"allowed are 9\.9e\+01"):
        solve_qp(np.eye(10), np.ones(10), sparse.eye_array(1, 10), np.ones(1))
    qp = sparse_qp()
    most = qp.P.nnz + qp.A.nnz + qp.G.nnz
    monkeypatch.setattr("namlcp.arrays.MOST_ENTRIES", most)
    with pytest.raises(MemoryError, match="the KKT matrix would have"):
        solve_qp(*qp)


def test_large_sparse_problems_are_never_made_dense():
    """Any square of these sizes would be 80 GB, any product of two of them."""
    n = 100_000
    P, one, zero = sparse.eye_array(n, format="csc"), np.ones(n), np.zeros(n)
    assert solve_qp(P, -one, lb=zero, ub=0.5 * one).status is Status.SOLVED
    rows = sparse.hstack((P, sparse.csc_array(np.ones((n, 1)))), format="csc")
    cost = sparse.block_diag((1e-3 * P, sparse.eye_array(1)), format="csc")
    result = solve_qp(cost, -np.ones(n + 1), rows, one, lb=np.zeros(n + 1))
    assert (result.status, result.form) == (Status.SOLVED, "path")
    free = np.full(n, np.inf)
    result = solve_lcp(sparse.csr_array(P), -one, 0.0, free)
    assert result.status is Status.SOLVED
    assert namlcp.converges(sparse.csr_array(P), "pgs").answer


def test_many_rows_make_no_dual_matrix():
    """10^5 rows on five variables: the multipliers' matrix is not formed."""
    G = np.random.default_rng(0).standard_normal((100_000, 5))
    for rows in (G, sparse.csc_array(G)):
        result = solve_qp(np.eye(5), 10.0 * np.ones(5), rows, np.ones(100_000))
        assert (result.status, result.form) == (Status.SOLVED, "dual")
