"""Those who call answers right or wrong, on made-up answers; `test_fuzz` has others."""

import dataclasses

import numpy as np
import pytest
import qpsolvers
from problems_qp import dense, make_qp

import namlcp
from namlcp import Status, solve_qp
from validation.derivatives import closest
from validation.harness import qps
from validation.oracles import agreement
from validation.oracles.agreement import Answer as Found
from validation.oracles.agreement import nam
from validation.oracles.scenes import Scene, at_bounds
from validation.peers import work_precision
from validation.problems import known_scenes
from validation.stress import campaign
from validation.stress.campaign_answers import Answer, qp_answer
from validation.stress.campaign_judge import judge_closest, judge_lcp
from validation.stress.campaign_relations import RELATIONS, class_of, examine
from validation.stress.campaign_relations import agreement as agreed

ONE, NONE = np.ones(1), np.zeros(0)
ROW = np.ones((1, 1))


def dense_qp(*data, **bounds):
    return dense(make_qp(*data, **bounds))


BELOW_ONE = dense_qp(ROW, -3.0 * ONE, lb=0.0 * ONE, ub=ONE)
"""min x^2/2 - 3x, 0 <= x <= 1: x = 1."""


# ---- the campaign


@pytest.mark.parametrize("name", RELATIONS)
def test_both_ways_to_ask_agree(name):
    for i in range(2 * len(RELATIONS[name])):
        assert examine(3, i, name) == ("right", ""), (class_of(i, name), i)


def test_rows_that_rounding_lets_go_are_no_reason_for_larger_shifts():
    """Problem 1493 of seed 7: a sum of 7.2, and 9.0 where 22 rows are let go."""
    assert examine(7, 1493, "closest")[0] in ("right", "refused")


def test_a_batch_has_an_argument_with_an_axis():
    """Problem 3027 of seed 9, whose items share all of their arguments."""
    assert examine(9, 3027, "batches") == ("right", "")


@pytest.mark.parametrize(("seed", "index"), [(1, 24390), (3, 73554)])
def test_extreme_scales_are_not_called_unbounded(seed, index):
    found = campaign.problem_of(campaign.Part(seed, "every", "nam"), index, 10.0)
    assert found["truth"] == "possible"
    assert found["outcome"] in ("right", "refused")


def test_two_answers_that_disagree_are_found():
    alone = qp_answer(solve_qp(*BELOW_ONE))
    off = alone._replace(x=alone.x - 1e-6)
    infeasible = Answer("infeasible", np.full(1, np.nan), NONE, NONE, ONE)
    refused = Answer("error", words="ValueError: P must be positive semidefinite")
    for one, other, outcome in (
        (alone, alone, "right"),
        (alone, infeasible, "wrong"),
        (alone, Answer("refused"), "refused"),
        (alone, Answer("error", words="no"), "raised"),
        (alone, off, "wrong"),
        (off, alone, "wrong"),
        (refused, alone, "wrong"),
        (refused, refused, "right"),
    ):
        assert agreed(BELOW_ONE, one, other)[0] == outcome
    edge = dense_qp(1e-9 * ROW, -3.0 * ONE, lb=0.0 * ONE)
    solved = Answer("solved", 3e9 * ONE, NONE, NONE, 0.0 * ONE)
    assert agreed(edge, Answer("unbounded", ONE / 3.0), solved)[0] == "refused"


@pytest.mark.parametrize(
    ("truth", "outcome"),
    [("solvable", "wrong"), ("possible", "wrong"), ("unsolvable", "right"),
     ("near", "refused")],
)  # fmt: skip
def test_unsolvable_without_a_ray_is_taken_at_its_word(truth, outcome):
    assert judge_lcp(None, truth, Answer("exhausted"), 1e-9)[0] == outcome


def test_closest_points_that_are_not_closest_are_found():
    """x >= 2 (row) within 0 <= x <= 1: the row is shifted by 1, or by too much."""
    qp = dense_qp(ROW, -3.0 * ONE, -ROW, -2.0 * ONE, lb=0.0 * ONE, ub=ONE)
    found = solve_qp(*qp, infeasible="closest").closest
    off = {"shift_h": found.shift_h + 1e-3, "x": found.x - 1e-3}
    bounds, never = {"shift_ub": ONE}, {"status": Status.PRIMAL_INFEASIBLE}
    for norm, change, outcome in (
        (1, {}, "right"), (2, {}, "right"), (1, off, "wrong"), (2, off, "wrong"),
        (2, bounds, "wrong"), (2, never, "wrong"),
    ):  # fmt: skip
        changed = dataclasses.replace(found, **change)
        assert judge_closest(qp, norm, True, changed)[0] == outcome


# ---- oracles, references, batches, closest points beside peers


def test_oracles_agree_within_the_tolerance_or_say_why():
    lcp = known_scenes.obstacle(8)
    ours = nam(lcp, 10.0)
    for z, w, said, quantity, why in (
        (ours.z, ours.w, "solved", "z", None),
        (ours.z + 1e-4, ours.w, "solved", "z", "inaccurate: natural residual"),
        (ours.z, ours.w + 1e-3, "solved", "w", "multipliers less accurate than z"),
        (ours.z + 1e-4, ours.w, "time limit", "z", "gave up (time limit)"),
        (None, None, "timeout", "objective", "no point: timeout"),
    ):
        found = {"nam": ours, "osqp": Found(z, w, said)}
        rows = agreement.scene_rows(Scene(lambda: lcp), lcp, found)
        row = {(r["solver"], r["quantity"]): r for r in rows}["osqp", quantity]
        assert row["agrees"] == (why is None)
        assert why is None or row["why"].startswith(why)
    lcp = known_scenes.torsion(50, 50)
    z = nam(lcp, 10.0).z
    inside = np.clip(z, lcp.lower + 1e-9, lcp.upper - 1e-9)  # as interior methods are
    assert at_bounds(lcp, inside) == 752


def test_a_reference_is_the_solution_or_none():
    """x = (0.3, 0.7): Clarabel's first example, objective 1.88."""
    P, q = np.array([[4.0, 1.0], [1.0, 2.0]]), np.ones(2)
    G, h = np.vstack((np.eye(2), -np.eye(2))), np.array([0.7, 0.7, 0.0, 0.0])
    problem = qpsolvers.Problem(P, q, G, h, np.ones((1, 2)), np.ones(1))
    found = solve_qp(*problem.unpack())
    solution = qpsolvers.Solution(problem, found=True, x=found.x + 1e-6)
    solution.y, solution.z, solution.z_box = found.y, found.z, found.z_box
    exact = work_precision.reference(problem, solution)
    np.testing.assert_allclose(exact, [0.3, 0.7], rtol=1e-15)
    solution.x, solution.z = np.full(2, 0.5), np.zeros(4)
    assert work_precision.reference(problem, solution) is None  # no inequality proposed
    singular = qpsolvers.Problem(np.diag([1.0, 0.0]), q, G, h)
    assert work_precision.reference(singular, solution) is None


def test_conditions_see_a_point_that_is_not_the_closest():
    problem = closest.gross(6, dense=True)
    found, elastic = (
        namlcp.solve_qp(**qps.by_name(problem), infeasible=way).closest
        for way in ("closest", "elastic")
    )
    assert closest.conditions(problem, found) <= 1e-12
    assert closest.conditions(problem, elastic) > 1e-3
    pytest.importorskip("piqp")
    shift = np.append(found.shift_h, found.shift_b)
    assert min(closest.distances(problem, shift).values()) <= 1e-8
    assert min(closest.distances(problem, shift + 1e-3).values()) > 1e-5
