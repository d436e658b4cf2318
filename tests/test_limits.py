"""Limits that hold: time, iterations, Ctrl-C, memory.

What is counted is tested here, what is timed is only bounded generously.
"""

import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import problems_lcp as problems
import pytest
from problems_qp import complementary
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

import namlcp
from namlcp import Options, checks, solve_lcp, solve_qp
from namlcp.limits import SPEED, UNCHECKED_TIME, Deadline
from namlcp.linalg import csc
from namlcp.qp import qp_data
from namlcp.qp.answer import out_of_time
from namlcp.qp.guess import NO_GUESS
from namlcp.qp.problem import QP
from namlcp.qp.responses import solve_once
from namlcp.qp.transforms.substitution import substitute
from namlcp.status import Status


def large_dense(n=300, m=900):
    """Return P, q, G, h of a dense QP with some hundred pivots."""
    rng = np.random.default_rng(0)
    B, G = rng.standard_normal((n, n)), rng.standard_normal((m, n))
    return B @ B.T / n + np.eye(n), 10.0 * rng.standard_normal(n), G, 0.1 * np.ones(m)


# ---- time


def test_the_dense_form_asks_whether_to_stop():
    """At the third look it ends, with the best point."""

    class Looks(Deadline):
        count = 0

        def reached(self):
            self.count += 1
            return self.count >= 3

    P, q, G, h = large_dense()
    qp = QP(P, q, G, h, np.empty((0, q.size)), np.empty(0), q - np.inf, q + np.inf)
    limits, looks = Options().limits(), Looks(time.perf_counter() + 10.0)
    answer = solve_once(qp, NO_GUESS, limits._replace(deadline=looks))
    assert answer.status is Status.TIME_LIMIT
    assert looks.count == 3
    assert np.isfinite(answer.point.x).all()
    whole = solve_once(qp, NO_GUESS, limits)
    assert whole.status is Status.SOLVED
    assert 0 < answer.iterations < whole.iterations


def test_only_long_calls_are_watched():
    deadline, seen = Deadline(time.perf_counter() + 1.0), []
    deadline.run(seen.append, 0.5 * SPEED * UNCHECKED_TIME)
    deadline.run(
        lambda *values: seen.append(values[-1] != 0), 2.0 * SPEED * UNCHECKED_TIME
    )
    assert seen == [0, True]


@pytest.mark.parametrize("limit", [0.02, 0.2])
def test_time_limit_of_the_dense_form(limit):
    P, q, G, h = large_dense(600, 6000)
    result = solve_qp(P, q, G, h, time_limit=limit)
    assert result.setup_time + result.solve_time < limit + 2.0  # on a busy machine
    assert result.status is Status.TIME_LIMIT
    assert result.form == "dual"
    assert np.isfinite(result.residuals.primal)


def lasso(rows=400, columns=60):
    """Return a least-squares problem whose residuals are variables of their own."""
    rng = np.random.default_rng(1)
    C = rng.standard_normal((rows, columns))
    P = sparse.block_diag(
        (sparse.csc_array((columns, columns)), sparse.eye_array(rows))
    )
    A = sparse.hstack((sparse.csc_array(C), -sparse.eye_array(rows)))
    return qp_data(
        sparse.csc_array(P), np.zeros(rows + columns), None, None, sparse.csc_array(A),
        rng.standard_normal(rows), None, None,
    )  # fmt: skip


def test_substitution_looks_at_the_deadline(monkeypatch):
    """Between two strips of rows."""
    qp, now = lasso(), [0.0]
    assert substitute(qp).columns.size == 400
    assert substitute(qp, None, Deadline(0.0)) is None
    monkeypatch.setattr(csc, "STRIP", 600)  # ten rows at a time
    monkeypatch.setattr(time, "perf_counter", lambda: now.append(0.0) or len(now))
    assert substitute(qp, None, Deadline()).columns.size == 400
    looks = len(now)
    now.clear()
    assert substitute(qp, None, Deadline(looks / 2)) is None
    assert len(now) <= looks / 2 + 2


def test_time_limit_within_the_substitution():
    qp = lasso()
    result = solve_qp(*qp, time_limit=1e-9)
    assert result.status is Status.TIME_LIMIT
    assert result.form == "substitution"
    assert np.isfinite(result.residuals.primal)


def test_time_limit_of_the_second_try_without_huge_bounds(monkeypatch):
    def forms(qp, *arguments):
        status = Status.STALLED if qp.ub[0] < np.inf else Status.TIME_LIMIT
        return out_of_time(qp)._replace(status=status)

    monkeypatch.setattr("namlcp.qp.solve.solve_substituted", forms)
    bound = np.full(1, 1e10)
    # without a history it would be solved before that
    result = solve_qp(np.eye(1), np.ones(1), ub=bound, history=True)
    assert result.status is Status.TIME_LIMIT
    assert np.isfinite(result.x).all()


