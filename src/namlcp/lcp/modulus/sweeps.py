"""The sweep methods of Bai, of Kumar, Deepmala and Das, of Zheng and Yin, and PSOR.

"The paper" is that of Kumar, Deepmala and Das, corrected, see `validation/paper.md`. In
its notation r = 2. Let A = D - L - U, M = (D - beta L)/alpha, N = M - A, E =
diag(shift), R(s) = 2 clip(s, l, u) - s, that is |s| if l = 0 and u = inf. The
triangular methods are

    nam*:    (M + Omega + E - L) s+ = (N + E - L) s + (Omega - A) R(s) - 2 q
    m*:      (M + Omega) s+ = N s + (Omega - A) R(s) - 2 q
    am*, p*: (M + Omega) s+ = N s + (Omega - D + U) R(s) + L R(s+) - 2 q

The first is the paper's Method 3.1, equation (4), where E = I; by the paper's Theorem 1
and equation (3) its fixed points are the solutions. The second is its equation (2).

Note that s + R(s) = 2 z. If the left matrix times s is subtracted from both sides, the
right side becomes -2 (A z + q - w), w = Omega (z - s), and the left one

    (D/alpha + Omega + E) ds - L (G ds + H dz),    ds = s+ - s, dz = z+ - z,

    m*: G = beta/alpha,  nam*: G = beta/alpha + 1,  both H = 0,
    am*, p*: G = beta/alpha - 1, H = 2  (R(s+) - R(s) = 2 dz - ds).

This is what the loops compute. Hence nam* is Bai's method with the splitting (M + E -
L, N + E - L). p* is am* with beta = alpha and Omega = D/alpha, which is projected SOR:
z+ = clip(z - alpha D^-1 (A z + q - L dz)).

"modulus", "nam" and "modified-nam" have M = A, see `methods`.

References
----------
Bai, Numer. Linear Algebra Appl. 17 (2010) 917-933; Zheng and Yin, Numer. Algorithms 64
(2013) 245-262; Cryer, SIAM J. Control 9 (1971) 385-392.
"""

import math
from typing import Any

import numpy as np

from namlcp.checks import vector
from namlcp.lcp.data import LCP
from namlcp.lcp.loops import S, Z
from namlcp.lcp.modulus.adaptive import AdaptiveStep
from namlcp.lcp.modulus.methods import (
    SWEEPS,
    Parameters,
    Step,
    checked_parameters,
    fixed_step,
    is_adaptive,
)
from namlcp.limits import Limits
from namlcp.status import Outcome, Status

# Default limit on sweeps.
MAX_NAMED_SWEEPS = 100_000
# Of `iterate`: relative tolerance for a repeated s and its Res; relative change of s in
# a sweep that counts as rounding; what it has seen of Res at first.
FIRST, GROWTH, REPEAT, STILL = 32, 1e4, 1e-10, 1e-8
BEFORE = 0.0, math.inf, 0.0, math.inf


def sweep(
    lcp: LCP,
    z0: np.ndarray | None,
    limits: Limits,
    method: str,
    s0: Any = None,
    **parameters: Any,
) -> Outcome:
    """Solve a box LCP by a method of `SWEEPS` until Res(z) < eps_abs.

    parameters: its `Parameters`. The start is s0, or s = z0 - (A z0 + q)/Omega, which
    is a fixed point if z0 is a solution, or s = clip(0, lower, upper).

    MAX_ITER, TIME_LIMIT, DIVERGED (growth, overflow or a cycle, see `iterate`) and
    STALLED (rounding errors repeat the iterates, or hide Res) return the iterate of
    least Res. NUMERICAL_ERROR: the factorisation fails; z, w and s are NaN.
    """
    step = step_of(lcp, method, Parameters(**parameters))
    with np.errstate(all="ignore"):
        if step is None:
            nan = np.full(lcp.q.size, np.nan)
            return lcp.outcome(Status.NUMERICAL_ERROR, nan, nan, 0, method, s=nan)
        if s0 is not None and z0 is not None:
            raise ValueError("s0 and z0 must not both be given: either fixes the start")
        if s0 is not None:
            s = vector("s0", s0, lcp.q.size, "A", lcp.A.shape, finite=True).copy()
        else:
            s = lcp.start() if z0 is None else z0 - lcp.w(z0) / step.omega
        status, s, k = iterate(lcp, step, s, limits)
        z = np.clip(s, lcp.lower, lcp.upper)
        w = lcp.w(z)
        # the Res of a step, |z - clip(z - w)|, loses a w far smaller than z
        if status is Status.SOLVED and not lcp.residual(z, w) < limits.eps_abs:
            status = Status.STALLED
        return lcp.outcome(status, z, w, k, method, s=s)


