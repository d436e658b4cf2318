"""The judge of the stress table on made-up answers; the problems' known solutions."""

from collections import Counter

import numpy as np
import pytest
import qpsolvers

from namlcp import Status, solve_qp
from namlcp.residuals import qp_residuals
from validation.problems.stress_cases import ROWS, Case, Point, natural, posed
from validation.stress import comparison


def answer(case, point, found=True, status="solved"):
    """Return what a host would, for a point of the posed problem."""
    solution = qpsolvers.Solution(posed(case), found=found, extras={"status": status})
    solution.x, solution.y, solution.z, solution.z_box = point
    return solution


def posed_point(case):
    """Return the planted point as a solver that sees the posed problem has it."""
    s, c, r, e = case.units
    x, y, z, z_box = case.point
    return Point(x / c, s * y / e, s * z / r, s * c * z_box)


@pytest.mark.parametrize("name", ROWS)
@pytest.mark.parametrize("seed", [0, 1, 9])
def test_planted_points_solve(name, seed):
    case = ROWS[name](seed)
    again = ROWS[name](seed)
    for one, other in zip(case.qp, again.qp, strict=True):
        np.testing.assert_array_equal(one, other)
    if case.point is None:  # a pile under gravity: NAM finds what the judge takes
        result = solve_qp(*case.qp)
        assert result.status is Status.SOLVED
        point = Point(result.x, result.y, result.z, result.z_box)
    else:
        assert qp_residuals(*case.qp, *case.point).solved(1e-13, 1e-13)
        there = posed_point(case)
        for one, other in zip(natural(case, there), case.point, strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-14)
        point = there
    row = comparison.judge(case, answer(case, point))
    assert row["outcome"] == "right"
    assert row.get("objective_error", 0.0) < 1e-12


def test_units_are_a_change_of_variables():
    case = ROWS["all times 10^(+-4)"](3)
    there, problem = posed_point(case), posed(case)
    seen = problem.P, problem.q, problem.G, problem.h, problem.A, problem.b
    found = qp_residuals(*seen, problem.lb, problem.ub, *there)
    assert found.solved(0.0, 1e-12)
    s, c, r, e = case.units
    assert {s, c[0], r[0], e[0]} <= {1e-4, 1e4}
    assert np.abs(problem.P / case.qp.P / (s * c[0] ** 2) - 1.0).max() < 1e-12
    assert case.units.smallest() == pytest.approx(
        min(1.0, r[0], e[0], 1.0 / c[0], s * c[0])
    )


def off(case, size):
    """Return the judged outcome of the planted point, x off by `size` in one entry."""
    x, *rest = posed_point(case)
    return comparison.judge(
        case, answer(case, (x + size * (np.arange(x.size) == 0), *rest))
    )


def test_outcomes_by_residual():
    case = ROWS["P of condition 1e0"](0)
    unit = 1.0 / off(case, 1.0)["excess"]  # the x that is just within tolerance
    assert off(case, 0.9 * unit)["outcome"] == "right"
    assert off(case, 9.0 * unit)["outcome"] == "inaccurate"
    assert off(case, 11.0 * unit)["outcome"] == "wrong"
    assert off(case, np.nan)["outcome"] == "wrong"


def test_signs_and_missing_multipliers_count():
    case = ROWS["LCP, half z = w = 0"](0)
    x, y, z, z_box = posed_point(case)
    assert (
        comparison.judge(case, answer(case, (x, None, None, z_box)))["outcome"]
        == "right"
    )
    for wrong in (-z_box, None):
        row = comparison.judge(case, answer(case, (x, y, z, wrong)))
        assert row["outcome"] == "wrong"


@pytest.mark.parametrize(
    ("said", "outcome"),
    [
        ("max_iter", "gave up"),
        ("", "gave up"),
        ("Status.PIQP_PRIMAL_INFEASIBLE", "wrong"),
        ("DualInfeasible", "wrong"),
        ("unbounded", "wrong"),
        ("AlmostPrimalInfeasible", "gave up"),
        ("primal infeasible inaccurate", "gave up"),
    ],
)
def test_what_is_said_without_a_point(said, outcome):
    case = ROWS["n = 1"](1)
    row = comparison.judge(case, answer(case, (None,) * 4, False, said))
    assert row["outcome"] == outcome


def test_table_and_shortfalls():
    outcomes = {
        "nam": ["right", "right", "wrong"],
        "piqp": ["right", "right", "right"],
        "osqp": ["gave up", "crash or hang", "inaccurate"],
    }
    rows = [
        {"row": "one", "seed": k, "solver": solver, "outcome": outcome}
        for solver, own in outcomes.items()
        for k, outcome in enumerate(own)
    ]
    assert comparison.counts(rows)["one", "osqp"] == Counter(outcomes["osqp"])
    assert "| one | 2/0/1/0 | 3 | 0/1/0/1/1 |" in comparison.markdown(rows)
    assert comparison.shortfalls(rows) == [
        "one: nam 2, piqp 3",
        "one: nam wrong 1 times",
    ]
    assert not comparison.shortfalls([row for row in rows if row["seed"] < 2])


def test_every_solver_has_settings():
    for solver in comparison.SOLVERS:
        known = comparison.settings(solver, 1e-3, 1.0)
        for key in comparison.ABSOLUTE.get(solver, ()):
            assert known[key] == max(
                1e-3 * comparison.EPS, comparison.LEAST.get(solver, 0.0)
            )
    nothing = Case(ROWS["empty"](1).qp)
    assert nothing.qp.q.size == 0
