"""The charts, profiles and the report of the validation, on tiny problems."""

import io
import os
from importlib import import_module

import numpy as np
import pytest
from qpsolvers import Problem, Solution

from namlcp import Status, solve_lcp, solve_qp
from validation import report
from validation.claims import Claim, moved, values
from validation.claims.limits import LIMITS
from validation.claims.ratios import mean, over
from validation.harness import cli, csv_files, machine, processes, quiet
from validation.harness.machine import THREADS
from validation.peers import references, work_precision
from validation.problems import contact_scenes, families


@pytest.fixture
def one_thread(monkeypatch):
    """Undo what the scripts set for their children."""
    for library in THREADS:
        monkeypatch.setenv(f"{library}_NUM_THREADS", "1")


# ---- families and references


def test_families_without_data(tmp_path):
    known = families.families(tmp_path)
    assert list(known) == [
        "dominant", "obstacle", "contact", "MPC", "SVM", "general QP", "paper",
    ]  # fmt: skip
    for family in known.values():
        assert len(family.makers) >= 5
        assert set(family.quick) <= set(family.makers)
    for name in ("dominant", "obstacle", "MPC", "paper"):
        task = known[name].makers[known[name].quick[0]]()
        if task.exact is not None:
            w = task.problem.P @ task.exact + task.problem.q
            assert np.abs(np.minimum(task.exact, w)).max() < 1e-12


def test_missing_data_are_named(tmp_path):
    absent = families.missing(tmp_path)
    assert [text.split(":")[0] for text in absent] == [
        "contact", "MPC", "general QP", "SVM",
    ]  # fmt: skip
    assert "kaplas_570" in absent[0]
    assert families.missing(None) == absent


def test_reference_is_the_solution():
    """x = (0.3, 0.7): Clarabel's first example, objective 1.88."""
    P, q = np.array([[4.0, 1.0], [1.0, 2.0]]), np.ones(2)
    G, h = np.vstack((np.eye(2), -np.eye(2))), np.array([0.7, 0.7, 0.0, 0.0])
    A, b = np.ones((1, 2)), np.ones(1)
    problem = Problem(P, q, G, h, A, b)
    found = solve_qp(P, q, G, h, A, b)
    solution = Solution(problem, found=True, x=found.x + 1e-6)
    solution.y, solution.z, solution.z_box = found.y, found.z, found.z_box
    exact = references.reference(problem, solution)
    np.testing.assert_allclose(exact, [0.3, 0.7], rtol=1e-15)
    solution.x = np.full(2, 0.5)
    solution.z = np.zeros(4)  # no inequality proposed: refused, not believed
    assert references.reference(problem, solution) is None
    singular = Problem(np.diag([1.0, 0.0]), q, G, h)
    assert references.reference(singular, solution) is None
    assert references.distance(np.array([2.0, 0.5]), np.array([2.0, 0.0])) == 0.25


def test_stack_carries_the_weight_above():
    boxes = 10
    scene = contact_scenes.stack(boxes)
    found = solve_lcp(scene.A, scene.q)
    assert found.status is Status.SOLVED
    weight = np.geomspace(1.0, 1e4, boxes)[::-1].cumsum()[::-1]
    expected = np.repeat(0.5 * contact_scenes.STEP * weight, 2)
    np.testing.assert_allclose(found.z, expected, rtol=1e-9)


# ---- work-precision


def test_quartiles_of_a_sample_with_failures():
    assert work_precision.quartiles([3.0, np.inf, 1.0, 2.0]) == [1.0, 2.0, 3.0]
    assert work_precision.quartiles([1.0, np.inf, np.inf])[1] == np.inf


def test_a_miss_is_ours_to_call():
    row = {"set": "s", "eps": 1e-6, "status": "solved", "residual": 2e-5}
    exact = np.array([1.0, 2.0])
    done = work_precision.complete(dict(row), exact + 0.5, exact)
    assert done["missed"]
    assert done["error"] == 0.25
    row["residual"] = 5e-6
    assert not work_precision.complete(dict(row), exact, None)["missed"]
    assert work_precision.complete(row | {"status": "too slow"}, None, None)["missed"]


