"""What people model in CVXPY, through our door: statuses, signs, proofs, re-solves."""

import pickle
import subprocess
import sys

import cvxpy as cp
import numpy as np
import pytest
import scipy.sparse as sp
from cvxpy.error import SolverError
from cvxpy.reductions.solvers import defines

import namlcp
from namlcp.cvxpy import NAM, register

CVXPY = tuple(int(part) for part in cp.__version__.split(".")[:2])
EXACT = 1e-8


def portfolio(n=8):
    """Return a QP with equations, inequalities and a kink, and its variable."""
    rng = np.random.default_rng(0)
    F = rng.standard_normal((2 * n, n))
    x = cp.Variable(n)
    cost = cp.sum_squares(F @ x) - 3.0 * cp.sum(x[:3]) + cp.norm1(x - 0.1) + 5.0
    return cp.Problem(cp.Minimize(cost), [cp.sum(x) == 1, x >= 0, x[0] <= 0.2]), x


def data_of(problem):
    """Return what CVXPY hands over: P, q, A, b, F, g."""
    data, _, _ = problem.get_problem_data(NAM())
    return [data[key] for key in ("P", "q", "A", "b", "F", "G")]


def assert_proves_infeasible(problem):
    """Check the Farkas certificate on CVXPY's own data."""
    assert problem.solve(solver=NAM()) == np.inf
    assert problem.status == "infeasible"
    proof = problem.solver_stats.extra_stats["certificate"]
    _, _, A, b, F, g = data_of(problem)
    y, z = proof["y"], proof["z"]
    np.testing.assert_allclose(A.T @ y + F.T @ z, 0.0, atol=EXACT)
    assert (z >= 0.0).all()
    finite = np.isfinite(g)
    assert not z[~finite].any()
    assert b @ y + g[finite] @ z[finite] == pytest.approx(-1.0)
    if CVXPY >= (1, 9):  # 1.8 drops the duals of infeasible problems
        assert all(c.dual_value is not None for c in problem.constraints)


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


def test_an_unknown_attribute_of_the_package_is_an_attribute_error():
    with pytest.raises(AttributeError, match="'namlcp' has no attribute 'cvxpi'"):
        namlcp.cvxpi  # noqa: B018


def test_optimal_with_offset_and_multipliers_as_another_solver_has_them():
    problem, x = portfolio()
    value = problem.solve(solver=NAM())
    assert problem.status == "optimal"
    own = [x.value, *(c.dual_value for c in problem.constraints)]
    assert value == pytest.approx(problem.objective.value, abs=EXACT)
    tight = dict.fromkeys(("tol_gap_abs", "tol_gap_rel", "tol_feas"), 1e-11)
    assert value == pytest.approx(problem.solve(solver="CLARABEL", **tight), abs=1e-8)
    other = [x.value, *(c.dual_value for c in problem.constraints)]
    for ours, theirs in zip(own, other, strict=True):
        assert np.shape(ours) == np.shape(theirs)
        np.testing.assert_allclose(ours, theirs, atol=1e-6)


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


def test_contradictory_bounds_and_rows_come_with_a_proof():
    x = cp.Variable(5)
    upper = np.array([1.0, 1.0, -0.01, np.inf, 1.0])
    assert_proves_infeasible(cp.Problem(cp.Minimize(0), [x >= 0, x <= upper]))
    rows = [cp.sum(x) == 3, x >= 0, x[:2] <= 0.5, cp.sum(x[2:]) <= 1.0]
    assert_proves_infeasible(cp.Problem(cp.Minimize(cp.norm1(x)), rows))


def test_inconsistent_equations_come_with_a_proof():
    A = np.vstack([np.eye(3, 4), np.ones((1, 4)), [[0.0, 0.0, 0.0, 1.0]]])
    x = cp.Variable(4)
    rows = [A @ x == np.array([1.0, 1.0, 1.0, 4.0, 2.0])]
    assert_proves_infeasible(cp.Problem(cp.Minimize(cp.sum_squares(x)), rows))
    assert_proves_infeasible(cp.Problem(cp.Minimize(cp.sum(x)), rows))


def test_an_infinite_equation_is_infeasible():
    x = cp.Variable(2)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x == [1.0, np.inf], x >= 0])
    assert problem.solve(solver=NAM()) == np.inf
    assert problem.status == "infeasible"


def test_unbounded_comes_with_a_ray():
    x = cp.Variable(3)
    cost = cp.sum_squares(x[0] - x[1]) - cp.sum(x)
    problem = cp.Problem(cp.Minimize(cost), [x[2] <= 1, cp.sum(x[:2]) >= 0])
    assert problem.solve(solver=NAM()) == -np.inf
    assert problem.status == "unbounded"
    assert x.value is None
    P, q, _, _, F, _ = data_of(problem)
    ray = problem.solver_stats.extra_stats["ray"]
    np.testing.assert_allclose(P @ ray, 0.0, atol=EXACT)
    assert (F @ ray <= EXACT).all()
    assert q @ ray == pytest.approx(-1.0)
    problem = cp.Problem(cp.Maximize(cp.sum(x)), [x >= 0])
    assert problem.solve(solver=NAM()) == np.inf
    assert problem.status == "unbounded"


