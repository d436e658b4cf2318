"""The harness: one suite end to end, runs that stop and go on, the report."""

import subprocess

import pytest
from child_work import answer

from validation import report
from validation.__main__ import main
from validation.harness import cli, machine, tables
from validation.harness.suite import Late, Suite, limit_beside
from validation.stress import campaign


@pytest.fixture
def one_thread(monkeypatch):
    """Undo what the scripts set for their children."""
    for library in machine.THREADS:
        monkeypatch.setenv(f"{library}_NUM_THREADS", "1")


def test_a_stopped_campaign_goes_on(tmp_path, one_thread):
    """The same command again does nothing, one for more problems asks these alone."""
    file = tmp_path / "campaign.csv"
    command = ["--csv", str(file), "--solvers", "nam"]

    def run(problems):
        campaign.main([*command, "--classes", "derivatives", "--problems", problems])
        return campaign.read(file)

    for problems in "334":
        before = file.read_text() if problems != "4" and file.exists() else None
        rows = run(problems)
        assert before in (None, file.read_text())
        counts = [row["count"] for row in rows if row["truth"]]
        assert sum(counts) == int(problems)
        assert {row["outcome"] for row in rows} <= {"done", "right", "refused"}


def asked(args):
    for eps in args.eps:
        for problem in (1, 2, 3):
            for solver in args.solvers:
                yield {"problem": problem, "eps": eps, "solver": solver}


TRIED = Suite(
    name="tried",
    requests=asked,
    work=answer,
    complete=lambda row: row | {"said": row["status"]},
    columns="problem solver eps | runtime success said",
    solvers=("nam", "slow", "frail"),
    packages={"slow": "numpy", "frail": "numpy"},
    tolerances=(1e-6, 1e-9),
    limit=0.2,
    late=Late(same=("problem",)),
)


def test_a_suite_ends_what_hangs_and_goes_on(tmp_path, one_thread):
    """What was late is not asked at a tighter tolerance; a death is one row."""
    file = tmp_path / "tried.csv"
    command = ["run", "--csv", str(file), "--go-on"]
    assert TRIED.main([*command, "--only", "1", "2"]) == 0
    assert TRIED.main(command) == 0
    rows = tables.read(file)
    said = {(r["problem"], r["solver"], r["eps"]): r["said"] for r in rows}
    assert len(said) == len(rows) == 18
    missed = {key: word for key, word in said.items() if word != "solved"}
    assert missed == {
        (problem, solver, eps): word
        for problem, solver, word in (
            ("2", "slow", "timeout"),
            ("3", "frail", "crashed"),
        )
        for eps in ("1e-06", "1e-09")
    }
    before = file.read_text()
    assert TRIED.main(command) == 0
    assert file.read_text() == before


def test_the_limit_of_a_peer_is_ours_times_ten():
    assert limit_beside([], 5.0) == limit_beside([2.0], 5.0) == 5.0
    assert limit_beside([0.3, 0.4], 5.0) == 3.0
    assert limit_beside([1e-3], 5.0) == 1.0


COMMANDS = {line for job in report.JOBS for line in job.lines(quick=job.quick > 0.0)}


@pytest.mark.parametrize("command", sorted(COMMANDS))
def test_commands_of_the_report_have_their_arguments(command, capsys):
    words = command.split()
    assert (cli.ROOT / f"validation/{words[0].replace('.', '/')}.py").exists()
    pytest.importorskip(f"validation.{words[0]}")
    with pytest.raises(SystemExit, match="0"):
        main([*words, "--help"])
    known = capsys.readouterr().out
    assert all(word in known for word in words if word.startswith("--"))


def test_a_report_makes_only_what_is_out_of_date(tmp_path, monkeypatch):
    asked = []

    def run(command, **streams):
        asked.append(command)
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(report.subprocess, "run", run)
    for folder in ("results", "figures", "logs", "stamps"):
        (tmp_path / folder).mkdir()
    for again, runs in ((False, 1), (False, 1), (True, 2)):
        assert report.run(report.JOBS[1], tmp_path, tmp_path, False, again) == ""
        assert len(asked) == runs
    assert "peers.benchmark" in asked[0]
