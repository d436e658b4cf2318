"""Sequences and batches of the validation: their generators, and the scripts once."""

from itertools import islice

import numpy as np
import pytest
from qpsolvers import Problem

from namlcp import Status, solve_qp
from validation.harness import csv_files, machine, qps
from validation.problems import planted
from validation.problems.sequences import LEVELS, SCENES, control
from validation.repeated import batches, latency, sequences
from validation.repeated.workspaces import WORKSPACES

EPS = 1e-8


@pytest.fixture(autouse=True)
def one_thread(monkeypatch):
    """Undo what the scripts set for their children."""
    for library in machine.THREADS:
        monkeypatch.setenv(f"{library}_NUM_THREADS", "1")


def smallest(scene, level="moves a lot", most=6):
    """Return some steps of the smallest sequence of a scene."""
    return sequences.recorded(scene, SCENES[scene].sizes[0], level, most)


# ---- scenes


@pytest.mark.parametrize("scene", SCENES)
def test_the_same_again(scene):
    first, again = smallest(scene), smallest(scene)
    assert len(first.vectors) == 6
    for one, other in zip(first.vectors, again.vectors, strict=True):
        assert one.keys() == other.keys() <= {"q", "h", "b", "lb", "ub"}
        for name in one:
            np.testing.assert_array_equal(one[name], other[name])


def test_stages_as_unknowns_or_without():
    inputs = []
    for scene, start in (("sparse MPC", control.STATES * 11), ("condensed MPC", 0)):
        sequence = control.stagewise if start else control.condensed
        problem, loop = sequence(10, "moves a lot")
        changed = next(loop)
        found = []
        for _ in range(8):
            data = qps.by_name(problem)
            result = solve_qp(**(data | changed))
            assert result.status is Status.SOLVED, scene
            found.append(result.x[start:])
            changed = loop.send(result.x)
        inputs.append(found)
    np.testing.assert_allclose(*inputs, atol=1e-7)


def test_a_state_beyond_its_limits_is_led_back():
    _, loop = control.condensed(5, "stays")
    first = next(loop)["h"]
    loop.send(np.full(20, control.MOST))
    halved = loop.send(None)["h"]
    assert np.any(halved != first)


def test_the_penalty_begins_where_nothing_is_chosen():
    path = smallest("lasso path", "moves a little")
    assert np.abs(path.fresh[0]).max() < 1e-9
    assert np.abs(path.fresh[-1]).max() > 1e-3
    _, steps = SCENES["lasso path"].make(10, "moves a lot")
    assert len(list(steps)) == 20


def test_discs_come_to_lie_on_each_other():
    heap = smallest("contact", "stays", most=40)
    assert heap.sets[0].sum() < heap.sets[-1].sum()
    assert np.abs(heap.fresh[-1]).max() < np.abs(heap.fresh[:5]).max()


def test_a_stack_is_definite_and_has_solutions():
    stack = planted.definite_stack(np.random.default_rng(0), 6, 12, 4)
    for P, q, G, h in zip(*stack, strict=True):
        np.testing.assert_array_equal(P, P.T)
        assert np.linalg.eigvalsh(P)[0] >= 0.099
        result = solve_qp(P, q, G, h)
        assert result.status is Status.SOLVED
        assert np.any(result.z > 0.0)


# ---- workspaces and scripts


@pytest.mark.parametrize("solver", WORKSPACES)
@pytest.mark.parametrize("scene", ["condensed MPC", "sparse MPC", "lasso path"])
def test_every_workspace_goes_along(scene, solver):
    if solver.split()[0] != "nam":
        pytest.importorskip({"proxqp": "proxsuite"}.get(solver, solver))
    recorded = smallest(scene, "moves a little")
    data = qps.by_name(recorded.problem)
    workspace = WORKSPACES[solver](recorded.problem, EPS)
    for changed, fresh in zip(recorded.vectors, recorded.fresh, strict=True):
        data |= changed
        workspace.step(workspace.prepared(changed))
        row = sequences.judged_step(workspace, Problem(**data), fresh, EPS)
        assert row["success"], row


def test_sequences_are_measured_and_drawn(tmp_path, capsys):
    file, figure = tmp_path / "sequences.csv", tmp_path / "sequences.svg"
    command = f"--quick --solvers nam --csv {file}"
    scene = ["--scenes", "condensed MPC"]
    assert sequences.main(["run", *command.split(), *scene]) == 0
    assert "condensed MPC" in capsys.readouterr().out
    rows = csv_files.read(file)
    assert [row["level"] for row in rows] == list(LEVELS)
    for row in rows:
        assert row["solved"] == row["steps"] == str(sequences.QUICK_STEPS)
        assert float(row["residual"]) <= 1e-9
        assert float(row["difference"]) <= 1e-9
    pytest.importorskip("matplotlib")
    assert sequences.main(["plot", "--csv", str(file), "--figure", str(figure)]) == 0
    assert "<svg" in figure.read_text()


@pytest.mark.parametrize(
    ("script", "solver"), [(latency, "nam by calls"), (batches, "nam")]
)
def test_calls_are_measured_and_drawn(script, solver, tmp_path):
    name = script.__name__.split(".")[-1]
    file, figure = tmp_path / f"{name}.csv", tmp_path / f"{name}.svg"
    command = ["run", "--quick", "--solvers", solver, "--csv", str(file)]
    assert script.main(command) == 0
    rows = csv_files.read(file)
    assert rows
    assert all(row["status"] == "solved" for row in rows)
    assert all(float(row["residual"]) < 1e-9 for row in rows)
    pytest.importorskip("matplotlib")
    assert script.main(["plot", "--csv", str(file), "--figure", str(figure)]) == 0
    assert "<svg" in figure.read_text()


def test_residuals_of_a_batch_by_their_definition():
    stack = planted.definite_stack(np.random.default_rng(0), 4, 8, 3)
    results = [solve_qp(*item) for item in zip(*stack, strict=True)]
    x, z = np.array([r.x for r in results]), np.array([r.z for r in results])
    assert batches.worst_residual(stack, x, z) < 1e-12
    z[1, 2] -= 1.0
    assert batches.worst_residual(stack, x, z) >= 1.0 - 1e-9


def test_scenes_end_or_go_on():
    for scene in SCENES.values():
        _, steps = scene.make(scene.sizes[0], "stays")
        first = list(islice(steps, 1))
        assert first[0].keys() <= {"q", "h", "b"}
