"""What a solve returns."""

from dataclasses import dataclass

import numpy as np

from namlcp.residuals import Residuals
from namlcp.status import Status


@dataclass(frozen=True, eq=False, kw_only=True)
class LCPResult:
    """Result of `solve_lcp`; read `status` first.

    Attributes
    ----------
    status : Status
        How the solve ended.
    z, w : (n,) array
        The solution, else the best point found, and w = A z + q; NaN for
        NUMERICAL_ERROR.
    s : (n,) array
        The modulus variable: z = clip(s, lower, upper), w = Omega (z - s), with the
        Omega of a named method, diag(A) for "auto".
    iterations : int
        Sweeps, multigrid cycles, MPRGP iterations or else factorisations, by `method`.
    residual : float
        || z - clip(z - w, lower, upper) ||_2, recomputed on the caller's data.
    method : str
        The method that gave the point; for "auto" one of "tridiagonal", "psor",
        "multigrid", "mprgp", "pivoting".
    setup_time, solve_time : float
        Seconds.
    ray : (n,) array or None
        With UNSOLVABLE, a vector v that proves it, where one was found: v_i <= 0 where
        u_i is finite, v_i >= 0 where l_i is finite, and q'v + z'A'v <= -1 for all z in
        the box. For the plain LCP: v >= 0, A'v <= 0, q'v = -1. A solution would have
        v'w >= 0, but v'w = q'v + z'A'v < 0.
    history : structured array or None
        The rows of the verbose table, when asked for: one for each iteration, for
        "auto" one for each factorisation or run of sweeps. The residuals are those of
        the iterates; where factorisations are counted, those of the best point so far.
    """

    status: Status
    z: np.ndarray
    w: np.ndarray
    s: np.ndarray
    iterations: int
    residual: float
    method: str
    setup_time: float
    solve_time: float
    ray: np.ndarray | None = None
    history: np.ndarray | None = None


@dataclass(frozen=True, eq=False, kw_only=True)
class QPResult:
    """Result of `solve_qp`; read `status` first.

    Attributes
    ----------
    status : Status
        How the solve ended, and thus what the arrays hold.
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Primal point and multipliers of Ax = b, Gx <= h and the bounds, in qpsolvers'
        signs: P x + q + G'z + A'y + z_box = 0, z >= 0, z_box <= 0 at a lower bound.
        PRIMAL_INFEASIBLE: x is NaN, (y, z, z_box) a Farkas certificate with
        b'y + h'z + lb'z_box^- + ub'z_box^+ = -1. DUAL_INFEASIBLE: x is a ray with
        q'x = -1 (it is not decided whether any x is feasible), the rest NaN. Where two
        bounds contradict each other (lb > ub, h = -inf) all are NaN and `message` names
        the bounds. Otherwise the best point found.
    obj : float
        1/2 x'Px + q'x; +inf when infeasible, -inf when unbounded.
    residuals : Residuals
        Recomputed on the user's unscaled data.
    iterations : int
        Pivots, sweeps or interior-point steps of the solver named by `form`.
    form : str
        The solver that gave the point: "bounds" (box LCP), "dual" (dense pivots) or
        "path" (interior point); "substitution" if time was over before any began.
    message : str
        A sentence that adds to the status, or "".
    setup_time, solve_time : float
        Seconds.
    history : structured array or None
        The rows of the verbose table, where the form has them.
    """

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    obj: float
    residuals: Residuals
    iterations: int
    form: str
    message: str
    setup_time: float
    solve_time: float
    history: np.ndarray | None = None
