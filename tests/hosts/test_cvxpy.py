"""What CVXPY alone has: duals of models, re-solves, stats, registration."""

import pickle
import subprocess
import sys

import cvxpy as cp
import numpy as np
import pytest
from cvxpy.error import SolverError
from cvxpy.reductions.solvers import defines

import namlcp
from namlcp.cvxpy import NAM, register

EXACT = 1e-8


def portfolio(n=8):
    """Return a QP with equations, inequalities and a kink, and its variable."""
    rng = np.random.default_rng(0)
    F = rng.standard_normal((2 * n, n))
    x = cp.Variable(n)
    cost = cp.sum_squares(F @ x) - 3.0 * cp.sum(x[:3]) + cp.norm1(x - 0.1) + 5.0
    return cp.Problem(cp.Minimize(cost), [cp.sum(x) == 1, x >= 0, x[0] <= 0.2]), x


def test_import_of_the_package_does_not_import_cvxpy():
    code = (
        "import qpsolvers, sys\n"
        "before = 'cvxpy' in sys.modules\n"
        "import namlcp\n"
        "assert ('cvxpy' in sys.modules) == before\n"
        "assert 'namlcp.cvxpy' not in sys.modules\n"
        "assert namlcp.cvxpy.NAM().name() == 'NAM'\n"
        "assert 'cvxpy' in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("goal", [cp.Minimize, cp.Maximize])
def test_duals_are_gradients_of_the_optimal_value(goal):
    rng = np.random.default_rng(1)
    x = cp.Variable(4)
    sides = [cp.Parameter(value=1.0), cp.Parameter(2, value=[0.3, 5.0])]
    sides.append(cp.Parameter(4, value=[0.1, -2.0, 0.2, -2.0]))
    sign = 1.0 if goal is cp.Minimize else -1.0
    cost = sign * (cp.sum_squares(rng.standard_normal((6, 4)) @ x - 2.0))
    B = rng.standard_normal((2, 4))
    rows = [cp.sum(x) == sides[0], B @ x <= sides[1], x >= sides[2]]
    problem = cp.Problem(goal(cost), rows)
    problem.solve(solver=NAM())
    duals = [np.atleast_1d(row.dual_value) for row in rows]
    assert any((dual > 0.1).any() for dual in duals[1:])
    # value(side) of <= falls with the side, of >= it grows, of == by the host's sign
    for side, dual, grows in zip(sides, duals, (-1.0, -1.0, 1.0), strict=True):
        for i in range(side.size):
            step = np.zeros(side.size)
            step[i] = 1e-5
            values = []
            middle = side.value
            for move in step, -step:
                side.value = middle + (move if side.ndim else move[0])
                values.append(problem.solve(solver=NAM()))
            side.value = middle
            gradient = (values[0] - values[1]) / 2e-5
            assert gradient == pytest.approx(sign * grows * dual[i], abs=1e-5)


def test_an_infinite_equation_is_infeasible():
    x = cp.Variable(2)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x == [1.0, np.inf], x >= 0])
    assert problem.solve(solver=NAM()) == np.inf
    assert problem.status == "infeasible"


def test_maximised_without_bound_and_with_a_matrix_variable():
    X, C = cp.Variable((3, 2)), np.arange(6.0).reshape(3, 2)
    assert cp.Problem(cp.Maximize(cp.sum(X)), [X >= 0]).solve(solver=NAM()) == np.inf
    problem = cp.Problem(cp.Minimize(cp.sum_squares(X) + 2.0), [X >= C])
    assert problem.solve(solver=NAM()) == pytest.approx(57.0)
    np.testing.assert_allclose(X.value, C, atol=EXACT)
    np.testing.assert_allclose(problem.constraints[0].dual_value, 2.0 * C, atol=EXACT)


def test_what_is_no_qp_is_refused():
    x = cp.Variable(2, integer=True)
    with pytest.raises(SolverError):
        cp.Problem(cp.Minimize(cp.sum(x)), [x >= 0.5]).solve(solver=NAM())
    x = cp.Variable(2)
    with pytest.raises(SolverError):
        cp.Problem(cp.Minimize(cp.norm2(x - 1))).solve(solver=NAM())


