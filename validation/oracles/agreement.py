"""NAM beside independent oracles on every scene, against the values that are known.

Each solver is asked for 1e-10. One row of the CSV is one quantity of one scene by one
solver. The reference is the known value, to the digits that are printed. Where there is
none:

- objective: the value of the oracle with the least natural residual, to 1e-8 of its
  size; of a nonsymmetric LCP, which has none, the relative natural residual, to 1e-8;
- z (where it is unique) and w (by the solver's own multipliers): the largest
  difference from NAM, over 1 + the largest entry of NAM's, to 1e-6.

The oracles: symmetric A: min 1/2 z'Az + q'z, lower <= z <= upper, by OSQP and Clarabel.
Other A with z >= lower and A + A' semidefinite: min (z - lower)'(Az + q), Az + q >= 0,
z >= lower, whose minimum is 0, by Clarabel. Any A with z >= lower, small: Lemke's
method of quantecon.
"""

from collections.abc import Callable, Iterator
from functools import cache, partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from namlcp import natural_residual, solve_lcp
from validation.harness import Job, Row, judging, qp_solvers
from validation.harness.suite import Args, Suite
from validation.oracles.scenes import Scene, objective, scenes
from validation.problems.known_scenes import BoxLCP, dam

EPS = 1e-10
LEMKE = 200  # largest n for Lemke's method
SEMIDEFINITE = 1000  # largest n whose eigenvalues are looked at
AGREED = 1e-8  # relative, of objectives and residuals
NEAR = 1e-6  # of z and w, relative to 1 + their largest entry
QUICK_SIZE = 2500  # unknowns at most


class Answer(NamedTuple):
    """z, w by the solver's multipliers, and what it says; z None: nothing."""

    z: np.ndarray | None
    w: np.ndarray | None
    said: str


def is_symmetric(A: Any) -> bool:
    return bool(abs(A - A.T).max() <= 1e-12 * abs(A).max())


def is_monotone(scene: BoxLCP) -> bool:
    """Tell whether z >= lower alone, and A + A' is small and semidefinite."""
    if scene.q.size > SEMIDEFINITE or np.isfinite(scene.upper).any():
        return False
    A = sp.csc_matrix(scene.A).toarray()
    return bool(np.linalg.eigvalsh(A + A.T)[0] >= -1e-12 * np.abs(A).max())


def nam(scene: BoxLCP, limit: float) -> Answer:
    found = solve_lcp(*scene, time_limit=limit)
    return Answer(found.z, found.w, found.status.value)


def by_qp(scene: BoxLCP, limit: float, solver: str) -> Answer | None:
    """Solve the QP of a scene; OSQP takes minutes where A is not symmetric."""
    A, q, lower, upper = scene
    A, symmetric = sp.csc_matrix(A), is_symmetric(A)
    if symmetric:
        problem = Problem(A, q, lb=lower, ub=upper)
    elif solver == "clarabel" and is_monotone(scene):
        P = sp.csc_matrix(A + A.T)
        problem = Problem(P, q - A.T @ lower, sp.csc_matrix(-A), q, lb=lower)
    else:
        return None
    settings = qp_solvers.settings(solver, EPS, limit)
    found = qp_solvers.solve(problem, solver, **settings)
    said = "solved" if found.found else judging.said_by(found)
    if found.x is None:
        return Answer(None, None, said)
    return Answer(found.x, -found.z_box if symmetric else A @ found.x + q, said)


def lemke(scene: BoxLCP, limit: float) -> Answer | None:
    if scene.q.size > LEMKE or np.isfinite(scene.upper).any():
        return None
    from quantecon.optimize import lcp_lemke

    A = np.ascontiguousarray(sp.csc_matrix(scene.A).toarray())
    q = scene.q + A @ scene.lower
    found = lcp_lemke(A, q)
    if not found.success:
        return Answer(None, None, f"status {found.status}")
    return Answer(scene.lower + found.z, A @ found.z + q, "solved")


ORACLES: dict[str, tuple[str, Callable[[BoxLCP, float], Answer | None]]] = {
    "nam": ("namlcp", nam),
    "osqp": ("osqp", partial(by_qp, solver="osqp")),
    "clarabel": ("clarabel", partial(by_qp, solver="clarabel")),
    "lemke": ("quantecon", lemke),
}
"""Package and call of every solver; a call returns None where it does not apply."""


@cache
def warm_up(solver: str) -> None:
    ORACLES[solver][1](dam(), 60.0)


