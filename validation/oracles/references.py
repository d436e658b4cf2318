"""Rows of the agreement table, and QPs beside their reference objectives."""

from collections.abc import Iterator
from pathlib import Path

import qpsolvers

from validation.harness import (
    Job,
    MissingDataError,
    Row,
    csv_files,
    data_folder,
    qp_solvers,
)
from validation.problems import data_sets

LARGEST = 10_000  # variables and rows of a problem of the collections
EVERY = 8  # of the collections, for a quick run


def row_of(
    scene: str,
    n: int,
    solver: str,
    quantity: str,
    value: float | None = None,
    reference: tuple[float, float, str] | None = None,
    why: str = "",
) -> Row:
    """Return a row; it agrees if |value - reference| is within the tolerance.

    `reference` is the value, the absolute tolerance and whose it is.
    """
    row: Row = {"scene": scene, "n": n, "solver": solver, "quantity": quantity}
    row |= {"value": value, "reference": None, "source": "", "error": None}
    row |= {"tolerance": None, "agrees": False, "residual": None, "why": why}
    if reference is not None and value is not None:
        row["reference"], row["tolerance"], row["source"] = reference
        row["error"] = abs(value - reference[0])
        row["agrees"] = bool(row["error"] <= reference[1])
    return row


def compared(
    scene: str,
    n: int,
    quantity: str,
    values: dict[str, float],
    reference: tuple[float, float, str],
) -> list[Row]:
    """Return the rows of all solvers for one quantity."""
    return [
        row_of(scene, n, solver, quantity, value, reference)
        for solver, value in values.items()
    ]


def reference_objectives(data: Path) -> dict[str, tuple[float, str, float]]:
    """Return objective, whose, and its gap, of what a peer solved best."""
    found = {}
    file = data_folder.require(data / "maros_meszaros" / "reference_objectives.csv")
    for row in csv_files.read(file):
        residuals = {
            s: sum(float(row[f"{s}_{r}"]) for r in ("rp", "rd", "gap"))
            for s in ("piqp", "clarabel")
            if row[f"{s}_found"] == "1"
        }
        if residuals:
            solver = min(residuals, key=lambda s: (residuals[s], s))
            number = float(row[f"{solver}_obj"])
            found[Path(row["file"]).stem] = number, solver, residuals[solver]
    return found


def collections(
    data: Path | None, quick: bool
) -> Iterator[tuple[str, int, tuple[float, str, float]]]:
    """Yield QPs of Maros and Meszaros: name, n, objective with whose and its residuals.

    The tolerance is 1e-6 of the objective plus the reference's own residuals.
    Those of more than LARGEST variables or rows are left out: `maros_meszaros`.
    """
    if data is None:
        return
    try:
        references = reference_objectives(data)
        index = data_sets.maros_index(data, "all")
    except MissingDataError as error:
        print(f"{error}, left out")
        return
    largest = 500 if quick else LARGEST
    sizes = {n: max(int(index[n][k]) for k in ("n", "mG", "mA")) for n in references}
    names = [name for name in sorted(references) if sizes[name] <= largest]
    for name in names[:: EVERY if quick else 1]:
        yield name, int(index[name]["n"]), references[name]


def collection_row(
    name: str, n: int, reference: tuple[float, str, float], answer: Row
) -> Row:
    """Return the row of one QP; the reference is objective, whose, its residuals."""
    number, solver, worst = reference
    scene, why = f"QP {name}", answer.get("status", "")
    if "positive semidefinite" in why:  # VALUES has an eigenvalue of -1.3e-5
        return row_of(scene, n, "nam", "status", why="not convex") | {"agrees": True}
    known = number, 1e-6 * (1.0 + abs(number)) + worst, solver
    value = answer.get("objective")
    row = row_of(scene, n, "nam", "objective", value, known, why)
    row["residual"] = answer.get("residual")
    if row["agrees"]:
        row["why"] = ""
    elif why == "solved" and value is not None:
        row["why"] = f"residuals {row['residual']:.0e}, {solver}'s stored {worst:.0e}"
    return row


def objective_of(job: Job, name: str) -> Row:
    options = qp_solvers.settings(job.solver, 1e-9, job.limit)
    problem = data_sets.load(job.data, "all", name)
    job.ready()
    found = qpsolvers.solve_problem(problem, solver=job.solver, **options)
    row: Row = {"status": found.extras["status"]}
    if found.x is not None:
        worst = found.primal_residual(), found.dual_residual(), found.duality_gap()
        x = found.x
        row["objective"] = float(0.5 * x @ (problem.P @ x) + problem.q @ x)
        row["residual"] = float(max(worst))
    return row