def test_whatever_the_solver_throws_is_a_solver_error(monkeypatch):
    def fail(*_, **__):
        raise KeyError("inside")

    monkeypatch.setattr("namlcp.cvxpy.solve_arguments", fail)
    with pytest.raises(SolverError, match=r"namlcp failed: KeyError\('inside'\)"):
        portfolio()[0].solve(solver=NAM())


def test_options_reach_the_solver_and_a_limit_leaves_a_usable_point():
    problem, x = portfolio(30)
    best = problem.solve(solver=NAM(), eps_abs=1e-6, eps_rel=0.0, time_limit=100.0)
    problem, x = portfolio(30)
    with pytest.warns(UserWarning, match="may be inaccurate"):
        value = problem.solve(solver=NAM(), max_iter=1, eps_abs=1e-12, eps_rel=0.0)
    assert problem.status == "user_limit"
    assert np.isfinite(x.value).all()
    assert value == pytest.approx(problem.objective.value)
    assert abs(value - best) < 100.0
    assert "Iteration limit" in problem.solver_stats.extra_stats["message"]


@pytest.mark.parametrize("ignore_dpp", [False, True])
def test_resolves_are_those_of_fresh_problems(ignore_dpp):
    """Vectors, weights and matrices change, to explicit zeros too, and to none."""
    rng = np.random.default_rng(2)
    F, target, x = rng.standard_normal((12, 6)), cp.Parameter(12), cp.Variable(6)
    G, weight = cp.Parameter((3, 6)), cp.Parameter(nonneg=True)
    cost = cp.sum_squares(F @ x - target) + weight * cp.norm1(x)
    problem = cp.Problem(cp.Minimize(cost), [cp.sum(x) <= 1, G @ x <= 1])
    chains, dense = set(), rng.standard_normal((3, 6))
    for weight.value, G.value in (
        (3.0, dense), (0.5, dense), (0.0, dense), (0.5, np.maximum(dense, 0.0)),
        (1e4, np.zeros((3, 6))), (1.0, dense),
    ):  # fmt: skip
        target.value = rng.standard_normal(12)
        value = problem.solve(solver=NAM(), ignore_dpp=ignore_dpp)
        assert problem.status == "optimal"
        chains.add(id(problem._cache.solving_chain))
        point = x.value
        fresh = cp.Problem(problem.objective, problem.constraints)
        assert fresh.solve(solver=NAM()) == pytest.approx(value, abs=1e-7)
        np.testing.assert_allclose(point, x.value, atol=1e-6)
    assert len(chains) == 1  # inline instances do not recompile


@pytest.mark.parametrize("solves", [1, 2, 3])
def test_a_resolve_of_another_size_starts_cold(solves):
    problem, _ = portfolio()
    for _ in range(solves):
        problem.solve(solver=NAM())
    cache, x = problem._solver_cache, cp.Variable(3)
    other = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x[:2] >= np.ones(2)])
    data, chain, _ = other.get_problem_data(NAM())
    result = chain.solver.solve_via_data(data, True, False, {}, cache)
    np.testing.assert_allclose(result.x, [1.0, 1.0, 0.0], atol=EXACT)


@pytest.mark.parametrize(
    ("terms", "status", "value"),
    [
        ({"cost": 1.0}, "optimal", 3.0),
        ({"slope": 1.0}, "unbounded", -np.inf),
        ({}, "optimal", 0.0),
        ({"rows": np.zeros((0, 3))}, "optimal", 0.0),
        ({"cost": 1.0, "side": 2.0}, "optimal", 3.0),
        ({"cost": 1.0, "side": -1.0}, "infeasible", np.inf),
    ],
)
def test_nothing_may_be_left_of_a_problem(terms, status, value):
    """No cost, no variable, no row, or one without variables."""
    x, side = cp.Variable(3), cp.Parameter(value=terms.get("side", 0.0))
    cost = terms.get("cost", 0.0) * cp.sum_squares(x) + terms.get("slope", 0) * x[0]
    rows = [terms["rows"] @ x == 0.0] if "rows" in terms else []
    rows += [0.0 * x[1] + cp.Constant(0.0) <= side] if "side" in terms else []
    offset = 3.0 if "cost" in terms else 0.0
    problem = cp.Problem(cp.Minimize(cost + offset), rows)
    for _ in range(3):
        assert problem.solve(solver=NAM()) == pytest.approx(value)
        assert problem.status == status


