"""The figures of QPs solved once: sets of problems, collections, models in CVXPY."""

import math

from validation.claims.ratios import (
    Figures,
    mean,
    most,
    numbers,
    over,
    solved,
    worst,
)
from validation.harness import Row, csv_files, judging, tables

SETS = {"mpc": "daqp", "contact": "piqp", "small": "piqp", "strict": "piqp"}
"""The sets of peers.benchmark, and the peer of each."""

BANDS = {
    "below 1 ms": (0.0, 1e-3),
    "1 to 10 ms": (1e-3, 1e-2),
    "above 10 ms": (1e-2, 1e9),
}
"""Times of the peer [s] by which the ratios on Maros-Meszaros are split."""

CLASS_ENTRIES = 5000
"""Entries of a problem of the OSQP paper's classes, if not of the smallest size."""

SHOWN_SCENES = ("kaplas_570", "granular2d_2020")
"""Contact scenes whose times are told one by one."""


def of_benchmark(rows: list[Row]) -> Figures:
    """Return the figures of the small sets; a name without a tolerance is at 1e-6."""
    found: Figures = {}
    for problem_set, peer in SETS.items():
        every = tables.chosen(rows, set=problem_set)
        found[f"{problem_set} problems"] = len(tables.distinct(every, "problem"))
        for eps, at in (("1e-06", ""), ("1e-09", " at 1e-9")):
            own = tables.chosen(every, eps=eps)
            found[f"{problem_set} solved{at}"] = solved(own)
            found[f"{problem_set} solved by {peer}{at}"] = solved(own, peer)
            found[f"{problem_set} over {peer}{at}"] = mean(over(own, peer))
    return found


def of_contact(rows: list[Row]) -> Figures:
    """Return the figures of contact scenes by solve_lcp: times in milliseconds."""
    found: Figures = {}
    for solver, name in (("nam", "contact LCPs"), ("piqp", "contact LCPs by piqp")):
        own = tables.chosen(rows, solver=solver)
        residuals = numbers(own, "relative_residual")
        found[name] = len(own)
        found[f"{name} solved"] = sum(residual <= 1e-9 for residual in residuals)
        found[f"{name}, ms"] = 1e3 * mean(numbers(own, "runtime"))
        for row in own:
            if row["scene"] in SHOWN_SCENES:
                shown = f"{name}, {row['scene']}"
                found[f"{shown} ms"] = 1e3 * csv_files.number(row["runtime"])
                found[f"{shown} residual"] = csv_files.number(row["relative_residual"])
    return found


def is_wrong(row: Row) -> bool:
    """Tell whether an answer is called found and misses its tolerance tenfold."""
    limit = 10.0 * float(row["eps"])
    errors = (csv_files.number(row[name]) for name in judging.RESIDUALS)
    return row["found"] == "True" and not all(error <= limit for error in errors)


def of_maros_meszaros(rows: list[Row]) -> Figures:
    """Return the figures of the Maros-Meszaros collection."""
    every = tables.chosen(rows, limit="10.0")
    ours = tables.chosen(every, solver="nam")
    name = "Maros-Meszaros"
    found: Figures = {f"{name} problems": len(tables.distinct(ours, "problem"))}
    found[f"{name} wrong"] = sum(map(is_wrong, ours))
    for eps, short in (("1e-06", "1e-6"), ("1e-09", "1e-9")):
        own = tables.chosen(every, eps=eps)
        found[f"{name} solved at {short}"] = solved(own)
        for peer in ("piqp", "clarabel", "osqp", "proxqp"):
            found[f"{name} solved by {peer} at {short}"] = solved(own, peer)
        found[f"{name} over piqp at {short}"] = mean(over(own, "piqp"))
    own = tables.chosen(every, eps="1e-06")
    found[f"{name} over piqp"] = mean(over(own, "piqp"))
    found[f"{name} over piqp, worst"] = most(over(own, "piqp"))
    times = {
        row["problem"]: csv_files.number(row["runtime"])
        for row in tables.chosen(own, solver="piqp", success="True")
    }
    for band, (low, high) in BANDS.items():
        part = [r for r in own if low <= times.get(r["problem"], math.nan) < high]
        found[f"{name} over piqp, {band}"] = mean(over(part, "piqp"))
    return found


