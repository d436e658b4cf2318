"""What is compared besides single box LCPs: each part yields rows of the table.

A part takes the data folder (or None) and whether to be quick.
"""

import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import qpsolvers
from scipy.optimize import nnls

from namlcp import natural_residual, solve_lcp
from validation.harness import Job, MissingDataError, Row, qp_solvers
from validation.oracles.scenes import bimatrix, reference_objectives, textbook
from validation.oracles.solvers import lemke
from validation.problems import american_puts, data_sets, hertz, known_scenes

Part = Callable[[Path | None, bool], Iterator[Row]]
LIMIT = 60.0  # [s]
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


def textbook_lcps(data: Path | None, quick: bool) -> Iterator[Row]:
    """Compare residuals with those of Lemke's stored answers."""
    for name, lcp, stored in textbook(data):
        yield from residual_rows(f"textbook {name}", lcp, {"lemke": stored})


def bimatrix_game(data: Path | None, quick: bool) -> Iterator[Row]:
    """Solve or refuse a game, A neither P nor semidefinite; Lemke may end in a ray."""
    lcp = bimatrix()
    answer = None
    if importlib.util.find_spec("quantecon"):
        answer = lemke(lcp, LIMIT)
    points = {} if answer is None else {"lemke": answer.z}
    yield from residual_rows("bimatrix game", lcp, points)


def residual_rows(
    scene: str, lcp: known_scenes.BoxLCP, points: dict[str, np.ndarray | None]
) -> Iterator[Row]:
    """Yield the natural residuals of NAM and of points; NAM may refuse, others fail."""
    found = solve_lcp(*lcp)
    said, n = found.status.value, lcp.q.size
    if said == "unsolvable":
        row = row_of(scene, n, "nam", "status", why="refused")
        yield row | {"agrees": True}
    else:
        points = {"nam": found.z} | points
    size = float(np.linalg.norm(np.minimum(lcp.q, 0.0))) or 1.0
    values = {
        solver: natural_residual(z, lcp.A @ z + lcp.q, lcp.lower, lcp.upper) / size
        for solver, z in points.items()
        if z is not None
    }
    for row in compared(scene, n, "residual", values, (0.0, 1e-8, "definition")):
        if not row["agrees"]:
            row["why"] = said if row["solver"] == "nam" else "stored to few digits"
        yield row
    for solver in (s for s, z in points.items() if z is None):
        yield row_of(scene, n, solver, "residual", why="fails (secondary ray)")


def puts(data: Path | None, quick: bool) -> Iterator[Row]:
    """American puts on 4000 nodes and steps, to BOUND; Brennan and Schwartz beside."""
    size = 400 if quick else 4000
    bound = american_puts.BOUND * (4000 / size) ** 2
    for name, put in american_puts.PUTS.items():
        grid = american_puts.grid_of(put, size, size)
        marches = {
            "nam": american_puts.Package(grid),
            "brennan-schwartz": american_puts.Kept(grid),
        }
        for march in marches.values():
            march.run(size + american_puts.EULER_STEPS // 2)
        values = {solver: march.price(put.spot) for solver, march in marches.items()}
        scene = f"American put, {name}"
        yield from compared(
            scene, size, "price", values, (put.price, bound, "published")
        )
        apart = float(np.abs(marches["nam"].V - marches["brennan-schwartz"].V).max())
        reference = 0.0, 1e-8, "Brennan-Schwartz"
        yield row_of(scene, size, "nam", "V, all nodes", apart, reference)


def hertz_contact(data: Path | None, quick: bool) -> Iterator[Row]:
    """Hertz contact by the FFT: force and largest pressure to 1e-3, radius to 5e-3.

    The grid decides these errors: a radius is counted in cells.
    """
    cells = 64 if quick else 256
    problem = hertz.hertz(cells)
    found = solve_lcp(problem.A, problem.q, diagonal=problem.diagonal)
    for name, error in hertz.measured(problem, found.z).items():
        tolerance = 5e-3 if name == "radius_error" else 1e-3
        scene, what = f"Hertz contact {cells} x {cells}", name.replace("_", " ")
        reference = 0.0, tolerance, "Hertz"
        yield row_of(scene, cells**2, "nam", what, error, reference)


def least_squares(data: Path | None, quick: bool) -> Iterator[Row]:
    """NNLS beside scipy.optimize.nnls."""
    scene, B, b = known_scenes.nonnegative_least_squares(400, 100)
    apart = float(np.abs(solve_lcp(*scene).z - nnls(B, b)[0]).max())
    yield row_of("NNLS 400 x 100", 100, "nam", "x", apart, (0.0, 1e-10, "SciPy"))


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
    """Return objective and largest residual of a QP: the work of a child."""
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


PARTS: tuple[Part, ...] = (
    textbook_lcps, bimatrix_game, puts, hertz_contact, least_squares,
)  # fmt: skip