def test_what_has_a_ray_but_no_point_is_infeasible():
    x = cp.Variable(4)
    rows = [cp.sum(x[:3]) == 1, x[0] - 2 * x[1] == 3, x[2] == 1, 3 * x[1] == -4]
    assert_proves_infeasible(cp.Problem(cp.Minimize(x[3]), rows))
    rows = [x[0] + x[1] + x[2] <= 1, x[0] >= 1, x[1] >= 0.5, x[2] >= 0]
    assert_proves_infeasible(cp.Problem(cp.Minimize(x[3] + cp.norm1(x[:2])), rows))


@pytest.mark.parametrize("n", [2, 40])
def test_nonconvex_is_refused(n):
    x = cp.Variable(n)
    P = np.diag(np.append(np.ones(n - 1), -0.1))
    cost = cp.quad_form(x, cp.psd_wrap(P)) + cp.sum(x)
    problem = cp.Problem(cp.Minimize(cost), [x >= -1, x <= 1])
    with pytest.raises(SolverError, match="P must be positive semidefinite"):
        problem.solve(solver=NAM())


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

    monkeypatch.setattr("namlcp.cvxpy.solve_checked", fail)
    with pytest.raises(SolverError, match=r"namlcp failed: KeyError\('inside'\)"):
        portfolio()[0].solve(solver=NAM())


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        (
            {"maxiter": 3},
            TypeError,
            "unknown option 'maxiter'; did you mean 'max_iter'",
        ),
        ({"polish": True}, TypeError, "unknown option 'polish'; known: "),
        ({"eps_abs": -1.0}, ValueError, "eps_abs must be >= 0, got -1.0"),
        ({"max_iter": 1.5}, TypeError, "max_iter must be an integer"),
    ],
)
def test_bad_options_are_named(options, error, text):
    with pytest.raises(error, match=text):
        portfolio()[0].solve(solver=NAM(), **options)


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


def test_solver_stats():
    problem, _ = portfolio()
    problem.solve(solver=NAM())
    stats = problem.solver_stats
    assert stats.solver_name == "NAM"
    assert type(stats.num_iters) is int
    assert stats.solve_time > 0.0
    assert stats.setup_time > 0.0
    extra = stats.extra_stats
    assert extra["status"] == "solved"
    assert extra["message"] == namlcp.Status.SOLVED.explanation
    assert extra["form"] in ("dual", "bounds", "path", "face")
    assert extra["residuals"].solved(1e-9, 1e-10)


def test_nothing_is_printed_unless_asked(capsys):
    problem, _ = portfolio()
    problem.solve(solver=NAM())
    assert capsys.readouterr() == ("", "")
    problem.solve(solver=NAM(), solver_verbose=True)
    assert "namlcp  QP: n = " in capsys.readouterr().out


def test_equal_by_type():
    assert NAM() == NAM()
    assert hash(NAM()) == hash(NAM())
    assert NAM() != "NAM"
    assert NAM().MIP_CAPABLE is NAM().BOUNDED_VARIABLES is False
    assert NAM().cite({}).startswith("@misc{namlcp,")


def test_resolves_with_parameters_equal_fresh_solves():
    rng = np.random.default_rng(2)
    F, target = rng.standard_normal((12, 6)), cp.Parameter(12)
    weight = cp.Parameter(nonneg=True)
    x = cp.Variable(6)
    cost = cp.sum_squares(F @ x - target) + weight * cp.norm1(x)
    problem = cp.Problem(cp.Minimize(cost), [cp.sum(x) <= 1])
    chains = set()
    for weight.value in (3.0, 0.5, 0.0, 0.5, 1e4):  # 0 leaves explicit zeros
        target.value = rng.standard_normal(12)
        value = problem.solve(solver=NAM())
        assert problem.status == "optimal"
        chains.add(id(problem._cache.solving_chain))
        point = x.value
        fresh = cp.Problem(problem.objective, problem.constraints)
        assert fresh.solve(solver=NAM()) == pytest.approx(value, abs=1e-7)
        np.testing.assert_allclose(point, x.value, atol=1e-6)
    assert len(chains) == 1  # inline instances do not recompile


