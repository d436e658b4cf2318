"""Solves use one BLAS thread, and leave the user's number as they found it."""

import contextlib
import os
import threading

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import Solver, solve_lcp, solve_qp
from namlcp.linalg import threads
from namlcp.linalg.threads import UNTOUCHED_ORDER, WORTH_ORDER, blas_threads, settings
from namlcp.qp.active.solve import MOST_ORDER

LARGE = UNTOUCHED_ORDER + 1


def numbers():
    return [get() for _, get in settings()]


@pytest.fixture(autouse=True)
def two():
    """Begin with two threads, as users have them."""
    before = numbers()
    if not before:
        pytest.skip("no BLAS library whose threads can be set")
    for put, _ in settings():
        put(2)
    yield
    for (put, _), number in zip(settings(), before, strict=True):
        put(number)


def test_one_thread_inside_and_the_users_number_after():
    with blas_threads(1, UNTOUCHED_ORDER):  # nothing is set for small problems
        assert set(numbers()) == {2}
    with contextlib.suppress(ZeroDivisionError), blas_threads(1, LARGE):
        assert set(numbers()) == {1}
        with blas_threads(1, LARGE):
            assert set(numbers()) == {1}
        assert set(numbers()) == {1}
        raise ZeroDivisionError
    assert set(numbers()) == {2}


@pytest.mark.parametrize(
    ("order", "expected"), [(WORTH_ORDER, 2), (WORTH_ORDER - 1, 1)]
)
def test_more_threads_where_they_pay(order, expected):
    for put, _ in settings():
        put(1)
    with blas_threads(2, order):
        assert set(numbers()) == {expected}
    assert set(numbers()) == {1}


def test_others_are_left_beside_a_blas_that_is_not_known(monkeypatch):
    monkeypatch.setattr(threads, "settings", list)
    with blas_threads(2, LARGE, dense=False):
        assert threads.THREADS.get() == 2
    assert threads.THREADS.get() == 1


def test_solves_at_once_restore_what_the_first_one_found():
    entered, leave = threading.Barrier(2), threading.Event()

    def other():
        with blas_threads(1, LARGE):
            entered.wait()
            leave.wait()

    thread = threading.Thread(target=other)
    with blas_threads(1, LARGE):
        thread.start()
        entered.wait()
    assert set(numbers()) == {1}  # the other one is not done
    leave.set()
    thread.join()
    assert set(numbers()) == {2}


def seen_inside(monkeypatch, solve):
    """Return the numbers of threads that were set while `solve` ran."""
    seen = []
    monkeypatch.setattr(
        threads,
        "put_threads",
        lambda put=threads.put_threads: (put(), seen.append(set(numbers()))),
    )
    assert solve().status.value == "solved"
    assert seen.pop() == {2}
    return seen


def test_solves_run_on_one_thread(monkeypatch):
    """All that may call BLAS: small dense QPs are solved by our own code alone."""
    n = LARGE
    P, q = np.eye(n), np.linspace(-1.0, 1.0, n)
    sparse = sp.csc_array(P)
    solves = (
        lambda: solve_qp(sparse, q, lb=np.zeros(n)),
        lambda: solve_qp(sparse, q, G=np.ones((1, n)), h=np.ones(1), threads=2),
        lambda: solve_lcp(P, q),
        lambda: solve_lcp(P, q, method="mgs"),
    )
    for solve in solves:
        with monkeypatch.context() as patch:
            assert seen_inside(patch, solve) == [{1}]


@pytest.mark.parametrize("form", [np.array, sp.csc_array])
def test_a_solver_makes_its_factors_on_one_thread(monkeypatch, form):
    """Those of P, and what solves: of a large dense QP that is the first solve."""
    n, is_dense, solvers = MOST_ORDER + 1, form is np.array, []

    def begin():
        P = form(np.eye(n) + is_dense)
        solvers.append(Solver(P, np.linspace(-1.0, 1.0, n), lb=-1.0))
        return solvers[0].solve()

    with monkeypatch.context() as patch:
        assert seen_inside(patch, begin)[::2] == [{1}] * (2 + is_dense)
    solvers[0].update(q=np.ones(n))
    with monkeypatch.context() as patch, pytest.raises(IndexError):
        seen_inside(patch, solvers[0].solve)  # needs no other factors
    assert set(numbers()) == {2}


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # from Python 3.12 on
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_a_child_of_fork_has_the_users_number():
    def in_a_child():
        read, write = os.pipe()
        child = os.fork()
        if child == 0:
            os.write(write, bytes(numbers()))
            os._exit(0)
        os.waitpid(child, 0)
        return set(os.read(read, 9))

    with blas_threads(1, LARGE):
        assert in_a_child() == {2}
    assert set(numbers()) == {2}
    for put, _ in settings():
        put(1)
    assert in_a_child() == {1}  # what was set after a solve
