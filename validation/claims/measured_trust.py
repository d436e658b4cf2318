"""The figures of answers to be trusted: oracles, fuzzed problems."""

from validation.claims.ratios import Figures
from validation.harness import Row, tables

KNOWN = ("scenes.md", "Bueler", "index.json", "published")
"""Sources of values that no solver of the run has computed."""

TRUTHS = {
    "QPs solvable": ("QP", ("solvable",)),
    "QPs without a solution": ("QP", ("infeasible", "unbounded", "both")),
    "LCPs solvable": ("LCP", ("solvable",)),
    "LCPs without a solution": ("LCP", ("unsolvable",)),
    "not convex": ("QP", ("not convex",)),
    "malformed": ("malformed", ("malformed",)),
}
"""What is counted of the campaign: how its classes begin, and what is true of them."""


def of_oracles(rows: list[Row]) -> Figures:
    """Return the figures of agreement with other solvers and known values."""
    ours = tables.chosen(rows, solver="nam")
    peers = [row for row in rows if row["solver"] != "nam"]
    missed = tables.chosen(peers, agrees="False")
    known = [row for row in rows if row["source"] in KNOWN]
    agreed = [r for r in tables.chosen(known, agrees="True") if r["solver"] != "nam"]
    values = tables.distinct(known, "scene", "quantity")
    found = tables.distinct(agreed, "scene", "quantity")
    return {
        "oracles, scenes": len(tables.distinct(rows, "scene")),
        "oracles, quantities": len(ours),
        "oracles, quantities that agree": len(tables.chosen(ours, agrees="True")),
        "oracles, known values": len(values),
        "oracles, known values by another": len(found),
        "oracles, misses of peers": len(missed),
        "oracles, misses without a reason": len(tables.chosen(missed, why="")),
    }


def total(rows: list[Row], **wanted: str) -> int:
    """Return how many problems the rows with these values count."""
    return sum(int(row["count"]) for row in tables.chosen(rows, **wanted))


def of_campaign(rows: list[Row]) -> Figures:
    """Return the counts of fuzzed problems, of all seeds and sets that there are.

    "general" LCPs need not all be decided: they count where nothing may be wrong.
    """
    ours = tables.chosen(rows, solver="nam")
    found: Figures = {"campaign problems": total(ours, outcome="done")}
    for outcome in ("wrong", "raised", "hang", "crash"):
        found[f"campaign {outcome}"] = total(ours, outcome=outcome)
    decided = [row for row in ours if row["set"] != "general"]
    for name, (side, truths) in TRUTHS.items():
        own = [r for r in decided if r["class"].startswith(side)]
        own = [r for r in own if r["truth"] in truths]
        found[f"campaign, {name}"] = total(own)
        found[f"campaign, {name}, right"] = total(own, outcome="right")
    return found


FILES = {"oracles": of_oracles, "campaign": of_campaign}
