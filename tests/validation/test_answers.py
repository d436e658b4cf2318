"""The book of answers sorts what changes."""

import pytest

from validation.answers.book import compare, difference

SOLVED = {
    "name": "a", "status": "solved", "method": "dual", "verdict": "right",
    "objective": "-1.5", "slack": "1e-9", "residual": "0.1", "size": "2", "mark": "1",
    "iterations": "3", "seconds": "1e-3",
}  # fmt: skip
STALLED = SOLVED | {"status": "stalled", "verdict": "refused", "objective": ""}
UNJUDGED = SOLVED | {"verdict": ""}
PROVED = SOLVED | {"status": "primal_infeasible", "objective": "inf", "size": ""}


@pytest.mark.parametrize(
    ("old", "new", "kind"),
    [
        (SOLVED, SOLVED, "same"),
        (SOLVED, SOLVED | {"objective": "-1.500000001"}, "same"),
        (SOLVED, UNJUDGED | {"objective": "-1.50001"}, "wrong"),
        (SOLVED, SOLVED | {"objective": "-1.50001"}, "other"),
        (SOLVED, SOLVED | {"verdict": "wrong"}, "wrong"),
        (SOLVED, UNJUDGED | {"status": "primal_infeasible"}, "wrong"),
        (PROVED, PROVED | {"status": "dual_infeasible"}, "other"),
        (PROVED, PROVED, "same"),
        (SOLVED, STALLED, "worse"),
        (STALLED, PROVED, "better"),
        (STALLED, STALLED | {"status": "time_limit"}, "failure"),
        (SOLVED, SOLVED | {"mark": "1.1"}, "point"),
        (SOLVED, SOLVED | {"iterations": "4"}, "way"),
    ],
)
def test_differences_have_kinds(old, new, kind):
    assert difference(old, new) == kind


def test_what_is_worse_is_listed(tmp_path, capsys):
    file = tmp_path / "mpc.csv"
    file.write_text("\n".join(",".join(line) for line in (SOLVED, SOLVED.values())))
    assert compare({"mpc": [SOLVED]}, tmp_path) == 0
    assert compare({"mpc": [STALLED]}, tmp_path) == 1
    assert "worse: mpc a: solved, dual" in capsys.readouterr().out
