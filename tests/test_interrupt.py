"""Ctrl-C and time limits: the best point so far, and the table of long solves."""

import io
import math
import signal
import threading
import time

import numpy as np
import problems_lcp as problems
import pytest
from problems_qp import complementary
from scipy import sparse
from scipy.sparse.linalg import LinearOperator

from namlcp import Prepared, qp_residuals, solve_lcp, solve_qp
from namlcp.limits import Deadline
from namlcp.progress import Progress, is_shown
from namlcp.residuals import natural_residual
from namlcp.status import Status


class Presses:
    """Press Ctrl-C at the given calls."""

    def __init__(self, *calls):
        self.calls, self.count = calls, 0

    def __call__(self, *_):
        self.count += 1
        if self.count in self.calls:
            signal.raise_signal(signal.SIGINT)


@pytest.fixture
def press_at(monkeypatch):
    """Press Ctrl-C at the k-th row of the history, at any moment between iterations."""

    def patch(k):
        press, row = Presses(k), Progress.row
        monkeypatch.setattr(Progress, "row", lambda *args: (row(*args), press())[0])

    return patch


def slow_problem(m=30):
    return problems.laplacian(m), -np.ones(m * m)


def test_a_deadline_has_come_after_an_interrupt():
    deadline = Deadline(time.perf_counter() + 1000.0)
    assert not deadline.reached()
    assert not Deadline(math.inf).interrupted
    with deadline.listening():
        signal.raise_signal(signal.SIGINT)
    assert deadline.reached()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.parametrize("method", ["auto", "namgs", "psor", "modulus"])
def test_ctrl_c_returns_the_best_point(method, press_at):
    A, q = slow_problem()
    press_at(3)
    options = {} if method == "auto" else {"eps_abs": 1e-12}
    if method == "auto":  # one unknown after the other: many factorisations
        A, q = problems.triangular_p(np.random.default_rng(0), 60, 10.0), -np.ones(60)
    result = solve_lcp(A, q, method=method, history=True, **options)
    assert result.status is Status.INTERRUPTED
    assert len(result.history) == 3
    w = A @ result.z + q
    residual = natural_residual(result.z, w, 0.0 * q, q + np.inf)
    assert result.residual == pytest.approx(residual)
    assert result.residual <= result.history["residual"].min() * (1 + 1e-9) or (
        method == "auto"  # whose rows are in units of the diagonal
    )


def test_ctrl_c_returns_the_best_point_of_a_qp(press_at):
    known = complementary(3, 120, 90, 10, 40, 0.02)
    press_at(4)
    result = solve_qp(*known.qp, history=True)
    assert result.status is Status.INTERRUPTED
    assert len(result.history) == 4
    residuals = qp_residuals(*known.qp, result.x, result.y, result.z, result.z_box)
    assert residuals == pytest.approx(result.residuals)


def test_ctrl_c_within_a_product():
    A, q = slow_problem()
    press = Presses(20, 27)

    def product(x):
        press()
        return A @ x

    operator = LinearOperator(A.shape, matvec=product, dtype=float)
    result = solve_lcp(operator, q)
    assert result.status is Status.INTERRUPTED
    assert 10 < result.iterations < 20
    assert np.isfinite(result.residual)


def test_twice_raises():
    A, q = slow_problem()

    def product(x):
        signal.raise_signal(signal.SIGINT)
        return A @ x

    matrix = Prepared(LinearOperator(A.shape, matvec=lambda x: A @ x, dtype=float))
    matrix.A.A = LinearOperator(A.shape, matvec=product, dtype=float)
    with pytest.raises(KeyboardInterrupt):
        solve_lcp(matrix, q)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_solve_that_ends_by_itself_does_not_swallow_it(press_at):
    """A loop over small problems can be left."""
    press_at(1)
    with pytest.raises(KeyboardInterrupt):
        solve_lcp(np.eye(2), np.ones(2), method="pgs", history=True)


def test_other_handlers_and_threads_are_left_alone():
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(1))
    try:
        deadline = Deadline(math.inf)
        with deadline.listening():
            signal.raise_signal(signal.SIGINT)
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [1]
    assert not deadline.interrupted
    results = []
    thread = threading.Thread(
        target=lambda: results.append(solve_lcp(np.eye(2), -np.ones(2)).status)
    )
    thread.start()
    thread.join()
    assert results == [Status.SOLVED]


@pytest.mark.parametrize("method", ["psor", "modulus"])
def test_time_limit_returns_the_best_point(method):
    A, q = slow_problem()
    result = solve_lcp(A, q, method=method, time_limit=1e-9, eps_abs=1e-12)
    assert result.status is Status.TIME_LIMIT
    assert np.isfinite(result.residual)


def test_time_limit_is_looked_at_before_a_long_factorisation():
    A, q = slow_problem(100)
    A = sparse.lil_array(A)
    A[0, 0] = 0.0  # neither for sweeps nor for multigrid
    A = sparse.csr_array(A)
    result = solve_lcp(A, q, 0.1, time_limit=1e-9)
    assert result.status is Status.TIME_LIMIT
    assert result.iterations == 0
    np.testing.assert_array_equal(result.w, A @ result.z + q)


# ---- the table


def test_rows_thin_out():
    shown = [k for k in range(100_001) if is_shown(k)]
    assert shown[:20] == list(range(20))
    assert shown[20:23] == [20, 30, 40]
    assert [k for k in shown if 200 <= k < 500] == [200, 300, 400]
    assert len(shown) < 100


def test_slow_rows_are_all_shown(monkeypatch):
    """Nobody waits longer than SILENCE for a row where there is one."""
    now = [0.0]
    monkeypatch.setattr(time, "perf_counter", lambda: now[0])
    stream = io.StringIO()
    progress = Progress(("iter",), verbose=True, stream=stream)
    for k in range(40, 50):
        now[0] += 1.5
        progress.row(k)
    numbers = [int(line.split()[0]) for line in stream.getvalue().splitlines()[1:]]
    assert numbers == [40, 42, 44, 46, 48]
    assert len(progress.rows) == 10
