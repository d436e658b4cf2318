"""The scripts that check and measure derivatives, on a few small problems."""

import numpy as np
import pytest

from namlcp.qp import QP
from validation.derivatives import cases, differences, packages


def test_all_rows_of_the_oracle_are_right():
    rows = list(differences.rows(4, 2))
    assert len(rows) == 4 + sum(len(names) for names in cases.KINKS.values())
    for row in rows:
        assert row["right"] == row["problems"], row


def test_elimination_is_more_accurate_than_double_precision():
    K = cases.definite(12, np.random.default_rng(0))
    x = np.arange(1.0, 13.0)
    rest = K.astype(np.longdouble) @ differences.extended_solve(K, K @ x) - K @ x
    assert np.abs(rest).max() <= 1e-17 * 1e2


@pytest.mark.parametrize("seed", range(4))
def test_regular_problems_are_solved_by_the_equations_of_their_active_set(seed):
    """16 variables: 4 bounds, 2 pinned, 3 rows and 2 equalities hold."""
    qp = cases.regular_qp(seed, scale=1e4)
    pinned = qp.lb == qp.ub
    assert pinned.sum() == 2
    d = cases.direction(qp, seed)
    assert np.array_equal(d["P"], d["P"].T)
    assert np.array_equal(d["lb"][pinned], d["ub"][pinned])
    assert isinstance(cases.moved(qp, d, 1e-3), QP)


@pytest.mark.parametrize("case", ["dense", "band"])
def test_our_gradients_are_those_of_the_reference(case):
    data = packages.dense_case(8) if case == "dense" else packages.band_case(60)
    solve, backward = packages.nam(data)
    assert packages.error_of(backward(solve()), packages.reference(data)) <= 1e-12


def test_the_rows_of_the_obstacle_hold_the_residual():
    row = packages.obstacle_row("obstacle", 400, seconds=0.0)
    assert row["error"] <= 1e-11
