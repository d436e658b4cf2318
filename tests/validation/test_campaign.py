"""The campaign: what asks in two ways, and the counts that a stopped run leaves."""

import dataclasses

import numpy as np
import pytest

import namlcp
from namlcp.qp import QP
from validation.problems.fuzzed import changes
from validation.problems.fuzzed.draw import Draw
from validation.stress import campaign
from validation.stress.campaign_answers import NAM, Answer, qp_answer
from validation.stress.campaign_closest import judge_closest
from validation.stress.campaign_relations import RELATIONS, agreement, class_of, examine
from validation.stress.campaign_tally import Part, Tally, bars, read

ONE, NONE = np.ones(1), np.zeros(0)
ROW, NO_ROW = np.ones((1, 1)), np.zeros((0, 1))
BELOW_ONE = QP(ROW, -3.0 * ONE, NO_ROW, NONE, NO_ROW, NONE, 0.0 * ONE, ONE)
"""min x^2/2 - 3x, 0 <= x <= 1: x = 1."""


@pytest.mark.parametrize("name", RELATIONS)
def test_both_ways_agree(name):
    for i in range(2 * len(RELATIONS[name])):
        assert examine(3, i, name) == ("right", ""), (class_of(i, name), i)


def test_a_batch_has_an_argument_with_an_axis():
    """Problem 3027 of seed 9, whose items share all of their arguments."""
    assert class_of(3027, "batches") == "batch semidefinite cost"
    assert examine(9, 3027, "batches") == ("right", "")


def test_what_disagrees_is_found():
    alone = qp_answer(namlcp.solve_qp(*BELOW_ONE))
    assert agreement(BELOW_ONE, alone, alone) == ("right", "")
    other = Answer("infeasible", np.full(1, np.nan), NONE, NONE, ONE)
    assert agreement(BELOW_ONE, alone, other)[0] == "wrong"
    edge = BELOW_ONE._replace(P=1e-9 * ROW, ub=np.full(1, np.inf))
    solved = Answer("solved", 3e9 * ONE, NONE, NONE, 0.0 * ONE)
    unbounded = Answer("unbounded", ONE / 3.0)
    assert agreement(edge, unbounded, solved)[0] == "refused"
    assert agreement(BELOW_ONE, alone, Answer("refused"))[0] == "refused"
    assert agreement(BELOW_ONE, alone, Answer("error", words="no"))[0] == "raised"
    off = alone._replace(x=alone.x - 1e-6)
    assert agreement(BELOW_ONE, alone, off)[0] == "wrong"
    assert agreement(BELOW_ONE, off, alone) == (
        "wrong",
        "alone: " + agreement(BELOW_ONE, alone, off)[1],
    )
    refused = Answer("error", words="ValueError: P must be positive semidefinite")
    assert agreement(BELOW_ONE, refused, alone)[0] == "wrong"
    assert agreement(BELOW_ONE, refused, refused) == ("right", "")


@pytest.mark.parametrize("change", changes.CHANGES)
def test_changed_qps_keep_sizes_zeros_and_convexity(change):
    for seed in range(20):
        draw = Draw(np.random.default_rng(seed))
        F, G = draw.matrix(4, 3), draw.matrix(5, 4)
        qp = QP(F @ F.T, ONE.repeat(4), G, ONE.repeat(5), NO_ROW.repeat(4, 1), NONE,
                np.full(4, -np.inf), ONE.repeat(4))  # fmt: skip
        new = change(draw, qp)
        for old, value in zip(qp, new, strict=True):
            assert value.shape == old.shape
        assert not new.G[qp.G == 0.0].any()
        np.testing.assert_array_equal(new.P, new.P.T)
        assert np.linalg.eigvalsh(new.P).min() > -1e-10


def test_a_stopped_run_goes_on(tmp_path, capsys):
    """The same command again does nothing, one for more problems asks these alone."""
    file = tmp_path / "campaign.csv"
    command = ["run", "--csv", str(file), "--solvers", "nam"]

    def run(problems):
        campaign.main([*command, "--classes", "derivatives", "--problems", problems])
        return {tuple(r.values())[:3]: r["count"] for r in read(file) if not r["truth"]}

    assert set(run("3").values()) == {3}
    first = file.read_text()
    assert run("3") == {(1, "derivatives", "nam"): 3}
    assert file.read_text() == first
    assert set(run("4").values()) == {4}
    rows = [row for row in read(file) if row["truth"]]
    assert sum(row["count"] for row in rows) == 4
    assert all(met for *_, met in bars(rows))
    assert "| derivatives | nam | 4 |" in capsys.readouterr().out


@pytest.mark.parametrize(("seed", "index"), [(1, 24390), (3, 73554)])
def test_extreme_scales_are_not_called_unbounded(seed, index):
    found = campaign.problem_of(Part(seed, "every", "nam"), index, 1e-6, 10.0)
    assert found["truth"] == "possible"
    assert found["outcome"] in ("right", "refused")


def test_peers_have_one_seed_of_one_set(tmp_path):
    asked = campaign.argparse.Namespace(
        solvers=["nam", "quadprog"], seeds=[4, 5], classes=["every", "batches"]
    )
    installed = {part for part in campaign.parts(asked) if part.solver == "nam"}
    assert len(installed) == 4
    peers = set(campaign.parts(asked)) - installed
    assert peers <= {Part(4, "every", "quadprog")}


def test_counts_name_what_was_not_right(tmp_path):
    tally = Tally(tmp_path / "a.csv", [])
    part = Part(1, "every", "nam")
    found = {"class": "QP", "truth": "solvable", "time": 0.5}
    for index, outcome in enumerate(["right", "wrong", "wrong"]):
        tally.add(part, index, found | {"outcome": outcome, "why": "primal"})
    tally.done[part] = 3
    tally.write()
    again = Tally(tmp_path / "a.csv", [])
    assert again.done == {part: 3}
    (wrong,) = [row for row in again.rows.values() if row["outcome"] == "wrong"]
    assert (wrong["count"], wrong["cases"], wrong["first"]) == (2, "1 2", "primal")
    met = {text: ok for text, *_, ok in bars(again.rows.values())}
    assert not met["all: wrong"]
    assert not met["convex QPs with a solution: solved"]


def test_closest_points_that_are_not_closest_are_found():
    """x >= 2 (row) within 0 <= x <= 1: the row is shifted by 1, or by too much."""
    qp = BELOW_ONE._replace(G=-ROW, h=-2.0 * ONE)
    found = namlcp.solve_qp(*qp, infeasible="closest").closest
    assert judge_closest(qp, 2, True, found, NAM) == ("right", "")
    assert judge_closest(qp, 1, True, found, NAM) == ("right", "")
    off = dataclasses.replace(found, shift_h=found.shift_h + 1e-3, x=found.x - 1e-3)
    for norm in 1, 2:
        assert judge_closest(qp, norm, True, off, NAM)[0] == "wrong"
    assert (
        "of bounds"
        in judge_closest(qp, 2, True, dataclasses.replace(found, shift_ub=ONE), NAM)[1]
    )
    impossible = dataclasses.replace(found, status=namlcp.Status.PRIMAL_INFEASIBLE)
    assert judge_closest(qp, 2, True, impossible, NAM)[0] == "wrong"
