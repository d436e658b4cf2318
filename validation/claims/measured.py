"""The figures, by name, each from the CSV file of one script.

A ratio of times is the geometric mean, over the problems that both solve, of namlcp's
time over that of the other.
"""

from collections.abc import Callable
from pathlib import Path

from validation.claims.measured_derivatives import of_derivatives
from validation.claims.measured_lcps import of_lcps
from validation.claims.measured_paper import of_paper
from validation.claims.measured_qps import of_qps
from validation.claims.measured_repeated import of_repeated
from validation.claims.measured_trust import of_trust
from validation.claims.ratios import Figures, figures, least, most
from validation.harness import Row, cli


def of_large(rows: list[Row]) -> Figures:
    """Return how many linear solves an LCP of 10^6 unknowns takes at most."""
    ratios = [
        float(row["ratio"])
        for row in rows
        if row["solver"] == "nam"
        and row["method"] == "multigrid"
        and row["ratio"]
        and int(row["n"]) >= 900_000
    ]
    return {
        "large over one linear solve, worst": most(ratios),
        "large over one linear solve, least": least(ratios),
        "large scenes": len(ratios),
    }


def of_linear_solves(folder: Path) -> Figures:
    """Return them from the file of large LCPs."""
    return figures(folder, {"large": of_large})


SOURCES: tuple[Callable[[Path], Figures], ...] = (
    of_qps, of_repeated, of_trust, of_linear_solves, of_lcps, of_paper, of_derivatives,
)  # fmt: skip


def values(folder: Path = cli.RESULTS) -> Figures:
    """Return all figures by name."""
    found: Figures = {}
    for source in SOURCES:
        found |= source(folder)
    return found
