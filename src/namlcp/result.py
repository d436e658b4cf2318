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
        What happened.
    z, w : (n,) array
        The point and w = A z + q: the best one found unless the status is SOLVED; NaN
        for NUMERICAL_ERROR.
    s : (n,) array
        The modulus variable: z = clip(s, lower, upper), w = Omega (z - s), with the
        Omega of a named method, diag(A) for "auto".
    iterations : int
        What `method` counts: sweeps, multigrid cycles, MPRGP iterations, else
        factorisations.
    residual : float
        || z - clip(z - w, lower, upper) ||_2, recomputed on the caller's data.
    method : str
        The method that gave the point; for "auto" one of "tridiagonal", "psor",
        "multigrid", "mprgp", "pivoting".
    setup_time, solve_time : float
        Seconds.
    ray : (n,) array or None
        UNSOLVABLE with a proof: v is 0 on the side of every finite bound, and q'v +
        z'A'v is -1 at most for z in the box. For the plain LCP: v >= 0, A'v <= 0, q'v =
        -1. A solution would have v'w >= 0, but v'w = q'v + z'A'v < 0.
    history : structured array or None
        The rows of the verbose table, when asked for: one an iteration, for "auto" one
        a factorisation or a run of sweeps. Residuals are those of `residual`: of the
        iterate, where factorisations are counted of the best point so far.
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
        What happened, and with it what the arrays hold.
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Primal point and multipliers of Ax = b, Gx <= h and the bounds, in qpsolvers'
        signs: P x + q + G'z + A'y + z_box = 0, z >= 0, z_box <= 0 at a lower bound.
        PRIMAL_INFEASIBLE: x is NaN, (y, z, z_box) a Farkas certificate with
        b'y + h'z + lb'z_box^- + ub'z_box^+ = -1. DUAL_INFEASIBLE: x is a ray with
        q'x = -1 (whether any x is feasible is not decided then), the rest NaN; where
        one side contradicts another at sight (lb > ub, h = -inf) all are NaN and
        `message` names the place. Otherwise the best point found.
    obj : float
        1/2 x'Px + q'x; +inf when infeasible, -inf when unbounded.
    residuals : Residuals
        Recomputed on the user's unscaled data.
    iterations : int
        Pivots, sweeps or interior steps of the form that was chosen.
    form : str
        The smallest form that fitted, after substitution: "bounds", "dual" or "path";
        "substitution" where time was over before any.
    message : str
        One sentence more than the status says, or "".
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
