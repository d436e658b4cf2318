"""Nothing wrong is ever called solved: problems of every kind, judged by definition.

Some of each class of the campaign in validation/; its judge computes every residual
anew, and asks HiGHS where nothing is known of a problem.
"""

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import Status, solve_lcp, solve_qp
from namlcp.qp.problem import QP
from validation.problems.fuzzed import cases as problems
from validation.problems.fuzzed import forms
from validation.problems.known_scenes import BoxLCP
from validation.stress import campaign, campaign_relations
from validation.stress import campaign_answers as answers
from validation.stress.campaign_judge import (
    NAM,
    Answer,
    farkas_faults,
    judge_lcp,
    judge_qp,
    lcp_faults,
    qp_faults,
    ray_faults,
)

INF = np.inf


@pytest.mark.parametrize("cycle", ["every", "values"])
@pytest.mark.parametrize("part", range(8))
def test_campaign(part, cycle):
    """Any problem of the campaign: never wrong, and solved where it must be."""
    for index in range(50 * part, 50 * part + 50):
        case = problems.make(7, index, cycle)
        found = campaign.examine(case, "nam", 10.0)
        assert found["outcome"] in ("right", "refused"), (index, found)
        if found["truth"] in ("solvable", "infeasible", "unsolvable", "malformed"):
            assert found["outcome"] == "right", (index, found)


@pytest.mark.parametrize("is_qp", [True, False])
@pytest.mark.parametrize("seed", range(150))
def test_malformed_arguments_are_named(seed, is_qp):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    one = np.eye(n)
    if is_qp:
        arguments = QP(one, one[0], one, one[0], one, one[0], -one[0], one[0])
    else:
        arguments = BoxLCP(one, one[0], 0.0 * one[0], one[0])
    spoiled, name = forms.spoil(rng, arguments._asdict())
    with pytest.raises((ValueError, TypeError), match=rf"\b{name}\b"):
        (solve_qp if is_qp else solve_lcp)(**spoiled)


def test_the_judge_sees_every_fault():
    """One point that solves its QP, spoiled in each part in turn."""
    one, none = np.ones(1), np.zeros(0)
    row, no_row = np.ones((1, 1)), np.zeros((0, 1))
    # min x^2/2 - 3x, x <= 1 (row) and 0 <= x <= 5
    qp = QP(row, -3.0 * one, row, one, no_row, none, 0.0 * one, 5.0 * one)
    x, y, z, z_box = one, none, 2.0 * one, 0.0 * one
    tolerance = NAM
    assert qp_faults(qp, x, y, z, z_box, tolerance) == ""
    shift = 1e-6 * one
    assert "primal" in qp_faults(qp, x + shift, y, z - shift, z_box, tolerance)
    assert "dual" in qp_faults(qp, x, y, z + shift, z_box, tolerance)
    assert "gap" in qp_faults(qp, x - shift, y, z + shift, z_box, tolerance)
    unbounded_above = qp._replace(ub=INF * one)
    assert "sign" in qp_faults(unbounded_above, x, y, z - one, one, tolerance)
    assert qp_faults(qp, np.nan * one, y, z, z_box, tolerance) == "not finite"
    lcp = BoxLCP(row, -one, 0.0 * one, INF * one)
    assert lcp_faults(lcp, one, 1e-9) == ""
    assert "residual" in lcp_faults(lcp, one + 1e-8, 1e-9)
    assert lcp_faults(lcp, -one, 1e-9) == "outside of the box"


def test_the_judge_sees_false_proofs_and_allows_rounding():
    """Rows of 1e9 that cancel: rounding is eps times 1e9, and 1e-6 is no rounding."""
    none, no_row = np.zeros(0), np.zeros((0, 1))
    sizes = np.array([1e9, -1e9])
    free = np.full(1, INF)
    qp = QP(np.zeros((1, 1)), -np.ones(1), no_row, none,
            sizes[:, None], np.array([-1.0, 0.0]), -free, free)  # fmt: skip
    for error, fault in ((0.0, False), (1e-15, False), (1e-13, True)):
        y = np.array([1.0, 1.0 + error])
        assert ("residual" in farkas_faults(qp, y, none, np.zeros(1))) == fault
    assert "value" in farkas_faults(qp, 2.0 * np.ones(2), none, np.zeros(1))
    flat = np.zeros((2, 2))
    for error, fault in ((0.0, False), (1e-15, False), (1e-13, True)):
        ray = QP(flat, np.array([-1.0, 0.0]), np.zeros((0, 2)), none, sizes[None, :],
                 np.zeros(1), -np.full(2, INF), np.full(2, INF))  # fmt: skip
        assert ("residual" in ray_faults(ray, np.array([1.0, 1.0 + error]))) == fault


