"""The harness: one suite end to end, runs that stop and go on, the report."""

import sys
from importlib import import_module

import pytest

from validation import report
from validation.harness import cli, machine
from validation.stress import campaign, campaign_tally


@pytest.fixture
def one_thread(monkeypatch):
    """Undo what the scripts set for their children."""
    for library in machine.THREADS:
        monkeypatch.setenv(f"{library}_NUM_THREADS", "1")


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


COMMANDS = {line for job in report.JOBS for line in job.lines(bool(job.quick))}


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


def test_a_report_makes_only_what_is_out_of_date(tmp_path, monkeypatch):
    asked = []

    def script(*words):
        asked.append(words)
        return [sys.executable, "-c", ""]

    monkeypatch.setattr(report.cli, "script", script)
    for folder in ("results", "figures", "logs", "stamps"):
        (tmp_path / folder).mkdir()
    for again, runs in ((False, 1), (False, 1), (True, 2)):
        assert report.run(report.JOBS[1], tmp_path, tmp_path, False, again) == ""
        assert len(asked) == runs
    assert asked[0][0] == "peers.classes"