def of_classes(rows: list[Row]) -> Figures:
    """Return the figures of the OSQP paper's classes, beside the best peer of each."""
    ratios: list[float] = []
    larger: list[float] = []
    for problem_set, name in tables.distinct(rows, "set", "problem"):
        own = tables.chosen(rows, set=problem_set, problem=name, success="True")
        times = {row["solver"]: float(row["runtime"]) for row in own}
        ours = times.pop("nam", math.inf)
        if times:
            ratios.append(ours / min(times.values()))
            if int(own[0]["entries"]) >= CLASS_ENTRIES:
                larger.append(ratios[-1])
    ours = tables.chosen(rows, solver="nam")
    beyond = "classes over best peer, worst from 10^4 entries"
    return {
        "classes problems": len(ours),
        "classes solved": solved(ours),
        "classes missed": len(ours) - solved(ours),
        "classes over best peer": mean(ratios),
        "classes over best peer, worst": most(ratios),
        beyond: most(larger),
        "classes above 1.3": sum(ratio > 1.3 for ratio in ratios),
    }


def of_changes(rows: list[Row]) -> Figures:
    """Return how many changed problems of each kind are solved."""
    found: Figures = {}
    for kind in ("plain", "rows", "columns", "noise"):
        own = tables.chosen(rows, set=kind, solver="nam")
        found[f"changed problems, {kind}"] = len(own)
        found[f"changed problems solved, {kind}"] = solved(own)
    return found


def of_families(rows: list[Row]) -> Figures:
    """Return how many random QPs are solved."""
    return {
        "random families": len(tables.chosen(rows, solver="nam")),
        "random families solved": solved(rows),
        "random families solved by piqp": solved(rows, "piqp"),
    }


def of_infeasible(rows: list[Row]) -> Figures:
    """Return the figures of QPs without a solution, and of the others among them."""
    for row in rows:
        row["success"] = str(row["outcome"] == "recognised")
        row["set"] = row["group"]
    without = [row for row in rows if row["truth"] not in ("feasible", "not convex")]
    every = tables.chosen(rows, solver="nam")
    ours = tables.chosen(without, solver="nam")
    small = [row for row in ours if int(row["variables"]) < 1000]
    found = {
        f"without a solution, recognised by {peer}": solved(without, peer)
        for peer in ("osqp", "piqp", "clarabel")
    }
    return found | {
        "without a solution": len(ours),
        "without a solution, recognised": solved(ours),
        "without a solution, not recognised": len(ours) - solved(ours),
        "without a solution, slowest": worst(small, "runtime"),
        "without a solution over clarabel": mean(over(without, "clarabel")),
        "without a solution over piqp": mean(over(without, "piqp")),
        "solvable or not convex": len(every) - len(ours),
        "solvable or not convex, right": solved(every) - solved(ours),
        "proofs misjudged": len(tables.chosen(every, outcome="misjudged")),
    }


def of_cvxpy(rows: list[Row]) -> Figures:
    """Return the figures of models in CVXPY."""
    ours = tables.chosen(rows, solver="nam")
    errors = "primal_residual", "dual_residual", "complementarity"
    found: Figures = {
        "cvxpy models": len(ours),
        "cvxpy models right": solved(ours),
        "cvxpy models right by osqp": solved(rows, "osqp"),
        "cvxpy models right by clarabel": solved(rows, "clarabel"),
        "cvxpy models, worst objective": worst(ours, "objective_error"),
        "cvxpy models, worst residual": worst(ours, *errors),
    }
    for size in ("small", "large"):
        own = tables.chosen(rows, set=size)
        for peer in ("osqp", "clarabel"):
            found[f"cvxpy {size} over {peer}"] = mean(over(own, peer))
    return found


FILES = {
    "benchmark": of_benchmark,
    "contact": of_contact,
    "maros-meszaros": of_maros_meszaros,
    "classes": of_classes,
    "generalisation": of_changes,
    "generalisation-families": of_families,
    "infeasible": of_infeasible,
    "cvxpy-models": of_cvxpy,
}
