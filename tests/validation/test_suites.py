"""The harness: one suite end to end, runs that stop and go on, the report."""

import io
from importlib import import_module

import pytest

from validation import report
from validation.harness import cli, csv_files, machine
from validation.problems.sequences import LEVELS
from validation.repeated import sequences
from validation.stress import campaign, campaign_tally


@pytest.fixture
def one_thread(monkeypatch):
    """Undo what the scripts set for their children."""
    for library in machine.THREADS:
        monkeypatch.setenv(f"{library}_NUM_THREADS", "1")


def test_a_suite_is_run_judged_and_drawn(tmp_path, one_thread, capsys):
    pytest.importorskip("matplotlib")
    file, figure = str(tmp_path / "a.csv"), tmp_path / "a.svg"
    command = ["run", "--quick", "--solvers", "nam", "--csv", file]
    assert sequences.main([*command, "--scenes", "condensed MPC"]) == 0
    assert "condensed MPC" in capsys.readouterr().out
    rows = csv_files.read(tmp_path / "a.csv")
    assert [row["level"] for row in rows] == list(LEVELS)
    for row in rows:
        assert row["solved"] == row["steps"] == str(sequences.QUICK_STEPS)
        assert max(float(row["residual"]), float(row["difference"])) <= 1e-9
    assert sequences.main(["plot", "--csv", file, "--figure", str(figure)]) == 0
    assert "<svg" in figure.read_text()


def test_a_stopped_campaign_goes_on(tmp_path, one_thread, capsys):
    """The same command again does nothing, one for more problems asks these alone."""
    file = tmp_path / "campaign.csv"
    command = ["run", "--csv", str(file), "--solvers", "nam"]

    def run(problems):
        campaign.main([*command, "--classes", "derivatives", "--problems", problems])
        return campaign_tally.read(file)

    for problems in "334":
        before = file.read_text() if problems != "4" and file.exists() else None
        rows = run(problems)
        assert before in (None, file.read_text())
        counts = [row["count"] for row in rows if row["truth"]]
        assert sum(counts) == int(problems)
        assert all(met for *_, met in campaign_tally.bars(rows))
    assert "| derivatives | nam | 4 |" in capsys.readouterr().out


def test_the_report_names_what_fails_and_goes_on(tmp_path, monkeypatch):
    scripts = tmp_path / "validation"
    scripts.mkdir()
    (scripts / "__init__.py").write_text("")
    monkeypatch.setattr(cli, "ROOT", tmp_path)
    (scripts / "good.py").write_text("print('the table\\n| a | <b> |\\n|---|---|')")
    (scripts / "bad.py").write_text("raise SystemExit(3)")
    (scripts / "lacking.py").write_text("print('x is missing'); raise SystemExit(2)")
    (tmp_path / "a.svg").write_text("<?xml version='1.0'?><svg>drawn</svg>")
    parts = {
        name: report.Part(name, (name,), (), 1.0)
        for name in ("bad", "lacking", "absent", "good")
    }
    parts["good"] = parts["good"]._replace(figures=("a.svg", "b.svg"))
    folders = dict.fromkeys(("results", "figures"), tmp_path)
    folders["data"] = tmp_path / "nowhere"
    outcomes = report.report(parts, folders, tmp_path, io.StringIO())
    faults = [outcome.fault for outcome in outcomes.values()]
    assert faults[0].endswith("ended with 3, see its text")
    assert faults[1].startswith("something is missing")
    assert faults[2:] == ["absent is not there", ""]
    page = (tmp_path / "report.html").read_text()
    assert f"the data folder {tmp_path / 'nowhere'} is missing" in page
    assert "<caption>the table</caption><tr><th>a</th><th>&lt;b&gt;</th>" in page
    assert "<svg>drawn</svg>" in page
    assert "b.svg was not drawn" in page
    assert "x is missing" in page


COMMANDS = {
    command
    for part in (*report.QUICK.values(), *report.FULL.values())
    for command in part.commands
}


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_commands_of_the_report_have_their_arguments(command, capsys):
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
    assert all(word in known for word in words if word.startswith("--"))