def test_time_limit_before_the_first_factorisation():
    qp = complementary(3, 120, 90, 10, 40, 0.02).qp
    lb = np.maximum(qp.lb, -100.0)
    result = solve_qp(*qp._replace(lb=lb), time_limit=1e-9)
    assert result.status is Status.TIME_LIMIT
    assert result.iterations == 0


# ---- Ctrl-C, as it comes: from outside, at any moment

PRESSED = """
import os, signal, sys, threading, time
sys.path[:0] = sys.argv[1:]
import numpy as np, namlcp
from test_limits import large_dense, late_sweep

def press(after):  # seconds of work, however busy the machine is
    end = time.process_time() + after
    def wait():
        while time.process_time() < end:
            time.sleep(0.01)
        os.kill(os.getpid(), signal.SIGINT)
    threading.Thread(target=wait).start()

namlcp.solve_qp(*large_dense())
late_sweep(max_iter=5)
data = large_dense(900, 9000)
press(0.1)
print(namlcp.solve_qp(*data).status.value)
press(0.1)
print(late_sweep().status.value)
print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)
"""


def late_sweep(**options):
    """Sweep for seconds."""
    A = problems.laplacian(100)
    return solve_lcp(A, -np.ones(10_000), method="namgs", eps_abs=1e-12, **options)


def test_ctrl_c_from_outside():
    """A long solve returns, and the handler is Python's own again."""
    here = Path(__file__).parent
    done = subprocess.run(
        [sys.executable, "-c", PRESSED, str(here), str(here / "shared")],
        capture_output=True, text=True, check=False, timeout=100,
    )  # fmt: skip
    assert done.stdout.split() == ["interrupted", "interrupted", "True"], done.stderr


def leave(call):
    """Call in a loop until Ctrl-C, at 20 moments; return how often it was left."""
    left = 0

    def press(go, after):
        go.wait()
        time.sleep(after)
        signal.raise_signal(signal.SIGINT)

    call()  # while code is loaded, LLVM swallows signals
    for k in range(20):
        go = threading.Event()
        thread = threading.Thread(target=press, args=(go, 1e-4 * k))
        thread.start()
        try:
            go.set()
            end = time.perf_counter() + 5.0
            while time.perf_counter() < end:
                call()
        except KeyboardInterrupt:
            left += 1
        thread.join()
    return left


def test_a_loop_over_small_solves_can_be_left():
    """Whatever the signal meets, it comes out as KeyboardInterrupt."""
    A, q = np.eye(2), np.ones(2)

    def call():
        solve_qp(A, q, lb=np.zeros(2))
        solve_lcp(A, q)

    assert leave(call) == 20


def test_a_loop_over_verdicts_can_be_left():
    A = problems.laplacian(4)
    assert leave(lambda: namlcp.is_h_plus(A)) == 20
    assert leave(lambda: namlcp.converges(A, "psor", alpha=1.5)) == 20


@pytest.mark.parametrize("verdict", [namlcp.is_h_plus, namlcp.converges])
def test_what_compiled_code_makes_of_ctrl_c_is_undone(verdict, monkeypatch):
    def interrupted(*_, **__):
        raise SystemError("a chain") from KeyboardInterrupt()

    for name in ("comparison.settle", "convergence.splitting"):
        monkeypatch.setattr(f"namlcp.theory.{name}", interrupted)
    arguments = (np.eye(2),) if verdict is namlcp.is_h_plus else (np.eye(2), "pgs")
    with pytest.raises(KeyboardInterrupt):
        verdict(*arguments)


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


# ---- iterations


def operator(A):
    return LinearOperator(A.shape, matvec=lambda x: A @ x, dtype=float)


def three_diagonals(n=400):
    """Return a tridiagonal matrix that takes several eliminations."""
    A = sparse.diags_array([1.0, 2.5, 1.0], offsets=[-1, 0, 1], shape=(n, n))
    return sparse.csr_array(A)


SWEEPS = ("pgs", "psor", "namgs", "modulus", "amsor", "namj")
RNG = np.random.default_rng(0)
LCPS = {
    "pivoting": (problems.skew(RNG, 40, 1.0), np.cos(np.arange(40.0)), {}),
    "tridiagonal": (three_diagonals(), np.cos(np.arange(400.0) ** 2), {}),
    "mprgp": (operator(problems.laplacian(20)), -np.cos(np.arange(400.0)), {}),
    "multigrid": (
        problems.laplacian(40), np.cos(np.arange(1600.0)) - 0.1,
        {"method": "multigrid", "eps_rel": 1e-13},
    ),
} | {
    name: (
        problems.laplacian(10), -np.cos(np.arange(100.0)),
        {"method": name, "eps_abs": 1e-13},
    )
    for name in SWEEPS
}  # fmt: skip