def step_of(lcp: LCP, method: str, parameters: Parameters) -> Step | None:
    """Check the parameters; return the step, None if its factorisation fails."""
    if is_adaptive(method, parameters):
        adaptive = AdaptiveStep(lcp, method, parameters)
        return None if adaptive.step is None else adaptive
    checked = checked_parameters(lcp.A, method, parameters)
    return fixed_step(lcp, SWEEPS[method], checked)


def iterate(
    lcp: LCP, step: Step, s: np.ndarray, limits: Limits
) -> tuple[Status, np.ndarray, int]:
    """Repeat `step` from s; return the status, the last or best s, and the sweeps done.

    Three buffers are exchanged, so that the best iterate is kept without copies. That
    the sweeps do not converge is seen from

    - overflow: Res is not finite;
    - growth, from sweep FIRST on: every Res of the sweeps 2^p + 1 .. 2^(p+1) exceeds
      every earlier one and GROWTH times `size` = max(Res(z_0), ||q||). Growth alone
      proves nothing: for a very nonnormal method Res may grow by 10^10 and then fall;
    - a cycle (Brent 1980): s equals its value at the last power of two, which is at
      least FIRST. If the next s is equal, too, rounding errors repeat the iterates.
    """
    old, new, best = np.empty((3, 2, s.size))
    old[S] = s
    np.clip(s, lcp.lower, lcp.upper, out=old[Z])
    eps_abs, deadline, report = limits.eps_abs, limits.deadline, limits.report
    least, size, anchor = math.inf, float(np.linalg.norm(lcp.q)), s
    peak, lowest, highest, anchor_residual = BEFORE
    max_iter = limits.max_iter or MAX_NAMED_SWEEPS
    for k in range(max_iter + 1):
        residual = step.run(old, new)
        if report is not None:
            report(k, residual, lcp.active(old[Z]))
        if residual < eps_abs:
            return Status.SOLVED, old[S], k
        if k == 0 or residual < least:
            best, spare, least = old, best, residual
        else:
            spare = old
        trouble = None if math.isfinite(residual) else Status.DIVERGED
        near = k > FIRST and abs(residual - anchor_residual) <= REPEAT * residual
        if near and trouble is None:
            largest = max_norm(old[S])
            if max_norm(old[S] - anchor) <= REPEAT * largest:
                still = max_norm(new[S] - old[S]) <= STILL * largest
                trouble = Status.STALLED if still else Status.DIVERGED
        lowest, highest = min(lowest, residual), max(highest, residual)
        size = max(size, residual) if k == 0 else size
        if k & (k - 1) == 0:
            if k >= FIRST:
                if trouble is None and lowest > max(peak, GROWTH * size):
                    trouble = Status.DIVERGED
                anchor, anchor_residual = old[S].copy(), residual
            peak, lowest, highest = max(peak, highest), math.inf, 0.0
        if trouble is Status.DIVERGED:
            new[S] = best[S]
            np.clip(new[S], lcp.lower, lcp.upper, out=new[Z])
            if step.retries_from(new):
                trouble = None
                peak, lowest, highest, anchor_residual = BEFORE
        if trouble is not None:
            return trouble, best[S], k
        if deadline.reached():
            return Status.TIME_LIMIT, best[S], k
        old, new = new, spare
    return Status.MAX_ITER, best[S], max_iter


def max_norm(x: np.ndarray) -> float:
    return float(np.max(np.abs(x), initial=0.0))