def answered(job: Job, scene: BoxLCP) -> Row:
    warm_up(job.solver)
    job.ready()
    return {"answer": ORACLES[job.solver][1](scene, job.limit)}


def requests(args: Args) -> Iterator[Row]:
    for name, scene in scenes(args.data).items():
        lcp = scene.make()
        if not args.quick or lcp.q.size <= QUICK_SIZE:
            yield {"scene": name, "of": scene, "lcp": lcp, "ask": (lcp,)}


def conclude(rows: list[Row]) -> list[Row]:
    answers = {
        row["solver"]: row.get("answer", Answer(None, None, row.get("status", "")))
        for row in rows
    }
    found = {solver: a for solver, a in answers.items() if a is not None}
    scene, lcp = rows[0]["of"], rows[0]["lcp"]
    about = {"scene": rows[0]["scene"], "n": lcp.q.size}
    return [about | row for row in scene_rows(scene, lcp, found)]


def residual_of(scene: BoxLCP, z: np.ndarray | None) -> float:
    """Return the natural residual relative to that of z = 0 clipped."""
    if z is None or not np.isfinite(z).all():
        return np.inf
    sides = scene.lower, scene.upper
    start = np.clip(np.zeros_like(z), *sides)
    first = natural_residual(start, scene.A @ start + scene.q, *sides)
    return natural_residual(z, scene.A @ z + scene.q, *sides) / max(first, 1e-300)


Quantity = tuple[str, dict[str, float], tuple[float, float, str]]
"""A name, its values by solver, and the reference: value, tolerance and whose it is."""


def quantities(
    scene: Scene, lcp: BoxLCP, have: dict[str, Answer], residuals: dict[str, float]
) -> Iterator[Quantity]:
    for known in scene.known:
        values = {s: known.of(lcp, a.z) for s, a in have.items()}
        yield known.quantity, values, (known.value, known.absolute, known.source)
    peers = [s for s in have if s != "nam"]
    if not is_symmetric(lcp.A):
        values = {s: residuals[s] for s in have}
        yield "residual", values, (0.0, AGREED, "definition")
    elif peers and not any(known.quantity == "objective" for known in scene.known):
        best = min(peers, key=lambda s: residuals[s])
        values = {s: objective(lcp, a.z) for s, a in have.items()}
        size = max(abs(values[best]), 1e-300)
        yield "objective", values, (values[best], AGREED * size, best)
    for part in ("z", "w") if scene.unique else ("w",):
        own = getattr(have.get("nam"), part, None)
        if own is not None:
            others = ((s, getattr(have[s], part)) for s in peers)
            size = 1.0 + float(np.abs(own).max())
            far = {s: np.abs(v - own).max() / size for s, v in others if v is not None}
            yield part, far, (0.0, NEAR, "nam")


def scene_rows(scene: Scene, lcp: BoxLCP, found: dict[str, Answer]) -> list[Row]:
    residuals = {s: residual_of(lcp, a.z) for s, a in found.items()}
    have = {s: a for s, a in found.items() if residuals[s] < np.inf}
    rows: list[Row] = []
    for quantity, values, reference in quantities(scene, lcp, have, residuals):
        number, tolerance, source = reference
        for solver, value in values.items():
            row: Row = {"solver": solver, "quantity": quantity, "value": value}
            row |= {"reference": number, "tolerance": tolerance, "source": source}
            row |= {"error": abs(value - number), "residual": residuals[solver]}
            row["agrees"] = bool(row["error"] <= tolerance)
            row["why"] = "" if row["agrees"] else reason(row, found, residuals)
            rows.append(row)
    silent = (s for s in found if s not in have)
    none: dict[str, Any] = {"quantity": "objective", "agrees": False}
    return rows + [
        none | {"solver": s, "why": f"no point: {found[s].said}"} for s in silent
    ]


def reason(row: Row, found: dict[str, Answer], residuals: dict[str, float]) -> str:
    own, ours = residuals[row["solver"]], residuals.get("nam", np.inf)
    said, source = found[row["solver"]].said, residuals.get(row["source"], 0.0)
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
    name="oracles", requests=requests, work=answered, conclude=conclude,
    columns=(
        "scene solver | n quantity value reference source error tolerance agrees "
        "residual why"
    ),
    solvers=tuple(ORACLES),
    packages={solver: package for solver, (package, _) in ORACLES.items()}, limit=60.0,
    quick={"limit": 3.0},
)  # fmt: skip
