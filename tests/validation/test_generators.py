"""Problems that are compared with peers: their classes by their own formulas."""

import numpy as np
import pytest
from qpsolvers import Problem
from scipy.optimize import linprog

from namlcp import Status, solve_lcp, solve_qp
from validation.harness import qps
from validation.problems.fuzzed import cases, general_lcps
from validation.problems.fuzzed.draw import Draw
from validation.problems.osqp_classes import CLASSES, ENTRIES, POINTS, entries
from validation.problems.osqp_classes import generate as osqp_class
from validation.problems.sequences import SCENES, control
from validation.repeated import sequences
from validation.repeated.workspaces import WORKSPACES
from validation.stress import campaign
from validation.stress import campaign_answers as answers
from validation.stress.campaign_judge import judge_lcp


@pytest.mark.parametrize("name", CLASSES)
def test_classes_have_their_sizes_and_are_the_same_again(name):
    for wanted, size in zip(ENTRIES[:3], CLASSES[name].sizes, strict=False):
        problem = osqp_class(name, size)
        assert abs(entries(problem) / wanted - 1.0) < 0.25
    again = osqp_class(name, size)
    np.testing.assert_array_equal(problem.q, again.q)
    for M, same in ((problem.P, again.P), (problem.A, again.A), (problem.G, again.G)):
        assert M is None or (M != same).nnz == 0


def lasso(problem, x):
    n = 4
    C, weight = problem.A[:, :n], problem.q[-1]
    assert weight == pytest.approx(np.abs(C.T @ problem.b).max() / 5.0)
    return 0.5 * np.sum((C @ x[:n] - problem.b) ** 2) + weight * np.abs(x[:n]).sum()


def svm(problem, x):
    margins = problem.G[:, :6]  # diag(s) C
    # the points of both labels lean to the same side of t >= diag(s) C x + 1
    assert margins[: 3 * POINTS].data.mean() > 0.0
    assert margins[3 * POINTS :].data.mean() > 0.0
    return 0.5 * x[:6] @ x[:6] + np.maximum(margins @ x[:6] + 1.0, 0.0).sum()


def huber(problem, x):
    error = np.abs(problem.A[:, :2] @ x[:2] - problem.b)
    assert 0.01 < np.mean(error > 1.5) < 0.15
    return np.where(error <= 1.0, error**2, 2.0 * error - 1.0).sum()


def portfolio(problem, x):
    n = 3 * POINTS
    F = problem.A[1:, :n].T
    assert x[:n].sum() == pytest.approx(1.0)
    D, mean = problem.P.diagonal()[:n], problem.q[:n]
    factors = problem.P.diagonal()[n:] * (F.T @ x[:n]) ** 2
    return 0.5 * (D @ x[:n] ** 2 + factors.sum()) + mean @ x[:n]


FORMULAS = {"lasso": lasso, "SVM": svm, "Huber": huber, "portfolio": portfolio}


@pytest.mark.parametrize("name", CLASSES)
def test_classes_are_their_own_formulas(name):
    problem = osqp_class(name, CLASSES[name].sizes[0])
    result = solve_qp(*problem.unpack())
    assert result.status is Status.SOLVED
    if name in FORMULAS:
        assert result.obj == pytest.approx(FORMULAS[name](problem, result.x), abs=1e-7)


def test_stages_as_unknowns_or_without():
    inputs = []
    for build, start in (
        (control.stagewise, control.STATES * 11),
        (control.condensed, 0),
    ):
        problem, loop = build(10, "moves a lot")
        changed, found = next(loop), []
        for _ in range(8):
            result = solve_qp(**(qps.by_name(problem) | changed))
            assert result.status is Status.SOLVED
            found.append(result.x[start:])
            changed = loop.send(result.x)
        inputs.append(found)
    np.testing.assert_allclose(*inputs, atol=1e-7)


@pytest.mark.parametrize("solver", WORKSPACES)
@pytest.mark.parametrize("scene", SCENES)
def test_every_workspace_goes_along(scene, solver):
    if solver.split()[0] != "nam":
        pytest.importorskip({"proxqp": "proxsuite"}.get(solver, solver))
    recorded = sequences.recorded(scene, SCENES[scene].sizes[0], "moves a little", 6)
    data = qps.by_name(recorded.problem)
    workspace = WORKSPACES[solver](recorded.problem, 1e-8)
    for changed, fresh in zip(recorded.vectors, recorded.fresh, strict=True):
        assert changed.keys() <= {"q", "h", "b", "lb", "ub"}
        data |= changed
        workspace.step(workspace.prepared(changed))
        row = sequences.judged_step(workspace, Problem(**data), fresh, 1e-8)
        assert row["success"], row


@pytest.mark.parametrize("seed", range(5))
def test_general_lcps_are_what_they_are_called(seed):
    """HiGHS finds no z >= 0 with A z + q >= 0 of the unsolvable ones."""
    lcp, truth = general_lcps.unsolvable_general(Draw(np.random.default_rng(seed)))
    assert truth == "unsolvable"
    infeasible = 2
    found = linprog(np.zeros(lcp.q.size), A_ub=-lcp.A, b_ub=lcp.q)
    assert found.status == infeasible
    for kind in general_lcps.friction, general_lcps.strictly_copositive:
        lcp, truth = kind(Draw(np.random.default_rng(seed)))
        answer = answers.lcp_answer(solve_lcp(*lcp))
        assert judge_lcp(lcp, truth, answer, 1e-9) == ("right", "")


@pytest.mark.parametrize("index", [4657, 4822])
def test_pivoting_in_circles_is_ended(index):
    """Nonsymmetric and strictly copositive: Murty's rule took all its steps."""
    found = campaign.examine(cases.make(1, index, "general"), "nam", 1e-6, 10.0)
    assert found["outcome"] == "right", found
