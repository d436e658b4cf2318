"""The rows of the agreement table: what agrees, what does not and why."""

import numpy as np
import pytest

from validation.oracles import agreement
from validation.oracles.parts import collection_row
from validation.oracles.rows import compared, row_of
from validation.oracles.scenes import (
    SCENES,
    Scene,
    at_bounds,
    bimatrix,
    dam_error,
    scenes,
    textbook,
)
from validation.oracles.solvers import Answer, is_monotone, is_symmetric, lemke, nam
from validation.problems import known_scenes as known

LCP = known.obstacle(8)
OURS = nam(LCP, 10.0)


def rows_with(z, w, said="solved", scene=None):
    """Return the rows of a small obstacle where an oracle answers z and w."""
    found = {"nam": OURS, "osqp": Answer(z, w, said)}
    rows = agreement.scene_rows("s", scene or Scene(lambda _: LCP), LCP, found)
    return {(row["solver"], row["quantity"]): row for row in rows}


def test_a_row_agrees_within_its_tolerance():
    assert row_of("s", 1, "nam", "v", 1.0, (1.0 + 1e-9, 2e-9, "x"))["agrees"]
    assert not row_of("s", 1, "nam", "v", 1.0, (1.1, 2e-9, "x"))["agrees"]
    assert not row_of("s", 1, "nam", "v", np.nan, (1.1, 2e-9, "x"))["agrees"]
    assert not row_of("s", 1, "nam", "v")["agrees"]
    rows = compared("s", 2, "v", {"a": 1.0, "b": 2.0}, (2.0, 0.0, "x"))
    assert [row["agrees"] for row in rows] == [False, True]


def test_exact_answers_agree():
    rows = rows_with(OURS.z, OURS.w)
    assert set(rows) == {
        ("nam", "objective"), ("osqp", "objective"), ("osqp", "z"), ("osqp", "w"),
    }  # fmt: skip
    assert all(row["agrees"] for row in rows.values())
    assert not agreement.explanations(list(rows.values()))


def test_disagreements_are_explained():
    rows = rows_with(OURS.z + 1e-4, OURS.w)
    assert not rows["osqp", "z"]["agrees"]
    assert rows["osqp", "z"]["why"].startswith("inaccurate: natural residual")
    rows = rows_with(OURS.z, OURS.w + 1e-3)
    assert rows["osqp", "z"]["agrees"]
    assert rows["osqp", "w"]["why"].startswith("multipliers less accurate than z")
    rows = rows_with(OURS.z + 1e-4, OURS.w, "time limit")
    assert rows["osqp", "z"]["why"].startswith("gave up (time limit)")
    rows = rows_with(None, None, "timeout")
    assert rows["osqp", "objective"]["why"] == "no point: timeout"
    several = rows_with(OURS.z + 1e-4, OURS.w, scene=Scene(lambda _: LCP, (), False))
    assert ("osqp", "z") not in several
    text = agreement.markdown(list(several.values()))
    assert "| s | 64 | objective |" in text
    assert "- s, nam, objective: natural residual" in text
    assert ", of the reference" in text


def test_lemke_agrees_where_it_applies():
    pytest.importorskip("quantecon")
    scene = known.dam()
    found = lemke(scene, 10.0)
    np.testing.assert_allclose(found.z, nam(scene, 10.0).z, atol=1e-12)
    assert dam_error(scene, found.z) <= 1.5e-11
    assert lemke(known.torsion(4, 4), 10.0) is None  # two-sided
    game = bimatrix()
    assert lemke(game, 10.0).z is None
    assert agreement.residual_of(game, nam(game, 10.0).z) < 1e-12


def test_kinds_of_matrices():
    assert is_symmetric(LCP.A)
    put = SCENES["American put, one step"].make(None)
    assert not is_symmetric(put.A)
    assert is_monotone(put)
    assert not is_monotone(bimatrix())


def test_known_quantities():
    scene = SCENES["torsion 50 x 50"]
    lcp = scene.make(None)
    z = nam(lcp, 10.0).z
    for entry in scene.known:
        assert abs(entry.of(lcp, z) - entry.value) <= entry.absolute
    inside = np.clip(z, lcp.lower + 1e-9, lcp.upper - 1e-9)  # as interior methods are
    assert at_bounds(lcp, inside) == 752


def test_without_the_data_folder():
    found = scenes(None)
    assert found["SVM heart, RBF"].make(None) is None
    assert not any(name.startswith("contact ") for name in found)
    assert not list(textbook(None))


def test_objectives_of_the_collections():
    reference = -2.0, "piqp", 1e-8
    near = {"status": "solved", "objective": -2.0 + 1e-6, "residual": 1e-10}
    assert collection_row("A", 3, reference, near)["agrees"]
    far = collection_row("A", 3, reference, near | {"objective": -2.1})
    assert not far["agrees"]
    assert far["why"] == "residuals 1e-10, piqp's stored 1e-08"
    refused = {"status": "ProblemError: P must be positive semidefinite: ..."}
    assert collection_row("VALUES", 3, reference, refused)["agrees"]
    late = collection_row("A", 3, reference, {"status": "timeout"})
    assert (late["agrees"], late["why"]) == (False, "timeout")
