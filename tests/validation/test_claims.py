"""What the figures of the README are made of: what counts as wrong, best, fallen."""

from validation.claims import Claim, measured, moved
from validation.claims import values as figures_of
from validation.claims.limits import LIMITS
from validation.claims.ratios import figures
from validation.harness import cli


def test_every_figure_has_one_source_and_every_limit_a_figure(tmp_path):
    alone = [figures(cli.RESULTS, source.FILES) for source in measured.SOURCES]
    assert sum(map(len, alone)) == len(set().union(*alone))
    assert set(LIMITS) <= set(figures_of())
    assert figures_of(tmp_path) == {}  # nothing is measured without files


def test_claims_that_fell_are_marked():
    before = [Claim("time", 0.9, "<=", 1.0), Claim("solved", 7, ">=", 8)]
    now = [before[0]._replace(value=1.1), before[1]._replace(value=float("nan"))]
    text = moved(before, now)
    assert "| time | <= 1 | 0.9 | 1.1 | FELL |" in text
    assert "| solved | >= 8 | 7 | nan | falls short |" in text