@pytest.mark.parametrize("name", LCPS)
def test_max_iter_of_an_lcp_is_exact(name):
    A, q, options = LCPS[name]
    whole = solve_lcp(A, q, **options)
    assert whole.method == name
    for most in range(1, min(whole.iterations, 5)):
        result = solve_lcp(A, q, max_iter=most, **options)
        assert result.status is Status.MAX_ITER, most
        assert result.iterations == most
    enough = solve_lcp(A, q, max_iter=max(whole.iterations, 1), **options)
    assert enough.status is whole.status
    assert enough.iterations == whole.iterations


def test_max_iter_of_the_path_is_exact():
    qp = complementary(3, 120, 90, 10, 40, 0.02).qp
    whole = solve_qp(*qp)
    assert (whole.status, whole.form) == (Status.SOLVED, "path")
    for most in range(1, whole.iterations):
        result = solve_qp(*qp, max_iter=most)
        assert result.status is Status.MAX_ITER
        assert result.iterations == most


def test_max_iter_of_the_dense_form_is_exact():
    P, q, G, h = large_dense(30, 90)
    for cost in (P, P[:5].T @ P[:5]):
        qp = QP(cost, q, G, h, np.empty((0, 30)), np.empty(0), q - np.inf, q + np.inf)
        whole = solve_qp(*qp)
        assert whole.form == "dual"
        for most in range(1, whole.iterations):
            result = solve_qp(*qp, max_iter=most)
            assert result.form == "path"
            assert result.iterations <= most
        assert solve_qp(*qp, max_iter=whole.iterations).form == "dual"


# ---- memory


def test_a_sparse_vector_of_a_wrong_shape_is_not_made_dense():
    wide = sparse.csc_array((10**9, 10**9))
    for call in (
        lambda: solve_qp(np.eye(2), wide),
        lambda: solve_lcp(np.eye(2), wide),
        lambda: solve_qp(np.eye(2), np.ones(2), lb=wide),
    ):
        with pytest.raises(ValueError, match=r"must have shape \(2,\).*1000000000"):
            call()


@pytest.mark.parametrize("layout", ["csr", "coo", "lil"])
def test_more_entries_than_int32_counts_are_refused(layout, monkeypatch):
    monkeypatch.setattr(checks, "MOST_ENTRIES", 99)
    P = sparse.csc_array(np.ones((10, 10))).asformat(layout)
    with pytest.raises(MemoryError, match=r"P would have 1\.0e\+02 entries"):
        solve_qp(P, np.ones(10))
    with pytest.raises(MemoryError, match=r"allowed are 9\.9e\+01"):
        solve_qp(np.eye(10), np.ones(10), sparse.eye_array(1, 10), np.ones(1))


def test_factors_beyond_memory_are_refused(monkeypatch):
    qp = complementary(3, 120, 90, 10, 40, 0.02).qp
    monkeypatch.setattr(checks, "MOST_ENTRIES", qp.P.nnz + qp.A.nnz + qp.G.nnz)
    with pytest.raises(MemoryError, match="the KKT matrix would have"):
        solve_qp(*qp)


def test_large_sparse_problems_are_never_made_dense():
    """Any square of these sizes would be 80 GB, any product of two of them."""
    n = 100_000
    P, free = sparse.eye_array(n, format="csc"), np.full(n, np.inf)
    result = solve_qp(P, -np.ones(n), lb=np.zeros(n), ub=0.5 * np.ones(n))
    assert result.status is Status.SOLVED
    rows = sparse.hstack((P, sparse.csc_array(np.ones((n, 1)))), format="csc")
    cost = sparse.block_diag((1e-3 * P, sparse.eye_array(1)), format="csc")
    result = solve_qp(cost, -np.ones(n + 1), rows, np.ones(n), lb=np.zeros(n + 1))
    assert result.status is Status.SOLVED
    assert result.form == "path"
    result = solve_lcp(sparse.csr_array(P), -np.ones(n), 0.0, free)
    assert result.status is Status.SOLVED
    assert namlcp.converges(sparse.csr_array(P), "pgs").answer


def test_many_rows_make_no_dual_matrix():
    """10^5 rows on five variables: the multipliers' matrix is not formed."""
    rng = np.random.default_rng(0)
    G = rng.standard_normal((100_000, 5))
    for rows in (G, sparse.csc_array(G)):
        result = solve_qp(np.eye(5), 10.0 * np.ones(5), rows, np.ones(100_000))
        assert result.status is Status.SOLVED
        assert result.form == "dual"


def test_options_are_remembered_by_value_and_type():
    once = Options.from_names({"max_iter": 1, "eps_abs": 1e-3})
    assert Options.from_names({"max_iter": 1, "eps_abs": 1e-3}) is once
    with pytest.raises(TypeError, match="max_iter must be an integer, got True"):
        Options.from_names({"max_iter": True, "eps_abs": 1e-3})
    for wrong in ([1], np.ones(1)):  # without a hash
        with pytest.raises(TypeError, match="max_iter must be an integer"):
            Options.from_names({"max_iter": wrong})
