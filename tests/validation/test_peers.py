"""Beside other solvers: the classes of the OSQP paper, and closest points."""

import numpy as np
import pytest
import scipy.sparse as sp

import namlcp
from namlcp import Status, solve_qp
from validation.derivatives import closest
from validation.harness import qps
from validation.peers import classes, runs
from validation.problems import osqp_classes
from validation.problems.osqp_classes import CLASSES, ENTRIES, POINTS, STAGES, generate
from validation.problems.sequences import condensed, stagewise


def solved(name):
    """Return the smallest problem of a class and its solution."""
    problem = generate(name, CLASSES[name].sizes[0])
    result = solve_qp(*problem.unpack())
    assert result.status is Status.SOLVED
    return problem, result


@pytest.mark.parametrize("name", CLASSES)
def test_sizes_and_seeds(name):
    for wanted, size in zip(ENTRIES[:3], CLASSES[name].sizes, strict=False):
        problem = generate(name, size)
        assert abs(osqp_classes.entries(problem) / wanted - 1.0) < 0.25
    again = generate(name, size)
    np.testing.assert_array_equal(problem.q, again.q)
    for M, same in ((problem.P, again.P), (problem.A, again.A), (problem.G, again.G)):
        assert M is None or (M != same).nnz == 0
        assert M is None or np.all(M.data != 0.0)


@pytest.mark.parametrize("name", CLASSES)
def test_every_class_has_a_solution(name):
    solved(name)


def test_random_and_equality_constrained():
    problem = generate("random", 18)
    assert problem.G.shape == (360, 18)
    assert np.all(problem.h >= 0.0)  # so that 0 is feasible
    assert np.linalg.eigvalsh(problem.P.toarray())[0] >= 0.99 * osqp_classes.SHIFT
    problem = generate("equality", 40)
    assert problem.A.shape == (20, 40)
    assert problem.G is problem.lb is problem.ub is None


def test_portfolio():
    problem, result = solved("portfolio")
    factors, n = 3, 3 * POINTS
    x, y = result.x[:n], result.x[n:]
    assert x.sum() == pytest.approx(1.0)
    F = problem.A[1:, :n].T
    np.testing.assert_allclose(F.T @ x, y, atol=1e-9)
    assert problem.A.shape == (1 + factors, n + factors)
    assert np.all(problem.P.diagonal()[:n] <= np.sqrt(factors))


def test_lasso_is_its_own_formula():
    problem, result = solved("lasso")
    n, m = 4, 4 * POINTS
    C, d, weight = problem.A[:, :n], problem.b, problem.q[-1]
    x = result.x[:n]
    value = 0.5 * np.sum((C @ x - d) ** 2) + weight * np.abs(x).sum()
    assert result.obj == pytest.approx(value)
    assert weight == pytest.approx(np.abs(C.T @ d).max() / 5.0)
    assert problem.q.size == 2 * n + m