def test_resolves_with_matrices_that_change_and_hold_explicit_zeros():
    rng = np.random.default_rng(5)
    x, y = cp.Variable(4), cp.Variable()
    F, gamma = cp.Parameter((3, 4)), cp.Parameter(nonneg=True)
    cost = gamma * cp.sum_squares(x - y) + cp.norm1(x) - 0.5 * y
    problem = cp.Problem(cp.Minimize(cost), [F @ x <= 1, cp.sum(x) == y, y <= 2])
    dense = rng.standard_normal((3, 4))
    for F.value, gamma.value in (
        (dense, 1.0),
        (dense, 2.0),
        (np.where(dense > 0.0, dense, 0.0), 2.0),
        (dense, 0.0),
        (np.zeros((3, 4)), 0.0),
        (dense, 1.0),
    ):
        value = problem.solve(solver=NAM())
        assert problem.status == "optimal"
        fresh = cp.Problem(problem.objective, problem.constraints)
        assert fresh.solve(solver=NAM()) == pytest.approx(value, abs=EXACT)


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
    q.value += 1e-3
    problem.solve(solver=NAM())
    assert problem.solver_stats.num_iters < cold
    problem.solve(solver=NAM(), warm_start=False)
    assert problem.solver_stats.num_iters == cold


def test_a_resolve_of_another_size_starts_cold():
    rows = cp.Parameter(2, value=[1.0, 1.0])
    problem, _ = portfolio()
    problem.solve(solver=NAM())
    cache = problem._solver_cache
    x = cp.Variable(3)
    other = cp.Problem(cp.Minimize(cp.sum_squares(x)), [x[:2] >= rows])
    data, chain, _ = other.get_problem_data(NAM())
    result = chain.solver.solve_via_data(data, True, False, {}, cache)
    np.testing.assert_allclose(result.x, [1.0, 1.0, 0.0], atol=EXACT)


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


def test_lps_with_and_without_a_unique_solution():
    x = cp.Variable(3)
    problem = cp.Problem(cp.Minimize(x @ [1.0, 2.0, 3.0]), [x >= 0, cp.sum(x) == 1])
    assert problem.solve(solver=NAM()) == pytest.approx(1.0, abs=EXACT)
    np.testing.assert_allclose(x.value, [1.0, 0.0, 0.0], atol=EXACT)
    problem = cp.Problem(cp.Maximize(cp.sum(x)), [x >= 0, x <= 1, cp.sum(x) <= 2])
    assert problem.solve(solver=NAM()) == pytest.approx(2.0, abs=EXACT)
    assert cp.Problem(cp.Minimize(0), [x >= 1]).solve(solver=NAM()) == 0.0


def test_dependent_equations():
    rng = np.random.default_rng(4)
    A = rng.standard_normal((3, 8))
    A = np.vstack([A, A[0] - 2.0 * A[1], np.zeros(8), A[2]])
    x, point = cp.Variable(8), rng.random(8)
    for cost in cp.sum_squares(x), cp.norm1(x), cp.sum_squares(A[:2] @ x - 1):
        problem = cp.Problem(cp.Minimize(cost), [A @ x == A @ point, x >= 0])
        value = problem.solve(solver=NAM())
        assert problem.status == "optimal"
        np.testing.assert_allclose(A @ x.value, A @ point, atol=EXACT)
        assert (x.value >= -EXACT).all()
        assert value == pytest.approx(problem.solve(solver="CLARABEL"), abs=1e-6)


def test_infinite_sides_switch_rows_off():
    x = cp.Variable(4)
    upper = np.array([0.5, np.inf, 0.5, np.inf])
    lower = np.array([-np.inf, -np.inf, 2.0, 2.0])
    cost = cp.sum_squares(x - 1.0)
    rows = [x <= upper, x[::-1] >= lower[::-1] - np.array([0.0, 9.0, 0.0, 0.0])]
    problem = cp.Problem(cp.Minimize(cost), rows)
    assert problem.solve(solver=NAM()) == pytest.approx(0.25 + 0.25 + 1.0)
    assert rows[0].dual_value[1] == 0.0
    np.testing.assert_allclose(x.value, [0.5, 1.0, 0.5, 2.0], atol=EXACT)


def test_without_constraints_and_with_a_matrix_variable():
    X = cp.Variable((3, 2))
    C = np.arange(6.0).reshape(3, 2)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(X - C) + 2.0))
    assert problem.solve(solver=NAM()) == pytest.approx(2.0)
    np.testing.assert_allclose(X.value, C, atol=EXACT)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(X)), [X >= C])
    problem.solve(solver=NAM())
    np.testing.assert_allclose(X.value, C, atol=EXACT)
    np.testing.assert_allclose(problem.constraints[0].dual_value, 2.0 * C, atol=EXACT)


def test_the_hosts_data_are_left_alone():
    problem, _ = portfolio()
    data, chain, _ = problem.get_problem_data(NAM())
    before = {k: v.copy() for k, v in data.items() if hasattr(v, "copy")}
    chain.solver.solve_via_data(data, True, False, {}, None)
    for key, value in before.items():
        if sp.issparse(value):
            assert (value != data[key]).nnz == 0
        elif isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, data[key])


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
