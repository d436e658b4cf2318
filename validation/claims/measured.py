"""The figures, by name, each from the CSV file of one script.

A ratio of times is the geometric mean, over the problems that both solve, of namlcp's
time over that of the other.
"""

from pathlib import Path

from validation.claims import (
    measured_derivatives,
    measured_lcps,
    measured_paper,
    measured_qps,
    measured_repeated,
    measured_trust,
)
from validation.claims.ratios import Figures, figures
from validation.harness import cli

SOURCES = (
    measured_qps, measured_repeated, measured_trust, measured_lcps, measured_paper,
    measured_derivatives,
)  # fmt: skip


def values(folder: Path = cli.RESULTS) -> Figures:
    """Return all figures by name."""
    found: Figures = {}
    for source in SOURCES:
        found |= figures(folder, source.FILES)
    return found