def test_work_precision_on_two_problems(tmp_path, one_thread, capsys):
    command = "run --quick --families dominant --eps 1e-3 1e-6 --solvers nam nobody"
    code = work_precision.main(
        [*command.split(), "--data", str(tmp_path), "--results", str(tmp_path)]
    )
    said = capsys.readouterr().out
    assert code == 2
    assert "missing in the data folder, left out: MPC: LIPMWALK0" in said
    assert "nobody: not installed" in said
    file = tmp_path / "work-precision-quick.csv"
    assert "# not installed: nobody" in file.read_text()
    rows = csv_files.read(file)
    assert {row["solver"] for row in rows} == {"nam", *families.SWEPT}
    for row in rows:
        assert row["solved"] == row["problems"] == "2"
        assert float(row["q1"]) <= float(row["time"]) <= float(row["q3"])
        assert float(row["error"]) < (1e-12 if row["solver"] == "nam" else 1e-2)
    detail = tmp_path / "work-precision-quick-problems.csv"
    before = detail.read_text()
    work_precision.main([*command.split(), "--results", str(tmp_path)])
    assert detail.read_text() == before  # nothing left to measure
    pytest.importorskip("matplotlib")
    work_precision.main(
        ["plot", "--quick", "--results", str(tmp_path), "--figures", str(tmp_path)]
    )
    assert "<svg" in (tmp_path / "work-precision-quick.svg").read_text()


# ---- profiles


def test_profiles_count_failures_as_infinite(tmp_path, capsys):
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot as plt

    from validation.peers import profiles

    code = profiles.main(
        ["run", "--quick", "--data", str(tmp_path), "--results", str(tmp_path)]
    )
    assert code == 2
    assert f"{tmp_path / 'mpc'} is missing" in capsys.readouterr().out
    rows = [
        {"problem": str(k), "solver": solver, "runtime": time, "success": time < 9.0}
        for k, times in enumerate([(1.0, 2.0), (3.0, 9.0)])
        for solver, time in zip(("nam", "piqp"), times, strict=True)
    ]
    figure, axes = plt.subplots()
    profiles.draw_profile(axes, rows, 2)
    heights = {line.get_label(): line.get_ydata()[-1] for line in axes.get_lines()}
    plt.close(figure)
    assert heights["namlcp 2"] == 2
    assert heights["piqp 1"] == 1


# ---- report


def test_report_names_what_fails_and_goes_on(tmp_path, monkeypatch):
    scripts = tmp_path / "validation"
    scripts.mkdir()
    (scripts / "__init__.py").write_text("")
    (scripts / "good.py").write_text("print('the table\\n| a | <b> |\\n|---|---|')")
    (scripts / "bad.py").write_text("raise SystemExit(3)")
    (scripts / "lacking.py").write_text("print('x is missing'); raise SystemExit(2)")
    (tmp_path / "a.svg").write_text("<?xml version='1.0'?><svg>drawn</svg>")
    monkeypatch.setattr(cli, "ROOT", tmp_path)

    def part(name, *figures):
        return report.Part(name, (name,), figures, 1.0)

    parts = {
        "bad": part("bad"),
        "lacking": part("lacking"),
        "absent": part("absent"),
        "good": part("good", "a.svg", "b.svg"),
    }
    folders = dict.fromkeys(("results", "figures"), tmp_path)
    folders["data"] = tmp_path / "nowhere"
    stream = io.StringIO()
    outcomes = report.report(parts, folders, tmp_path, stream)
    faults = [outcome.fault for outcome in outcomes.values()]
    assert faults[0].endswith("ended with 3, see its text")
    assert faults[1].startswith("something is missing")
    assert faults[2] == "absent is not there"
    assert faults[3] == ""
    page = (tmp_path / "report.html").read_text()
    assert f"the data folder {tmp_path / 'nowhere'} is missing" in page
    assert "<caption>the table</caption><tr><th>a</th><th>&lt;b&gt;</th>" in page
    assert "<svg>drawn</svg>" in page
    assert "b.svg was not drawn" in page
    assert "x is missing" in page
    assert "good: done" in stream.getvalue()


