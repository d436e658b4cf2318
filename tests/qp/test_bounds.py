"""QPs with bounds alone."""

import numpy as np
import pytest
from scipy.sparse import block_diag, csc_array, diags_array, random_array

from namlcp import Status, solve_qp
from namlcp.qp.answer import out_of_time


@pytest.mark.parametrize("off", [0.5, 2.0])
def test_curvature_of_fixed_variables_counts_in_large_problems(off):
    """P is factored in blocks here; the two fixed variables are part of it."""
    n = 3300
    bands = [np.ones(n - 2 - k) for k in (1, 2, 3)]
    offsets = [1, 2, 3, -1, -2, -3]
    large = diags_array([*bands, *bands], offsets=offsets, shape=(n - 2, n - 2))
    large = large + diags_array(np.full(n - 2, 8.0))
    P = csc_array(block_diag((large, np.array([[1.0, off], [off, 1.0]]))))
    q, lb, ub = -np.ones(n), np.zeros(n), np.ones(n)
    ub[-2:] = 0.0
    if off < 1.0:
        result = solve_qp(P, q, lb=lb, ub=ub)
        assert result.status is Status.SOLVED
        assert result.form == "bounds"
    else:
        with pytest.raises(ValueError, match="P must be positive semidefinite"):
            solve_qp(P, q, lb=lb, ub=ub)


@pytest.mark.parametrize("off", [0.6, 0.8])
@pytest.mark.parametrize("at", [0, 100, 197])
def test_curvature_is_judged_in_the_whole_block_of_a_bounded_variable(off, at):
    """Of three variables in a row the first is bounded, so that no pair shows it."""
    chain = diags_array([1.0, off, off], offsets=[0, 1, -1], shape=(3, 3))
    others = [2.0 * np.eye(1)] * 197
    P = csc_array(block_diag([*others[:at], chain, *others[at:]]))
    q, lb = np.full(200, -1.0), np.zeros(200)
    q[at], lb[at + 1 :] = 10.0, -10.0
    if off < 0.7:  # the least eigenvalue is 1 - sqrt(2) off
        result = solve_qp(P, q, lb=lb)
        assert (result.status, result.form) == (Status.SOLVED, "bounds")
        assert result.x[at] == 0.0
        assert np.all(result.x[at + 1 : at + 3] > 0.0)
    else:
        with pytest.raises(ValueError, match="P must be positive semidefinite"):
            solve_qp(P, q, lb=lb)


@pytest.mark.parametrize("off", [0.5, 1.0, 1.00001, 2.0])
@pytest.mark.parametrize("free", [True, False])
def test_curvature_is_judged_with_all_variables_free_or_not(off, free):
    """Free variables factor all of P already; the last two are those of `off`."""
    n = 200
    coupled = np.array([[1.0, off], [off, 1.0]])
    P = csc_array(block_diag((diags_array(np.full(n - 2, 2.0)), coupled)))
    q, bound = np.full(n, -1.0), np.full(n, 10.0)
    bound[0] = 10.0 if free else 0.1
    if off <= 1.0:
        result = solve_qp(P, q, lb=-bound, ub=bound)
        assert result.status is Status.SOLVED
        assert result.form == "bounds"
        assert np.allclose(P @ result.x + q, -result.z_box)
        assert (result.z_box[1:] == 0.0).all()
        assert (result.z_box[0] == 0.0) is np.bool_(free)
    else:
        with pytest.raises(ValueError, match="P must be positive semidefinite"):
            solve_qp(P, q, lb=-bound, ub=bound)


def test_terms_near_1e7_leave_a_gap_that_is_corrected():
    """The gap of the rounded x is some units of its terms, above the tolerance."""
    rng = np.random.default_rng(9)  # one of five seeds that miss it otherwise
    n = 120
    band = rng.uniform(-0.4, 0.4, n - 1)
    P = csc_array(diags_array([band, np.ones(n), band], offsets=[-1, 0, 1]))
    q = 1e3 * rng.standard_normal(n)
    result = solve_qp(P, q, lb=np.zeros(n), eps_abs=1e-9, eps_rel=0.0)
    assert result.residuals.gap_size > 1e7
    assert result.status is Status.SOLVED
    assert result.form == "bounds"


@pytest.mark.parametrize("n", [60, 300])
def test_short_way_gives_what_the_general_one_does(n):
    """With history= a solve goes the general way; P is singular, some bounds absent."""
    rng = np.random.default_rng(n)
    B = random_array((n // 2, n), density=3.0 / n, rng=rng, format="csc")
    P = csc_array(B.T @ B)
    q = P @ rng.standard_normal(n)
    lb, ub = np.full(n, -0.5), rng.uniform(0.1, 1.0, n)
    ub[::7] = 1e30
    short = solve_qp(P, q, lb=lb, ub=ub)
    general = solve_qp(P, q, lb=lb, ub=ub, history=True)
    assert short.status is general.status is Status.SOLVED
    assert short.residuals.solved(1e-9, 1e-10)
    assert abs(short.obj - general.obj) <= 1e-9 * (1.0 + abs(general.obj))


def test_ctrl_c_in_the_short_way_is_not_lost(monkeypatch):
    def pressed(qp, guess, limits, memory):
        limits.deadline.interrupted = True
        return out_of_time(qp)._replace(status=Status.STALLED)

    monkeypatch.setattr("namlcp.qp.solve.solve_smallest_form", pressed)
    n = 60
    with pytest.raises(KeyboardInterrupt):
        solve_qp(csc_array(diags_array(np.ones(n))), np.ones(n), lb=np.zeros(n))


@pytest.mark.parametrize("status", [Status.STALLED, Status.MAX_ITER])
def test_what_the_short_way_leaves_undecided_is_not_solved_again(monkeypatch, status):
    solves = []

    def undecided(qp, guess, limits, memory):
        solves.append(qp)
        return out_of_time(qp)._replace(status=status)

    monkeypatch.setattr("namlcp.qp.solve.solve_smallest_form", undecided)
    n = 60
    result = solve_qp(csc_array(diags_array(np.ones(n))), np.ones(n), lb=np.zeros(n))
    assert result.status is status
    assert len(solves) == 1
