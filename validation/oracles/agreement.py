"""NAM beside independent oracles on every scene, against the values that are known.

Scenes and known values: `scenes`; solvers: `solvers`, each asked for
1e-10, in a child process with a time limit. One row of the CSV is one quantity of one
scene by one solver. The reference is the known value, to the digits that are printed.
Where there is none:

- objective: the value of the oracle with the least natural residual, to 1e-8 of its
  size; of a nonsymmetric LCP, which has none, the relative natural residual, to 1e-8;
- z (where it is unique) and w (by the solver's own multipliers): the largest
  difference from NAM, over 1 + the largest entry of NAM's, to 1e-6.

Then QPs of Maros and Meszaros beside their reference objectives. A row that does not
agree says why in its last column.
"""

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import qpsolvers

from namlcp import natural_residual
from validation.harness import (
    Job,
    MissingDataError,
    Row,
    csv_files,
    data_folder,
    qp_solvers,
)
from validation.harness.suite import Args, Suite
from validation.oracles.scenes import Scene, objective, scenes
from validation.oracles.solvers import ORACLES, Answer, is_symmetric
from validation.problems import data_sets, known_scenes

AGREED = 1e-8  # relative, of objectives and residuals
NEAR = 1e-6  # of z and w, relative to 1 + their largest entry
DEFINITION = 0.0, AGREED, "definition"
QUICK_SIZE = 2500  # unknowns at most


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


def work(job: Job, function: Callable[..., Row], *arguments: Any) -> Row:
    return function(job, *arguments)


@cache
def warm_up(solver: str) -> None:
    """Call a solver once, so that it is imported and compiled."""
    ORACLES[solver][1](known_scenes.dam(), 60.0)


def answered(job: Job, scene: known_scenes.BoxLCP) -> Row:
    """Return {"answer": what a solver says of a scene}."""
    call = ORACLES[job.solver][1]
    warm_up(job.solver)
    if job.solver == "nam":
        call(scene, job.limit)  # compiled
    job.ready()
    return {"answer": call(scene, job.limit)}


def requests(args: Args) -> Iterator[Row]:
    for name, scene in scenes(args.data).items():
        if args.quick and not scene.quick:
            continue
        lcp = scene.make(args.data)
        if lcp is None or (args.quick and lcp.q.size > QUICK_SIZE):
            continue
        ask = lambda lcp=lcp: (answered, lcp)  # noqa: E731
        yield {"scene": name, "of": scene, "lcp": lcp, "ask": ask}
    for name, n, known in collections(args.data, args.quick):
        key = {"scene": f"QP {name}", "solver": "nam", "qp": (name, n, known)}
        yield key | {"ask": lambda name=name: (objective_of, name)}


def conclude(rows: list[Row]) -> list[Row]:
    first = rows[0]
    if "qp" in first:
        return [collection_row(*first["qp"], first)]
    answers = {
        row["solver"]: row.get("answer", Answer(None, None, row.get("status", "")))
        for row in rows
    }
    found = {solver: a for solver, a in answers.items() if a is not None}
    return scene_rows(first["scene"], first["of"], first["lcp"], found)


def residual_of(scene: known_scenes.BoxLCP, z: np.ndarray | None) -> float:
    """Return the natural residual relative to that of z = 0 clipped."""
    if z is None or not np.isfinite(z).all():
        return np.inf
    start = np.clip(np.zeros_like(z), scene.lower, scene.upper)
    sides = scene.lower, scene.upper
    first = natural_residual(start, scene.A @ start + scene.q, *sides)
    return natural_residual(z, scene.A @ z + scene.q, *sides) / max(first, 1e-300)


def scene_rows(
    name: str, scene: Scene, lcp: known_scenes.BoxLCP, found: dict[str, Answer]
) -> list[Row]:
    """Return the rows of one scene: known values, then objective, z and w."""
    residuals = {s: residual_of(lcp, a.z) for s, a in found.items()}
    have = [s for s in found if residuals[s] < np.inf]
    rows: list[Row] = []
    for known in scene.known:
        reference = known.value, known.absolute, known.source
        values = {s: known.of(lcp, found[s].z) for s in have}
        rows += compared(name, lcp.q.size, known.quantity, values, reference)
    peers = [s for s in have if s != "nam"]
    if not is_symmetric(lcp.A):
        values = {s: residuals[s] for s in have}
        rows += compared(name, lcp.q.size, "residual", values, DEFINITION)
    elif peers and not any(known.quantity == "objective" for known in scene.known):
        best = min(peers, key=lambda s: residuals[s])
        values = {s: objective(lcp, found[s].z) for s in have}
        size = max(abs(values[best]), 1e-300)
        reference = values[best], AGREED * size, best
        rows += compared(name, lcp.q.size, "objective", values, reference)
    ours = found.get("nam")
    for part in ("z", "w") if scene.unique else ("w",):
        if ours is None or "nam" not in have:
            continue
        own = getattr(ours, part)
        size = 1.0 + float(np.abs(own).max())
        values = {
            s: float(np.abs(getattr(found[s], part) - own).max()) / size
            for s in peers
            if getattr(found[s], part) is not None
        }
        rows += compared(name, lcp.q.size, part, values, (0.0, NEAR, "nam"))
    for row in rows:
        solver = row["solver"]
        row["residual"] = residuals[solver]
        if not row["agrees"]:
            row["why"] = reason(row, found[solver].said, residuals)
    silent = [s for s in found if s not in have]
    return rows + [
        row_of(name, lcp.q.size, s, "objective", why=f"no point: {found[s].said}")
        for s in silent
    ]


def reason(row: Row, said: str, residuals: dict[str, float]) -> str:
    """Return why a row does not agree, from the natural residuals."""
    own, ours = residuals[row["solver"]], residuals.get("nam", np.inf)
    source = residuals.get(row["source"], 0.0)
    if source > 10.0 * own:
        return f"natural residual {own:.0e}, of the reference {source:.0e}"
    if said not in ("solved", "optimal"):
        return f"gave up ({said}), natural residual {own:.0e}"
    if own > 1e-9 and own > 10.0 * ours:
        return f"inaccurate: natural residual {own:.0e}, nam {ours:.0e}"
    if row["quantity"] == "z":
        return f"A is ill-conditioned: natural residual {own:.0e}, nam {ours:.0e}"
    if row["quantity"] == "w":
        return f"multipliers less accurate than z: residual of z {own:.0e}"
    return f"error {row['error']:.0e} at a natural residual of {own:.0e}"


SUITE = Suite(
    name="oracles",
    doc=__doc__,
    requests=requests,
    work=work,
    conclude=conclude,
    columns=(
        "scene n solver quantity value reference source error tolerance agrees residual"
        " why"
    ),
    keys="scene solver",
    solvers=tuple(ORACLES),
    packages={solver: package for solver, (package, _) in ORACLES.items()},
    limit=60.0,
    quick={"limit": 3.0},
)