def test_report_goes_on_where_it_stopped(tmp_path, monkeypatch):
    scripts = tmp_path / "validation"
    scripts.mkdir()
    (scripts / "__init__.py").write_text("")
    (scripts / "good.py").write_text("print('ran')")
    monkeypatch.setattr(cli, "ROOT", tmp_path)
    parts = {"good": report.Part("good", ("good",), (), 120.0, grown=("a.csv",))}
    folders = dict.fromkeys(("results", "figures", "data"), tmp_path)
    grown = tmp_path / "a.csv"
    grown.write_text("rows of another run")

    def said(again=False):
        stream = io.StringIO()
        report.report(parts, folders, tmp_path, stream, again)
        return stream.getvalue().splitlines()[-1]

    assert "| good | good | 2 | 2 | about |" in report.minutes(parts, tmp_path)
    assert said().startswith("good: done,")
    assert not grown.exists()
    assert "| good | good | 0 | 0 | measured |" in report.minutes(parts, tmp_path)
    grown.write_text("rows of this run")
    assert said().startswith("good: done before,")
    assert grown.exists()
    assert said(again=True).startswith("good: done,")
    assert not grown.exists()
    grown.write_text("rows of this run")
    parts["good"] = parts["good"]._replace(commands=("good", "other"))
    (scripts / "other.py").write_text("print('other sources')")
    assert said().startswith("good: done,")
    assert grown.exists()
    (scripts / "good.py").write_text("print('other sources')")
    assert said().startswith("good: done,")
    assert not grown.exists()


def test_rows_of_late_peers_are_kept(tmp_path, monkeypatch):
    """On the same processor and with the same version, and of peers alone."""
    monkeypatch.setattr(machine, "package_version", lambda name: "1")
    monkeypatch.setattr(machine, "cpu_name", lambda: "a processor")
    columns = ("solver", "problem", "status")
    asked = [
        ("nam", "a", "timeout"), ("osqp", "a", "timeout"), ("osqp", "b", "solved"),
        ("proxqp", "a", "too slow"), ("sweep nam", "a", "timeout"),
    ]  # fmt: skip
    rows = [dict(zip(columns, entries, strict=True)) for entries in asked]
    file = tmp_path / "a.csv"
    header = machine.lines(["nam", "osqp", "proxqp", "sweep"])

    def kept(header, *whole):
        csv_files.write(file, header, rows)
        processes.keep_peers(file, whole)
        return [(row["solver"], row["problem"]) for row in csv_files.read(file)]

    assert kept(header) == [("osqp", "a"), ("proxqp", "a")]
    other = [line.replace("osqp 1", "osqp 2") for line in header]
    assert kept(other) == [("proxqp", "a")]
    assert kept(header, "osqp") == [("osqp", "a"), ("osqp", "b"), ("proxqp", "a")]
    assert kept([line.replace("a processor", "another") for line in header]) == []
    processes.keep_peers(tmp_path / "none.csv")
    assert not (tmp_path / "none.csv").exists()


def test_a_growing_file_goes_on(tmp_path):
    file, keys = tmp_path / "a.csv", ("problem", "eps")
    with csv_files.growing(file, ["first"], [*keys, "time"], keys) as table:
        table.add({"problem": "a", "eps": 1e-6, "time": 1.0})
    with csv_files.growing(file, ["second"], [*keys, "time"], keys) as table:
        assert table.has("a", 1e-6)
        assert not table.has("a", 1e-9)
        table.add({"problem": "a", "eps": 1e-9, "time": 2.0})
        assert table.has("a", 1e-9)
    assert [row["time"] for row in csv_files.read(file)] == ["1.0", "2.0"]
    assert csv_files.header(file) == ["first"]
    with csv_files.growing(file, ["third"], keys, keys, goes_on=False) as table:
        assert not table.has("a", 1e-6)
    assert csv_files.header(file) == ["third"]


