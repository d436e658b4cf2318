"""The figures of many QPs alike: sequences, small calls, batches, steps in CVXPY."""

import math

from validation.claims.ratios import (
    Figures,
    least,
    mean,
    most,
    numbers,
    over,
    worst,
)
from validation.harness import Row, csv_files, tables

LATENCY_SIZES = ("5", "20", "100", "300")


def of_sequences(rows: list[Row]) -> Figures:
    """Return the figures of sequences: time a step over DAQP's, the worst answers."""
    for row in rows:  # `over` asks for these; steps that are missed count as well
        row["success"] = str(bool(row["microseconds"]))
        row["set"], row["problem"] = row["scene"], (row["size"], row["level"])
    found: Figures = {}
    for scene in tables.distinct(rows, "scene"):
        name = "contact sequences" if scene == "contact" else scene
        own = tables.chosen(rows, scene=scene)
        found[f"{name} over daqp"] = mean(over(own, "daqp", "microseconds"))
        for size in tables.distinct(own, "size"):
            ratios = over(tables.chosen(own, size=size), "daqp", "microseconds")
            found[f"{name} {size} over daqp"] = mean(ratios)
    ours = tables.chosen(rows, solver="nam")
    others = [row for row in ours if row["scene"] != "contact"]
    return found | {
        "sequences, worst residual": worst(ours, "residual"),
        "sequences, worst difference": worst(ours, "difference"),
        "sequences, worst difference but in contact": worst(others, "difference"),
    }


def of_latency(rows: list[Row]) -> Figures:
    """Return the figures of one small QP: microseconds, and over the best other's."""
    found: Figures = {}
    for n in LATENCY_SIZES:
        times = {
            row["solver"]: csv_files.number(row["microseconds"])
            for row in tables.chosen(rows, n=n)
            if row["solved"] and row["solved"] == row["problems"]
        }
        others = [time for s, time in times.items() if not s.startswith("nam")]
        ours = times.get("nam", math.nan)
        found[f"one QP of {n}, us"] = ours
        found[f"one QP of {n} by daqp, us"] = times.get("daqp", math.nan)
        found[f"one QP of {n} over best other"] = ours / least(others)
    return found


def of_batches(rows: list[Row]) -> Figures:
    """Return the figures of batches: microseconds a QP, throughput of two threads."""
    own = tables.chosen(rows, n="10", m="20")
    long = tables.chosen(own, items="100000")
    one = tables.chosen(long, solver="nam", threads="1")
    two = tables.chosen(long, solver="nam", threads="2")
    peer = tables.chosen(long, solver="daqp")
    every = tables.chosen(own, solver="daqp")
    return {
        "batch, us": mean(numbers(one, "microseconds")),
        "batch by daqp, us": mean(numbers(peer, "microseconds")),
        "batch by daqp, least us": least(numbers(every, "microseconds")),
        "batch, two threads over one": mean(numbers(two, "throughput"))
        / mean(numbers(one, "throughput")),
    }


def of_cvxpy_steps(rows: list[Row]) -> Figures:
    """Return the figures of steps in CVXPY: times over OSQP's, the worst errors."""
    for row in rows:
        row["success"] = str(bool(row["steps"]) and row["optimal"] == row["steps"])
    steps = over(rows, "osqp", "total")
    found: Figures = {
        "cvxpy step over osqp, least": least(steps),
        "cvxpy step over osqp, most": most(steps),
    }
    errors = "primal_residual dual_residual complementarity objective_error".split()
    for solver in ("nam", "osqp"):
        own = tables.chosen(rows, solver=solver)
        found[f"cvxpy steps, worst error of {solver}"] = worst(own, *errors)
    for name, size in tables.distinct(rows, "problem", "set"):
        own = tables.chosen(rows, problem=name, set=size)
        share = mean(over(own, "osqp", "solver_time"))
        found[f"cvxpy solver over osqp, {name} {size}"] = share
    return found


FILES = {
    "sequences": of_sequences,
    "latency": of_latency,
    "batches": of_batches,
    "cvxpy-resolve": of_cvxpy_steps,
}
