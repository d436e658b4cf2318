"""The figures of derivatives, closest points and first solves."""

import math

from validation.claims.ratios import Figures, least, mean, most, numbers
from validation.harness import Row, csv_files, tables

SHIFTS, CONDITIONS = 1e-8, 1e-9
"""To what shifts have to be those of another solver, and the conditions hold."""

LONG = 1e-3  # [s] of a feasible solve, from which its ratio to "closest" says something
THREE = 3.0  # feasible solves that "closest" may take
NO_LESS = 1e-6  # of the least norm, by which proxqp may exceed it
NOTHING_TO_SHIFT = "No shift helps", "no closest point"


def of_differences(rows: list[Row]) -> Figures:
    """Return the errors of derivatives, and how many at kinks are right."""
    kinks = [row for row in rows if row["data"] != "all"]
    found: Figures = {
        "kinks": sum(numbers(kinks, "problems")),
        "kinks, right": sum(numbers(kinks, "right")),
        "kinks, families": len(tables.distinct(kinks, "family")),
        "derivatives, adjoint": most(numbers(rows, "adjoint")),
    }
    for row in tables.chosen(rows, data="all"):
        found[f"derivatives, {row['family']}"] = csv_files.number(row["error"])
    return found


def of_packages(rows: list[Row]) -> Figures:
    """Return times of solve and backward over the best peer's, and all errors."""
    found: Figures = {}
    for case in tables.distinct(rows, "case"):
        times: Figures = {}
        ours: Row = {}
        for row in tables.chosen(rows, case=case):
            parts = (csv_files.number(row[part]) for part in ("solve", "backward"))
            times[row["solver"]] = sum(parts)
            if row["solver"] == "nam":
                ours = row
        if not ours:
            continue
        time = times.pop("nam")
        best = least([peer for peer in times.values() if not math.isnan(peer)])
        linear = csv_files.number(ours["backward"]) / csv_files.number(ours["linear"])
        found[f"backward over best peer, {case}"] = time / best
        found[f"backward over solve, {case}"] = csv_files.number(ours["ratio"])
        found[f"backward over linear solve, {case}"] = linear
    qps = [row for row in rows if row["case"] != "obstacle"]
    groups = {
        "nam": tables.chosen(qps, solver="nam"),
        "dqp": tables.chosen(qps, solver="dqp"),
        "others": [row for row in qps if row["solver"] not in ("nam", "dqp")],
    }
    for name, own in groups.items():
        errors = numbers(own, "error")
        found[f"backward, least error of {name}"] = least(errors)
        found[f"backward, most error of {name}"] = most(errors)
    return found


def of_closest(rows: list[Row]) -> Figures:
    """Return whether closest points are right, and their cost beside feasible solves.

    Problems with nothing to shift are left out, and only of those solved is there a
    norm.
    """
    there = [row for row in rows if not row["said"].startswith(NOTHING_TO_SHIFT)]
    solved = [row for row in there if row["norm"]]
    shifts = [
        min(numbers([row], "clarabel") + numbers([row], "piqp"), default=math.inf)
        for row in solved
    ]
    right = [
        shift <= SHIFTS and csv_files.number(row["conditions"]) <= CONDITIONS
        for shift, row in zip(shifts, solved, strict=True)
    ]
    made = [row for row in rows if row["group"].startswith("Maros-Meszaros")]
    found: Figures = {
        "closest problems": len(rows),
        "closest problems of Maros-Meszaros": len(made),
        "closest points": len(there),
        "closest points right": sum(right),
        "closest, worst shift": most(shifts),
        "closest, worst conditions": most(numbers(solved, "conditions")),
    }
    return found | of_time_of_closest(solved) | of_proxqp(solved)


def of_time_of_closest(solved: list[Row]) -> Figures:
    """Return the times of closest points over those of feasible solves."""
    both = [row for row in solved if row["feasible"]]
    slow = [row for row in both if float(row["feasible"]) >= LONG]
    quick = [row for row in both if float(row["feasible"]) < LONG]
    ratios = numbers(slow, "ratio")
    stagewise = numbers(tables.chosen(both, group="MPC, stagewise"), "ratio")
    milliseconds = [1e3 * time for time in numbers(quick, "closest")]
    return {
        "closest, slow problems": len(slow),
        "closest over feasible": mean(ratios),
        "closest over feasible, least": least(ratios),
        "closest over feasible, most": most(ratios),
        "closest over feasible, above three": sum(ratio > THREE for ratio in ratios),
        "closest over feasible, stagewise": mean(stagewise),
        "quick closest over feasible, most": most(numbers(quick, "ratio")),
        "quick closest, least ms": least(milliseconds),
        "quick closest, mean ms": mean(milliseconds),
        "quick closest, most ms": most(milliseconds),
    }


def of_proxqp(solved: list[Row]) -> Figures:
    """Return the time of proxqp's own option over ours, and what its norms exceed."""
    asked = [row for row in solved if row["proxqp"] and row["soft"]]
    ratios = [float(row["proxqp"]) / float(row["soft"]) for row in asked]
    excess = numbers(asked, "excess")
    return {
        "proxqp over closest": mean(ratios),
        "proxqp over closest, most": most(ratios),
        "proxqp, problems": len(asked),
        "proxqp, norms not the least": sum(share > NO_LESS for share in excess),
        "proxqp, most percent above the least norm": 100.0 * most(excess),
    }


def of_first_call(rows: list[Row]) -> Figures:
    """Return the times [ms] of first solves in a process, and of the import."""
    solves, imports = (
        [1e3 * s for s in numbers(rows, part)] for part in ("solve", "import")
    )
    return {
        "first solves": len(rows),
        "first solve, least": least(solves),
        "first solve, most": most(solves),
        "import, least": least(imports),
        "import, most": most(imports),
    }


FILES = {
    "derivatives": of_differences,
    "derivatives-peers": of_packages,
    "closest": of_closest,
    "first-call": of_first_call,
}
