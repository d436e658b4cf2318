"""The table of claims: its verbs, its use in the documents, what fell."""

import math

import pytest

from validation.claims.documents import DOCUMENTS, MARK, renewed
from validation.claims.figures import figure, specs, typed, values

ROWS = [
    {"problem": p, "solver": s, "time": t, "n": n}
    for p, s, t, n in (
        ("a", "nam", 1.0, 10), ("a", "piqp", 4.0, 10), ("a", "osqp", 2.0, 10),
        ("b", "nam", 2.0, 20), ("b", "piqp", math.nan, 20), ("b", "osqp", 2.0, 20),
        ("c", "piqp", 3.0, 40),
    )
]  # fmt: skip


@pytest.mark.parametrize(
    ("value", "entries", "expected"),
    [
        ("count", {}, 7),
        ("count", {"where": "solver == 'highs'"}, 0),
        ("max time", {"where": "solver == 'highs'"}, math.nan),
        ("count time", {}, 6),
        ("sum 2 * n", {"where": "solver == 'piqp'"}, 140),
        ("median time", {"where": "solver == 'nam'"}, 1.5),
        ("geomean time", {"over": "osqp"}, 0.5**0.5),
        ("max time", {"over": "best"}, 1.0),
        ("count time", {"over": "best", "when": "other < 2"}, 0),
        ("count of min time", {"each": "solver", "when": "value < 2"}, 1),
        ("share (time > 1, n)", {"where": "solver == 'nam'"}, 2 / 3),
        ("slope (n, time)", {"where": "solver == 'nam'"}, 1.0),
        ("rise time", {"where": "solver == 'piqp'"}, 0.0),
    ],
)
def test_verbs(value, entries, expected):
    found = figure(ROWS, entries | {"value": value})
    assert found == pytest.approx(expected, nan_ok=True)


def test_entries_are_numbers_where_all_are():
    assert typed(["True", "1e-3"]) == [True, 1e-3]
    assert math.isnan(typed(["", "2"])[0])
    assert typed(["", "none", "2"]) == ["", "none", "2"]


def test_every_figure_is_told_or_has_a_limit_and_is_measured(tmp_path):
    """No name twice, none without a value, a limit, a mark or a ratio made of it."""
    known, texts = specs(), [document.read_text() for document in DOCUMENTS]
    used = {name for text in texts for _, name in MARK.findall(text)}
    used |= {name for _, spec in known.values() for name in spec.get("of", ())}
    assert {name for name, (_, spec) in known.items() if "limit" not in spec} <= used
    assert used <= set(known)
    assert set(values()) == set(known)
    assert values(tmp_path) == {}  # nothing is measured without files


def test_figures_keep_their_digits():
    text = "0.80<!-- a --> s, 3e-9<!-- b -->, 7<!-- c -->"
    new = renewed(text, {"a": 0.777, "b": 2.51e-10})
    assert new == "0.78<!-- a --> s, 3e-10<!-- b -->, 7<!-- c -->"