@pytest.mark.parametrize(
    ("said", "known", "outcome"),
    [
        ("infeasible", "solvable", "wrong"),
        ("unbounded", "possible", "wrong"),
        ("refused", "solvable", "refused"),
        ("error", "solvable", "raised"),
        ("error", "not convex", "raised"),
    ],
)
def test_the_judge_believes_no_words(said, known, outcome):
    nan = np.full(1, np.nan)
    qp = QP(*[np.ones((1, 1)) if k in (0, 2, 4) else np.ones(1) for k in range(8)])
    answer = Answer(said, nan, nan, nan, nan, "no", RuntimeError)
    assert judge_qp(qp, known, answer, NAM, True)[0] == outcome


@pytest.mark.parametrize("index", [8104, 5860, 10909])
def test_a_ray_that_the_loop_left_inexact_is_settled(index):
    """A v = 0, v >= 0, q'v < 0, and the proximal loop has v to ten digits."""
    case = problems.make(1, index)
    result = solve_lcp(*case.problem)
    outcome = judge_lcp(
        case.problem,
        "unsolvable",
        answers.lcp_answer(result),
        answers.NAM_LCP,
    )
    assert outcome == ("right", "")


def test_bounds_of_an_lcp_may_be_sparse_columns():
    """As q may."""
    lower = sp.csc_array(np.array([[1.0], [0.0]]))
    result = solve_lcp(np.eye(2), -0.5 * np.ones(2), lower)
    assert result.z.tolist() == [1.0, 0.5]


def test_a_ray_of_rounding_proves_nothing():
    """A singular A in other units, with a solution: q'v is what its terms leave."""
    case = problems.make(3, 13203)
    assert solve_lcp(*case.problem).ray is None


@pytest.mark.parametrize("index", [174, 4917, 6804, 31329, 75545])
def test_large_numbers_do_not_hide_the_others(index):
    case = problems.make(3, index)
    found = campaign.examine(case, "nam", 10.0)
    assert found["outcome"] == "right", found


def test_squares_of_tiny_unknowns_are_no_residual():
    """z = 4e-6 where A = 2e167: its square, in units of q, is no number."""
    result = solve_lcp(np.array([[2e167]]), np.array([1e162]), -4e-6, 2e-6)
    assert (result.status.value, result.z[0]) == ("solved", -4e-6)


@pytest.mark.parametrize(
    ("seed", "index"), [(1, 26409), (1, 62813), (2, 16413), (4, 597)]
)
def test_what_far_scales_found(seed, index):
    """An infinite point refined for ever; P sorted by SciPy; norms of lists of rows."""
    found = campaign.examine(problems.make(seed, index, "values"), "nam", 10.0)
    assert found["outcome"] in ("right", "refused"), found


def test_a_proof_holds_in_units_that_equilibrate():
    """Multipliers of bounds count in the units of the dual residual, not of x."""
    found = campaign.examine(problems.make(1, 23880), "nam", 10.0)
    assert found["outcome"] == "right", found


@pytest.mark.parametrize("index", [39, 1889, 7229])
def test_wrong_signs_within_tolerance_are_put_right(index):
    """P curves by 1e-8: a multiplier of -1e-11 moves x by 1e-3."""
    found = campaign_relations.examine(1, index, "derivatives")
    assert found == campaign_relations.RIGHT


@pytest.mark.parametrize("index", [12824, 18672])
def test_what_the_campaign_found(index):
    """A point far out raised a warning; an entry stored on one side crashed."""
    case = problems.make(1, index)
    result = solve_qp(**case.arguments)
    known = {"infeasible": Status.PRIMAL_INFEASIBLE, "solvable": Status.SOLVED}
    assert result.status is known[case.truth]
