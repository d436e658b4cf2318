"""What is kept from one QP for the next changes the effort, never the answer."""

import numpy as np
import pytest
from problems_qp import assert_solves_qp, complementary, residual_form

from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.guess import NO_GUESS, make_guess
from namlcp.qp.memory import Memory
from namlcp.qp.solve import solve_checked
from namlcp.status import Status


def solve(qp, guess=NO_GUESS, memory=None):
    return solve_checked(qp, DEFAULT_OPTIONS, guess, 0.0, memory=memory)


def changed(qp, rng, kind):
    if kind == "vectors":
        return qp._replace(
            q=qp.q + 0.01 * rng.standard_normal(qp.q.size), h=qp.h + 0.01 * rng.random()
        )
    if kind == "values":
        P = qp.P.copy()
        P.data = P.data * (1.0 + 0.1 * rng.random())
        return qp._replace(P=P)
    if kind == "side":
        h = qp.h.copy()
        h[rng.integers(h.size)] = np.inf
        return qp._replace(h=h)
    lb = qp.lb.copy()
    lb[-1] = rng.random() if np.isinf(lb[-1]) else -np.inf
    return qp._replace(lb=lb)


@pytest.mark.parametrize("weight", [0.0, 0.3])
def test_memory_changes_nothing_but_the_effort(weight):
    """Whatever changes between two problems, the answer is that of a fresh solve."""
    rng = np.random.default_rng(0)
    qp, _, _ = residual_form(5, 30, 8, lower=0.0, weight=weight)
    memory, last = Memory(), None
    kinds = ["vectors", "values", "vectors", "side", "vectors", "bound", "vectors"]
    for kind in 2 * kinds:
        qp = changed(qp, rng, kind)
        fresh = solve(qp)
        result = solve(qp, make_guess(qp, None, last), memory)
        assert_solves_qp(qp, result, 1e-10)
        assert result.obj == pytest.approx(fresh.obj, abs=1e-10)
        last = result


def test_memory_keeps_the_factors_of_an_unchanged_face(monkeypatch):
    monkeypatch.setattr("namlcp.qp.forms.solve_once", lambda *arguments: None)
    qp, _, _ = residual_form(6, 30, 40, lower=0.0)
    qp = qp._replace(q=qp.q + 0.1)
    memory = Memory()
    first = solve(qp, memory=memory)
    assert first.form == "path"
    solve(qp, make_guess(qp, None, first), memory)
    kkt = memory.scaled.kkt
    calls = []
    refactor = kkt.factors.refactor

    class Counting:
        solve = kkt.factors.solve

        def refactor(self, *args, **kwargs):
            calls.append(1)
            refactor(*args, **kwargs)

    kkt.factors = Counting()
    moved = qp._replace(q=qp.q * (1.0 + 1e-9))
    result = solve(moved, make_guess(moved, None, first), memory)
    assert result.status is Status.SOLVED
    assert result.iterations == 0
    assert memory.scaled.kkt is kkt
    assert not calls
    solve(changed(qp, np.random.default_rng(0), "values"), memory=memory)
    assert calls


def test_memory_sees_a_matrix_changed_in_place():
    qp, _, _ = residual_form(8, 30, 40, lower=0.0)
    memory = Memory()
    for factor in (1.0, 3.0, 0.2):
        qp.A.data *= factor
        assert_solves_qp(qp, solve(qp, memory=memory), 1e-10)


def test_memory_of_another_problem_is_forgotten():
    memory = Memory()
    for seed, n in ((0, 20), (1, 20), (2, 11)):
        known = complementary(seed, n, 2 * n, 3, n // 2, 0.3)
        assert_solves_qp(known.qp, solve(known.qp, memory=memory), 1e-10)


def test_memory_does_not_believe_a_matrix_whose_indices_moved():
    qp, _, _ = residual_form(10, 30, 40, lower=0.0)
    memory = Memory()
    original = qp._replace(A=qp.A.copy())
    solve(qp, memory=memory)
    first = qp.A.indptr[30]  # swap the rows of two entries of x_0, in place
    a, b = qp.A.indices[first], qp.A.indices[first + 1]
    qp.A.data[first : first + 2] = qp.A.data[first : first + 2][::-1].copy()
    assert a < b
    assert_solves_qp(original, solve(original, memory=memory), 1e-10)
    assert_solves_qp(qp, solve(qp, memory=memory), 1e-10)


def test_memory_sees_a_side_that_becomes_finite_in_place():
    known = complementary(4, 10, 14, 2, 10)
    qp, memory = known.qp, Memory()
    h = qp.h.copy()
    qp.h[3:6] = np.inf
    solve(qp, memory=memory)
    qp.h[:] = h
    assert_solves_qp(qp, solve(qp, memory=memory), 1e-10)