def test_svm_is_its_own_formula():
    problem, result = solved("SVM")
    n, m = 6, 6 * POINTS
    margins = problem.G[:, :n]  # diag(s) C
    x = result.x[:n]
    hinge = np.maximum(margins @ x + 1.0, 0.0)
    assert result.obj == pytest.approx(0.5 * x @ x + hinge.sum())
    # the points of both labels lean to the same side of t >= diag(s) C x + 1
    assert margins[: m // 2].data.mean() > 0.0
    assert margins[m // 2 :].data.mean() > 0.0


def test_huber_is_its_own_formula():
    problem, result = solved("Huber")
    C, d = problem.A[:, :2], problem.b
    error = np.abs(C @ result.x[:2] - d)
    loss = np.where(error <= 1.0, error**2, 2.0 * error - 1.0)
    assert result.obj == pytest.approx(loss.sum())
    assert 0.01 < np.mean(error > 1.5) < 0.15


def test_control_is_a_simulation():
    problem, result = solved("control")
    n, inputs = 8, 4
    states = result.x[: (STAGES + 1) * n].reshape(-1, n)
    forces = result.x[(STAGES + 1) * n :].reshape(-1, inputs)
    F = problem.A[n : 2 * n, :n].toarray()
    B = problem.A[n : 2 * n, (STAGES + 1) * n :][:, :inputs].toarray()
    np.testing.assert_allclose(states[0], -problem.b[:n], atol=1e-12)
    for now, after, force in zip(states, states[1:], forces, strict=False):
        np.testing.assert_allclose(F @ now + B @ force, after, atol=1e-8)
    assert np.abs(np.linalg.eigvals(F)).max() < 1.0
    x = states[0]
    for _ in range(STAGES):  # without inputs the states stay inside
        x = F @ x
        assert np.all(np.abs(x) <= problem.ub[:n] * (1.0 + 1e-12))
    last = problem.P[STAGES * n : (STAGES + 1) * n, STAGES * n : (STAGES + 1) * n]
    assert np.linalg.eigvalsh(last.toarray())[0] > 0.0
    assert sp.issparse(problem.P)


def row(name, size, solver, runtime, status="solved"):
    """Return a row as a run writes it."""
    return {
        "set": name, "problem": size, "solver": solver, "eps": 1e-6, "entries": 1000,
        "runtime": runtime, "cold": 2.0 * runtime, "status": status,
        "success": status == "solved",
    }  # fmt: skip


def test_the_best_peer_is_chosen_problem_by_problem(capsys):
    rows = [
        row("SVM", "6", "nam", 1e-3),
        row("SVM", "6", "piqp", 2e-3),
        row("SVM", "6", "osqp", 1e-4, "inaccurate"),
        row("SVM", "22", "nam", 8e-3),
        row("SVM", "22", "piqp", 2e-3),
        row("SVM", "22", "osqp", 1e-3),
        row("lasso", "4", "nam", 1e-3, "timeout"),
        row("lasso", "4", "piqp", 1e-3),
    ]
    first, second, third = classes.compared(rows)
    assert (first["peer"], first["ratio"]) == ("piqp", pytest.approx(0.5))
    assert (second["peer"], second["ratio"]) == ("osqp", pytest.approx(8.0))
    assert np.isnan(third["ratio"])
    classes.print_tables(rows)
    text = capsys.readouterr().out
    assert "| SVM | 6 features | 1000 | 1 | piqp | 2 | 0.50 |" in text
    assert "2.00 in the geometric mean of 2, 8.00 at worst" in text
    assert "solved: 2 of 3" in text
    assert "nam fails: lasso 4 (timeout)" in text


def test_a_run_goes_on_and_leaves_out_what_was_late(tmp_path):
    file = tmp_path / "classes.csv"
    arguments = ["--classes", "equality", "--sizes", "1", "--solvers", "nam"]
    assert classes.main([*arguments, "--csv", str(file)]) == 0
    text = file.read_text()
    assert ",solved," in text
    assert classes.main([*arguments, "--csv", str(file)]) == 0
    assert file.read_text() == text
    late = text.replace(",solved,", ",timeout,").replace(",True,", ",False,")
    file.write_text(late)
    arguments[3] = "2"
    assert classes.main([*arguments, "--csv", str(file)]) == 0
    assert file.read_text().splitlines()[-1].startswith("100,equality,nam")
    assert file.read_text().count("timeout") == 2


@pytest.mark.parametrize("build", [condensed, stagewise])
def test_a_step_from_a_lost_state_has_no_feasible_point(build):
    problem = closest.lost(build, 3, 0)
    found = namlcp.solve_qp(**qps.by_name(problem), infeasible="closest")
    assert found.status is namlcp.Status.PRIMAL_INFEASIBLE
    assert closest.conditions(problem, found.closest) <= 1e-9


def test_conditions_see_a_point_that_is_not_the_closest():
    pytest.importorskip("piqp")
    problem = closest.gross(6, dense=True)
    found = namlcp.solve_qp(**qps.by_name(problem), infeasible="closest").closest
    assert closest.conditions(problem, found) <= 1e-12
    elastic = namlcp.solve_qp(**qps.by_name(problem), infeasible="elastic").closest
    assert closest.conditions(problem, elastic) > 1e-3
    shift = np.append(found.shift_h, found.shift_b)
    assert min(closest.distances(problem, shift).values()) <= 1e-8
    assert min(closest.distances(problem, shift + 1e-3).values()) > 1e-5


def test_what_was_late_is_not_asked_at_tighter_tolerances():
    class Child:
        def run(self, problem_set, name, eps):
            return {"set": problem_set, "problem": name, "eps": eps, "status": "asked"}

    def row(name, eps, status):
        return {"set": "s", "solver": "osqp", "problem": name, "eps": eps,
                "status": status}  # fmt: skip

    rows = [
        row("a", "1e-06", "timeout"), row("a", "1e-09", "timeout"),
        row("b", "1e-09", "solved"),
    ]  # fmt: skip
    slow = runs.late_ones(rows, "s", "osqp")
    said = {
        (name, eps): runs.run_problem(Child(), "s", name, eps, slow)["status"]
        for name in "ab"
        for eps in (1e-3, 1e-6, 1e-9)
    }
    late = {key for key, status in said.items() if status == "timeout"}
    assert late == {("a", 1e-6), ("a", 1e-9)}