def test_stats_and_what_the_solver_says_of_itself():
    problem, _ = portfolio()
    problem.solve(solver=NAM())
    stats = problem.solver_stats
    assert stats.solver_name == "NAM"
    assert type(stats.num_iters) is int
    assert min(stats.solve_time, stats.setup_time) > 0.0
    assert stats.extra_stats["message"] == namlcp.Status.SOLVED.explanation
    assert stats.extra_stats["residuals"].solved(1e-9, 1e-10)
    assert NAM() == NAM() != "NAM"
    assert hash(NAM()) == hash(NAM())
    assert NAM().MIP_CAPABLE is NAM().BOUNDED_VARIABLES is False
    assert NAM().cite({}).startswith("@misc{namlcp,")


def test_resolves_pass_through_infeasible_and_unbounded():
    low, slope = cp.Parameter(value=0.0), cp.Parameter(value=1.0)
    x = cp.Variable(2)
    problem = cp.Problem(cp.Minimize(slope * cp.sum(x)), [x >= low, x[0] <= 1])
    expected = ["optimal", "infeasible", "optimal", "unbounded", "optimal"]
    seen = []
    for low.value, slope.value in (0, 1), (2, 1), (0, 1), (0, -1), (0.5, 1):
        problem.solve(solver=NAM())
        seen.append(problem.status)
    assert seen == expected
    assert problem.value == pytest.approx(1.0)


def test_a_resolve_starts_from_the_last_point():
    rng = np.random.default_rng(3)
    F, q = rng.standard_normal((40, 20)), cp.Parameter(20)
    x = cp.Variable(20)
    cost = 0.5 * cp.quad_form(x, cp.psd_wrap(F.T @ F)) + q @ x
    problem = cp.Problem(cp.Minimize(cost), [x >= 0, x <= 0.1])
    q.value = 10.0 * rng.standard_normal(20)
    problem.solve(solver=NAM())
    cold = problem.solver_stats.num_iters
    kept = []
    for _ in range(3):
        q.value += 1e-3
        problem.solve(solver=NAM())
        kept.append(problem._solver_cache["NAM"])
        assert problem.solver_stats.num_iters < cold
    assert kept[0] is kept[1] is kept[2]
    problem.solve(solver=NAM(), warm_start=False)
    assert problem.solver_stats.num_iters == cold


def test_a_solved_problem_can_be_sent_to_workers():
    problem, _ = portfolio()
    value = problem.solve(solver=NAM())
    twin = pickle.loads(pickle.dumps(problem))
    assert twin.solve(solver=NAM()) == pytest.approx(value, abs=EXACT)


def test_by_name_after_register():
    default = cp.Problem(cp.Minimize(cp.sum_squares(cp.Variable(2) - 1)))
    register()
    register()
    assert cp.installed_solvers().count("NAM") == 1
    assert defines.QP_SOLVERS.count("NAM") == 1
    problem, _ = portfolio()
    value = problem.solve(solver="nam")
    assert problem.solver_stats.solver_name == "NAM"
    assert problem.solve(solver=NAM()) == pytest.approx(value, abs=EXACT)
    default.solve()
    assert default.solver_stats.solver_name == "OSQP"


def test_values_of_the_closest_point_of_an_infeasible_problem():
    x = cp.Variable(2)
    rows = [x[0] <= 0.0, x[0] >= 3.0, x[1] == 1.0]
    problem = cp.Problem(cp.Minimize(cp.sum_squares(x)), rows)
    with pytest.warns(UserWarning, match="Solution may be inaccurate"):
        problem.solve(solver=NAM(), infeasible="closest")
    assert problem.status == "user_limit"
    np.testing.assert_allclose(x.value, [1.5, 1.0], atol=1e-9)
    assert problem.value == pytest.approx(3.25)
    extra = problem.solver_stats.extra_stats
    assert extra["status"] == "primal_infeasible"
    np.testing.assert_allclose(np.sort(extra["closest"].shift_h), [1.5, 1.5])
    np.testing.assert_allclose(rows[0].violation(), 1.5)
    problem.solve(solver=NAM())
    assert problem.status == "infeasible"