def test_claims_that_fell_are_marked():
    before = [Claim("time", 0.9, "<=", 1.0), Claim("solved", 7, ">=", 8)]
    now = [before[0]._replace(value=1.1), before[1]._replace(value=float("nan"))]
    text = moved(before, now)
    assert "| time | <= 1 | 0.9 | 1.1 | FELL |" in text
    assert "| solved | >= 8 | 7 | nan | falls short |" in text
    assert report.table("title", text.splitlines()).count('class="bad"') == 1


def test_ratio_of_times_counts_what_both_solve():
    def row(problem, solver, time, success="True"):
        return {
            "problem": problem, "set": "s", "solver": solver, "runtime": time,
            "success": success,
        }  # fmt: skip

    rows = [
        row("a", "nam", "1.0"), row("a", "piqp", "4.0"),
        row("b", "nam", "1.0"), row("b", "piqp", "1.0"),
        row("c", "nam", "1.0"), row("c", "piqp", "9.0", "False"),
        row("d", "nam", "", "True"), row("d", "piqp", "1.0"),
    ]  # fmt: skip
    assert mean(over(rows, "piqp")) == pytest.approx(0.5)
    assert np.isnan(mean(over(rows, "osqp")))


def test_claims_know_all_limits():
    found = values()
    assert set(LIMITS) <= set(found)


def test_a_busy_machine_is_waited_for_and_refused(monkeypatch, capsys):
    loads = [1.5]
    monkeypatch.setattr(quiet, "busy_cores", lambda: loads.pop(0))
    monkeypatch.setattr(quiet.time, "sleep", lambda seconds: None)
    monkeypatch.setattr(quiet, "last_look", -quiet.LOOK_EVERY)
    monkeypatch.delenv(quiet.LOAD, raising=False)
    quiet.wait_until_quiet(0.0)  # not asked to look
    assert "load: not looked at" in machine.lines([])
    monkeypatch.setenv(quiet.LOAD, quiet.QUIET)
    with pytest.raises(quiet.BusyError, match="cores busy"):
        quiet.wait_until_quiet(-1.0)
    loads += [1.2, 0.9, 0.1]
    quiet.wait_until_quiet(60.0)
    assert capsys.readouterr().out == "waiting: others keep 1.2 cores busy\n"
    quiet.wait_until_quiet(-1.0)  # what was seen counts for a while
    assert not loads


def test_one_process_more_is_allowed_by_name(monkeypatch):
    monkeypatch.setattr(quiet, "busy_cores", lambda: 1.1)
    monkeypatch.setattr(quiet, "last_look", -quiet.LOOK_EVERY)
    monkeypatch.setenv(quiet.LOAD, quiet.BESIDE)
    quiet.wait_until_quiet(-1.0)
    assert any("beside another process" in line for line in machine.lines([]))


def test_busy_cores_are_a_number_of_cores():
    assert 0.0 <= quiet.busy_cores(0.05) <= 4.0 * os.cpu_count()


def commands_of_the_report():
    for part in (*report.QUICK.values(), *report.FULL.values()):
        yield from part.commands


@pytest.mark.parametrize("command", dict.fromkeys(commands_of_the_report()))
def test_scripts_of_the_report_take_their_arguments(command, capsys):
    """Every command names a script that is there and arguments that it has."""
    name, *words = command.split()
    assert (cli.ROOT / f"validation/{name.replace('.', '/')}.py").exists()
    try:
        script = import_module(f"validation.{name}")
    except ModuleNotFoundError as error:
        pytest.skip(str(error))
    task = [words[0]] if words and not words[0].startswith("--") else []
    with pytest.raises(SystemExit):
        script.main([*task, "--help"])
    known = capsys.readouterr().out
    for word in words:
        if word.startswith("--"):
            assert word in known
