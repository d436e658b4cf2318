"""Independent solvers of box LCPs: z, and w from the solver's own multipliers.

Symmetric A: min 1/2 z'Az + q'z, lower <= z <= upper, by OSQP and Clarabel. Other A with
z >= lower and A + A' semidefinite: min (z - lower)'(Az + q), Az + q >= 0, z >= lower,
whose minimum is 0, by Clarabel. Any A with z >= lower, small: Lemke's method of
quantecon.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from validation.harness import judging, qp_solvers
from validation.problems.known_scenes import BoxLCP

EPS = 1e-10
LEMKE = 200  # largest n for Lemke's method
SEMIDEFINITE = 1000  # largest n whose eigenvalues are looked at


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
    import namlcp

    found = namlcp.solve_lcp(*scene, time_limit=limit)
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
