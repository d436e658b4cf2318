"""Independent solvers of box LCPs: z, and w from the solver's own multipliers.

Symmetric A: min 1/2 z'Az + q'z, lower <= z <= upper, by OSQP directly and by CVXPY with
Clarabel. Other A with z >= 0 and A + A' semidefinite: min z'(Az + q), Az + q >= 0,
z >= 0, whose minimum is 0, by CVXPY with Clarabel. Any A with z >= lower, small:
Lemke's method of quantecon.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from validation.harness import qp_solvers
from validation.problems import known_scenes

EPS = 1e-10
LEMKE = 200  # largest n for Lemke's method
SEMIDEFINITE = 1000  # largest n whose eigenvalues are looked at


class Answer(NamedTuple):
    """z, w = -z_box by the solver's multipliers, and what it says; z None: nothing."""

    z: np.ndarray | None
    w: np.ndarray | None
    said: str


def is_symmetric(A: Any) -> bool:
    """Tell whether A is symmetric but for rounding."""
    return bool(abs(A - A.T).max() <= 1e-12 * abs(A).max())


def is_monotone(scene: known_scenes.BoxLCP) -> bool:
    """Tell whether z >= lower alone, and A + A' is small and semidefinite."""
    if scene.q.size > SEMIDEFINITE or np.isfinite(scene.upper).any():
        return False
    A = sp.csc_matrix(scene.A).toarray()
    return bool(np.linalg.eigvalsh(A + A.T)[0] >= -1e-12 * np.abs(A).max())


def nam(scene: known_scenes.BoxLCP, limit: float) -> Answer:
    """Solve by `namlcp.solve_lcp`."""
    import namlcp

    found = namlcp.solve_lcp(*scene, time_limit=limit)
    return Answer(found.z, found.w, found.status.value)


def osqp(scene: known_scenes.BoxLCP, limit: float) -> Answer | None:
    """Solve by OSQP, directly."""
    if not is_symmetric(scene.A):
        return None
    from osqp import OSQP

    solver = OSQP()
    problem = {"P": sp.csc_matrix(sp.triu(sp.csc_matrix(scene.A))), "q": scene.q}
    problem |= {"A": sp.eye(scene.q.size, format="csc"), "l": scene.lower}
    options = qp_solvers.settings("osqp", EPS, limit)
    solver.setup(**problem, u=scene.upper, verbose=False, **options)
    found = solver.solve()
    return Answer(found.x, -found.y, found.info.status)


def clarabel(scene: known_scenes.BoxLCP, limit: float) -> Answer | None:
    """Solve by Clarabel the problem as it is written in CVXPY."""
    import cvxpy as cp

    A, q = sp.csc_matrix(scene.A), scene.q
    low, high = np.isfinite(scene.lower), np.isfinite(scene.upper)
    z = cp.Variable(q.size)
    if is_symmetric(A):
        cost = 0.5 * cp.quad_form(z, cp.psd_wrap(A)) + q @ z
        rows = [z[low] >= scene.lower[low], z[high] <= scene.upper[high]]
    elif is_monotone(scene):
        cost = 0.5 * cp.quad_form(z, cp.psd_wrap(sp.csc_matrix(A + A.T))) + q @ z
        cost -= scene.lower @ (A @ z)
        rows = [z >= scene.lower, A @ z + q >= 0]
    else:
        return None
    rows = [row for row in rows if row.size]
    problem = cp.Problem(cp.Minimize(cost), rows)
    problem.solve(
        solver=cp.CLARABEL, tol_feas=EPS, tol_gap_abs=EPS, tol_gap_rel=EPS,
        max_threads=1, time_limit=limit,
    )  # fmt: skip
    if z.value is None:
        return Answer(None, None, problem.status)
    if not is_symmetric(A):
        return Answer(z.value, A @ z.value + q, problem.status)
    w = np.zeros(q.size)
    for row, where, sign in zip(rows, (low, high), (1.0, -1.0), strict=False):
        w[where] += sign * row.dual_value
    return Answer(z.value, w, problem.status)


def lemke(scene: known_scenes.BoxLCP, limit: float) -> Answer | None:
    """Solve by Lemke's method of quantecon, z >= lower and small alone."""
    if scene.q.size > LEMKE or np.isfinite(scene.upper).any():
        return None
    from quantecon.optimize import lcp_lemke

    A = np.ascontiguousarray(sp.csc_matrix(scene.A).toarray())
    q = scene.q + A @ scene.lower
    found = lcp_lemke(A, q)
    if not found.success:
        return Answer(None, None, f"status {found.status}")
    z = scene.lower + found.z
    return Answer(z, A @ found.z + q, "solved")


ORACLES: dict[
    str, tuple[str, Callable[[known_scenes.BoxLCP, float], Answer | None]]
] = {
    "nam": ("namlcp", nam),
    "osqp": ("osqp", osqp),
    "clarabel": ("cvxpy", clarabel),
    "lemke": ("quantecon", lemke),
}
"""Package and call of every solver; a call returns None where it does not apply."""
