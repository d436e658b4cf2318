"""The figures, by name, each from the CSV file of one script.

A ratio of times is the geometric mean, over the problems that both solve, of namlcp's
time over that of the other.
"""

import math
from collections.abc import Callable
from pathlib import Path

from validation.claims.measured_derivatives import of_derivatives
from validation.claims.measured_lcps import of_lcps
from validation.claims.measured_paper import of_paper
from validation.claims.ratios import mean, over, solved
from validation.harness import cli, csv_files, tables

BANDS = {"below 1 ms": (0.0, 1e-3), "1 to 10 ms": (1e-3, 1e-2), "above": (1e-2, 1e9)}
"""Times of the peer [s] by which the ratios on Maros-Meszaros are split."""


def of_benchmark(folder: Path) -> dict[str, float]:
    """Return the figures of the small sets, at 1e-6."""
    found = {}
    rows = tables.chosen(csv_files.read(folder / "benchmark.csv"), eps="1e-06")
    for problem_set, peer in (("mpc", "daqp"), ("contact", "piqp"), ("small", "piqp")):
        own = tables.chosen(rows, set=problem_set)
        found[f"{problem_set} solved"] = solved(own)
        found[f"{problem_set} problems"] = len(tables.distinct(own, "problem"))
        found[f"{problem_set} over {peer}"] = mean(over(own, peer))
    return found


def of_maros_meszaros(folder: Path) -> dict[str, float]:
    """Return the figures of the Maros-Meszaros collection."""
    every = csv_files.read(folder / "maros-meszaros.csv")
    every = tables.chosen(every, limit="10.0")
    found = {}
    name = "Maros-Meszaros"
    for eps in ("1e-06", "1e-09"):
        rows = tables.chosen(every, eps=eps)
        short = eps.replace("-0", "-")
        found[f"{name} solved at {short}"] = solved(rows)
        found[f"{name} solved by piqp at {short}"] = solved(rows, "piqp")
    rows = tables.chosen(every, eps="1e-06")
    ratios = over(rows, "piqp")
    found[f"{name} over piqp"] = mean(ratios)
    found[f"{name} over piqp, worst"] = max(ratios, default=math.nan)
    peer = {r["problem"]: float(r["runtime"] or "nan") for r in rows}
    peer |= {
        row["problem"]: float(row["runtime"] or "nan")
        for row in tables.chosen(rows, solver="piqp")
    }
    for band, (least, most) in BANDS.items():
        own = [row for row in rows if least <= peer[row["problem"]] < most]
        found[f"{name} over piqp, {band}"] = mean(over(own, "piqp"))
    return found


def of_classes(folder: Path) -> dict[str, float]:
    """Return the figures of the OSQP paper's classes, beside the best peer of each."""
    rows = csv_files.read(folder / "classes.csv")
    ratios = []
    for problem_set, name in tables.distinct(rows, "set", "problem"):
        own = tables.chosen(rows, set=problem_set, problem=name, success="True")
        times = {row["solver"]: float(row["runtime"]) for row in own}
        ours = times.pop("nam", math.inf)
        if times:
            ratios.append(ours / min(times.values()))
    ours = tables.chosen(rows, solver="nam")
    return {
        "classes problems": len(ours),
        "classes missed": len(ours) - solved(ours),
        "classes over best peer": mean(ratios),
        "classes over best peer, worst": max(ratios, default=math.nan),
    }


def of_sequences(folder: Path) -> dict[str, float]:
    """Return the figures of sequences: time a step over DAQP's, the worst answers."""
    rows = csv_files.read(folder / "sequences.csv")
    ours = {
        (row["scene"], row["size"], row["level"]): row
        for row in tables.chosen(rows, solver="nam")
    }
    found: dict[str, float] = {}
    for scene in ("condensed MPC", "sparse MPC, definite", "portfolio"):
        ratios = [
            float(ours[scene, row["size"], row["level"]]["microseconds"])
            / float(row["microseconds"])
            for row in tables.chosen(rows, solver="daqp", scene=scene)
        ]
        found[f"{scene} over daqp"] = mean(ratios)
    for column in ("residual", "difference"):
        worst = (float(row[column]) for row in ours.values())
        found[f"sequences, worst {column}"] = max(worst, default=math.nan)
    return found


def of_infeasible(folder: Path) -> dict[str, float]:
    """Return the figures of QPs without a solution."""
    rows = csv_files.read(folder / "infeasible.csv")
    for row in rows:
        row["success"] = str(row["outcome"] == "recognised")
        row["set"] = row["group"]
    without = [row for row in rows if row["truth"] not in ("feasible", "not convex")]
    ours = tables.chosen(without, solver="nam")
    return {
        "without a solution": len(ours),
        "without a solution, not recognised": len(ours) - solved(ours),
        "without a solution over clarabel": mean(over(without, "clarabel")),
    }


def of_large(folder: Path) -> dict[str, float]:
    """Return how many linear solves an LCP of 10^6 unknowns takes at most."""
    rows = tables.chosen(csv_files.read(folder / "large.csv"), solver="nam")
    kinds = ("multigrid",)
    ratios = [
        float(row["ratio"])
        for row in rows
        if row["ratio"] and row["method"] in kinds and int(row["n"]) >= 900_000
    ]
    return {
        "large over one linear solve, worst": max(ratios, default=math.nan),
        "large over one linear solve, least": min(ratios, default=math.nan),
        "large scenes": len(ratios),
    }


def of_cvxpy(folder: Path) -> dict[str, float]:
    """Return the ratios on models in CVXPY."""
    rows = csv_files.read(folder / "cvxpy-models.csv")
    return {
        f"cvxpy {size} over clarabel": mean(over(own, "clarabel"))
        for size in ("small", "large")
        if (own := tables.chosen(rows, set=size))
    }


def of_stress(folder: Path) -> dict[str, float]:
    """Return what was not right under stress, and what was wrong in the campaign."""
    rows = tables.chosen(csv_files.read(folder / "stress.csv"), solver="nam")
    campaign = tables.chosen(csv_files.read(folder / "campaign.csv"), solver="nam")
    wrong = tables.chosen(campaign, outcome="wrong")
    done = tables.chosen(campaign, outcome="done")
    return {
        "stress problems": len(rows),
        "stress not right": sum(row["outcome"] != "right" for row in rows),
        "campaign problems": sum(int(row["count"]) for row in done),
        "campaign wrong": sum(int(row["count"]) for row in wrong),
    }


SOURCES: tuple[Callable[[Path], dict[str, float]], ...] = (
    of_benchmark, of_maros_meszaros, of_classes, of_infeasible, of_large, of_cvxpy,
    of_stress, of_sequences, of_lcps, of_paper, of_derivatives,
)  # fmt: skip


def values(folder: Path = cli.RESULTS) -> dict[str, float]:
    """Return all figures by name."""
    found: dict[str, float] = {}
    for source in SOURCES:
        found |= source(folder)
    return found
