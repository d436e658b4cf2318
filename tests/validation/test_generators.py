"""Problems that are compared with peers: sizes, solutions, their workspaces."""

import numpy as np
import pytest
from qpsolvers import Problem
from scipy.optimize import linprog

from namlcp import Status, solve_lcp, solve_qp
from validation.harness import qps
from validation.problems.fuzzed import cases, lcps
from validation.problems.fuzzed.draw import Draw
from validation.problems.osqp_classes import CLASSES, ENTRIES, entries
from validation.problems.osqp_classes import generate as osqp_class
from validation.problems.sequences import SCENES
from validation.repeated import benchmark
from validation.repeated.workspaces import WORKSPACES
from validation.stress import campaign
from validation.stress import campaign_answers as answers
from validation.stress.campaign_judge import judge_lcp


@pytest.mark.parametrize("name", CLASSES)
def test_classes_have_their_sizes_and_are_the_same_again(name):
    smallest = osqp_class(name, CLASSES[name].sizes[0])
    assert solve_qp(*smallest.unpack()).status is Status.SOLVED
    for wanted, size in zip(ENTRIES[:3], CLASSES[name].sizes, strict=False):
        problem = osqp_class(name, size)
        assert abs(entries(problem) / wanted - 1.0) < 0.25
    again = osqp_class(name, size)
    np.testing.assert_array_equal(problem.q, again.q)
    for M, same in ((problem.P, again.P), (problem.A, again.A), (problem.G, again.G)):
        assert M is None or (M != same).nnz == 0


@pytest.mark.parametrize("solver", WORKSPACES)
@pytest.mark.parametrize("scene", SCENES)
def test_every_workspace_goes_along(scene, solver):
    if solver.split()[0] != "nam":
        pytest.importorskip({"proxqp": "proxsuite"}.get(solver, solver))
    recorded = benchmark.recorded(scene, SCENES[scene].sizes[0], "moves a little", 6)
    data = qps.by_name(recorded.problem)
    workspace = WORKSPACES[solver](recorded.problem, 1e-8)
    for changed, fresh in zip(recorded.vectors, recorded.fresh, strict=True):
        assert changed.keys() <= {"q", "h", "b", "lb", "ub"}
        data |= changed
        workspace.step(workspace.prepared(changed))
        row = benchmark.judged_step(workspace, Problem(**data), fresh, 1e-8)
        assert row["success"], row


@pytest.mark.parametrize("seed", range(5))
def test_general_lcps_are_what_they_are_called(seed):
    """HiGHS finds no z >= 0 with A z + q >= 0 of the unsolvable ones."""
    lcp, truth = lcps.unsolvable_general(Draw(np.random.default_rng(seed)))
    assert truth == "unsolvable"
    infeasible = 2
    found = linprog(np.zeros(lcp.q.size), A_ub=-lcp.A, b_ub=lcp.q)
    assert found.status == infeasible
    for kind in lcps.friction, lcps.strictly_copositive:
        lcp, truth = kind(Draw(np.random.default_rng(seed)))
        answer = answers.lcp_answer(solve_lcp(*lcp))
        assert judge_lcp(lcp, truth, answer, 1e-9) == ("right", "")


@pytest.mark.parametrize("index", [4657, 4822])
def test_pivoting_in_circles_is_ended(index):
    """Nonsymmetric and strictly copositive: Murty's rule took all its steps."""
    found = campaign.examine(cases.make(1, index, "general"), "nam", 10.0)
    assert found["outcome"] == "right", found
