"""The named sweep methods: Bai 2010, the paper (corrected), Zheng and Yin 2013, PSOR.

With A = D - L - U, M = (D - beta L) / alpha, N = M - A, E = diag(shift) and
R(s) = 2 clip(s, l, u) - s, which is |s| for the LCP (r = 2):

    nam*:    (M + Omega + E - L) s+ = (N + E - L) s + (Omega - A) R(s) - 2 q
    m*:      (M + Omega) s+ = N s + (Omega - A) R(s) - 2 q
    am*, p*: (M + Omega) s+ = N s + (Omega - D + U) R(s) + L R(s+) - 2 q

s + R(s) = 2 z. Subtracting the left matrix times s leaves -2 (A z + q - w) on the
right, w = Omega (z - s), and on the left, with ds = s+ - s and dz = z+ - z,

    (D/alpha + Omega + E) ds - L (G ds + H dz),

    m*: G = beta/alpha,  nam*: G = beta/alpha + 1,  both H = 0,
    am*, p*: G = beta/alpha - 1, H = 2  (R(s+) - R(s) = 2 dz - ds),

which is the one kernel of `kernels`. Hence nam* is Bai's method with the splitting
(M + E - L, N + E - L), and for beta = alpha, Omega = D/alpha the accelerated method
*is* projected SOR: z+ = clip(z - alpha D^-1 (A z + q - L dz)).

"modulus", "nam", "modified-nam" have M = A and factor once: `factored`.

References
----------
Bai, Numer. Linear Algebra Appl. 17 (2010) 917-933; Zheng and Yin, Numer. Algorithms 64
(2013) 245-262; Cryer, SIAM J. Control 9 (1971) 385-392.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import finite_vector
from namlcp.lcp.modulus.adaptive import AdaptiveStep
from namlcp.lcp.modulus.factored import factored_step
from namlcp.lcp.modulus.kernels import sweep_csr, sweep_dense
from namlcp.lcp.modulus.methods import (
    METHODS,
    find_method,
    is_auto,
    number,
    positive_diagonal,
    spread,
)
from namlcp.lcp.modulus.parameters import Choice
from namlcp.limits import NEVER, Deadline
from namlcp.progress import LCP_COLUMNS, Progress, Report
from namlcp.status import Status

Step = Callable[[np.ndarray, np.ndarray, np.ndarray, np.ndarray], float]


class SweepResult(NamedTuple):
    """Outcome of `sweep`.

    SOLVED: z, s and residual are those of iterate number `iterations`, the first with
    Res(z) < eps_abs. Otherwise the point with the least Res that was met (NaN after a
    NUMERICAL_ERROR), and `iterations` counts the sweeps made.
    """

    status: Status
    z: np.ndarray
    s: np.ndarray
    omega: np.ndarray
    residual: float
    iterations: int
    history: np.ndarray | None


def sweep(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    method: str,
    *,
    alpha: float | str | None = None,
    beta: float | None = None,
    omega: Any = None,
    shift: Any = None,
    s0: Any = None,
    z0: Any = None,
    threads: int | None = None,
    eps_abs: float,
    max_iter: int,
    deadline: Deadline = NEVER,
    keep_history: bool = False,
    report: Report = None,
) -> SweepResult:
    """Solve a box LCP by the named method of `METHODS`.

    A z + q + Omega (s - z) = 0,  z = clip(s, lower, upper)

    Parameters
    ----------
    A : (n, n) array or csr_array
        Matrix as `data.lcp_matrix` returns it.
    q, lower, upper : (n,) array
        The rest of the problem; bounds may be infinite.
    method : str
        A key of `METHODS`.
    alpha, beta : float
        Relaxation, alpha in (0, 2), beta in [0, 2); 1 and alpha unless given. Outside
        projected SOR cannot converge, and no theory of the others reaches beyond. For
        "modified-nam" alpha is any positive number: Omega = alpha I. alpha = "auto":
        see `parameters`.
    omega : float, (n,) array or "auto"
        Diagonal of Omega, positive. Unless given: D/(2 alpha^2) for m* and nam* (the
        paper's tables), D/alpha for am*; p* always has D/alpha. D for "modulus", I for
        "nam", alpha I for "modified-nam". "auto": c D, see `parameters`; c changes
        during the run, and s with it.
    shift : float or (n,) array
        Diagonal of E, not negative; only for nam*, where it is D unless given (so that
        units do not matter), and for "nam" and "modified-nam", where it is I, or D if
        alpha or omega is "auto". 1.0 is the paper's own.
    s0, z0 : (n,) array
        Start, at most one: s0 itself, or s0 = z0 - (A z0 + q)/Omega, which is a fixed
        point if z0 solves the problem. Unless given s0 = clip(0, lower, upper); the
        paper's runs start at (1, 0, 1, 0, ...).
    threads : int
        Sweep a sparse A in coloured order on at most so many threads, see `coloured`: L
        and U above are then those of that order. None: natural order.
    eps_abs : float
        Stop at the first k >= 0 with Res(z_k) < eps_abs.
    max_iter : int
        Sweeps at most.
    deadline : Deadline
        When to stop.
    keep_history : bool
        Return the rows (iter, residual, active, time).
    report : callable
        Called as report(k, residual, number of z_i at a bound) for every iterate.

    Returns
    -------
    SweepResult
        SOLVED, MAX_ITER, TIME_LIMIT, DIVERGED (growth, overflow or a cycle, see
        `Watch`), STALLED (rounding errors repeat the iterates) or NUMERICAL_ERROR (no
        factorisation).

    Raises
    ------
    TypeError, ValueError
        An argument is not what it must be, or the diagonal of A is not positive.
    """
    chosen = find_method(method, alpha=alpha, beta=beta, omega=omega, shift=shift)
    n = q.size
    run = None
    if threads is not None:  # imported here: it compiles for threads
        from namlcp.lcp.modulus.coloured import coloured_sweep

        run = coloured_sweep(A, chosen, threads)
    step: Step | None
    interval = "(0, inf)" if method == "modified-nam" else "(0, 2)"
    alpha_auto = is_auto("alpha", alpha, f"a number in {interval}")
    if is_auto("omega", omega, "a positive number, an array") or alpha_auto:
        step = adaptive_step(A, q, lower, upper, method, alpha, beta, omega, shift, run)
        omega = step.omega
    elif chosen.factored:
        omega = factored_omega(A, method, alpha, omega)
        shift = spread("shift", shift, n, np.ones(n)) if chosen.own else None
        step = factored_step(A, q, lower, upper, omega, shift)
    else:
        step, omega = triangular_step(
            A, q, lower, upper, method, alpha, beta, omega, shift, run
        )
    with np.errstate(all="ignore"):
        s = start(A, q, lower, upper, omega, s0, z0)
    if step is None or (isinstance(step, AdaptiveStep) and step.step is None):
        nothing = np.full(n, np.nan)
        return SweepResult(
            Status.NUMERICAL_ERROR, nothing, nothing, omega, math.nan, 0, None
        )
    reports = [] if report is None else [report]
    rows = Progress(LCP_COLUMNS, verbose=False)
    if keep_history:
        reports.append(rows.row)
    with np.errstate(all="ignore"):
        status, s, residual, iterations = iterate(
            step, q, s, lower, upper, eps_abs, max_iter, deadline, reports
        )
    if isinstance(step, AdaptiveStep):
        omega = step.omega
    z = np.clip(s, lower, upper)
    history = rows.history() if keep_history else None
    return SweepResult(status, z, s, omega, residual, iterations, history)


def iterate(
    step: Step,
    q: np.ndarray,
    s: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    eps_abs: float,
    max_iter: int,
    deadline: Deadline,
    reports: list[Callable[..., None]],
) -> tuple[Status, np.ndarray, float, int]:
    """Repeat `step` from s; return status, s, Res and the number of sweeps.

    step(s, z, s_next, z_next) writes the next iterate and returns Res(z). Three buffers
    change places, so that the best point is kept without copies.
    """
    z = np.clip(s, lower, upper)
    s_next, z_next, best = np.empty_like(s), np.empty_like(s), np.empty_like(s)
    least = math.inf
    watch = Watch(float(np.linalg.norm(q)))
    for k in range(max_iter + 1):
        residual = step(s, z, s_next, z_next)
        if reports:
            active = int(np.count_nonzero((z == lower) | (z == upper)))
            for report in reports:
                report(k, residual, active)
        if residual < eps_abs:
            return Status.SOLVED, s, residual, k
        if k == 0 or residual < least:
            best, spare, least = s, best, residual
        else:
            spare = s
        trouble = watch.verdict(k, residual, s, s_next)
        if trouble is Status.DIVERGED and isinstance(step, AdaptiveStep):
            np.copyto(s_next, best)
            np.clip(s_next, lower, upper, out=z_next)
            if step.retries_from(s_next, z_next):
                trouble, watch = None, Watch(watch.size)
        if trouble is not None:
            return trouble, best, least, k
        if deadline.reached():
            return Status.TIME_LIMIT, best, least, k
        s, s_next = s_next, spare
        z, z_next = z_next, z
    return Status.MAX_ITER, best, least, max_iter


class Watch:
    """Tell from the iterates alone, never from the clock, that sweeping is hopeless.

    - Overflow: Res is not finite.
    - Growth: every Res of the sweeps 2^p + 1 .. 2^(p+1) exceeds every earlier one and
      GROWTH times the size of the problem, max(Res(z_0), ||q||), from FIRST sweeps on:
      a method far from normal may grow by 10^10 at once and still converge.
    - A cycle (Brent 1980): s is again, to REPEAT, what it was at the last power of two
      (FIRST at least). If it hardly moves in between, rounding repeats near a solution.
    """

    GROWTH = 1e4
    REPEAT = 1e-10
    STILL = 1e-8
    FIRST = 32

    def __init__(self, size: float):
        self.size = size
        self.peak = 0.0
        self.lowest = math.inf
        self.highest = 0.0
        self.anchor = np.empty(0)
        self.anchor_residual = math.inf

    def verdict(
        self, k: int, residual: float, s: np.ndarray, s_next: np.ndarray
    ) -> Status | None:
        """Return DIVERGED or STALLED, or None to go on, after iterate k."""
        if not math.isfinite(residual):
            return Status.DIVERGED
        near = abs(residual - self.anchor_residual) <= self.REPEAT * residual
        if near and k > self.FIRST:
            size = largest(s)
            if largest(s - self.anchor) <= self.REPEAT * size:
                still = largest(s_next - s) <= self.STILL * size
                return Status.STALLED if still else Status.DIVERGED
        self.lowest = min(self.lowest, residual)
        self.highest = max(self.highest, residual)
        if k == 0:
            self.size = max(self.size, residual)
        if k & (k - 1) == 0:
            grown = self.lowest > max(self.peak, self.GROWTH * self.size)
            if grown and k >= self.FIRST:
                return Status.DIVERGED
            self.peak = max(self.peak, self.highest)
            self.lowest, self.highest = math.inf, 0.0
            if k >= self.FIRST:
                self.anchor, self.anchor_residual = s.copy(), residual
        return None


def largest(x: np.ndarray) -> float:
    """Return max |x_i|."""
    return float(np.max(np.abs(x), initial=0.0))


def triangular_step(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    method: str,
    alpha: Any,
    beta: float | None,
    omega: Any,
    shift: Any,
    run: Callable[..., float] | None = None,
) -> tuple[Step, np.ndarray]:
    """Return one sweep of a triangular method as a function, and its Omega.

    `run` takes the place of the sequential kernel, with the same arguments after A.
    """
    chosen = METHODS[method]
    alpha, beta, omega, shift = triangular_parameters(
        A, method, alpha, beta, omega, shift
    )
    inverse = A.diagonal() / alpha
    inverse += omega
    if shift is not None:
        inverse += shift
    np.divide(1.0, inverse, out=inverse)
    G = beta / alpha + chosen.own
    H = chosen.reflected
    change = np.empty_like(q)

    kernel: Any
    matrix: tuple
    if run is not None:
        kernel, matrix = run, ()
    elif isinstance(A, np.ndarray):
        kernel, matrix = sweep_dense, (A,)
    else:
        kernel, matrix = sweep_csr, (A.data, A.indices, A.indptr)
    if kernel is not sweep_dense and not lower.any() and np.all(upper == np.inf):
        lower = upper = np.empty(0)
    fixed = (*matrix, q, lower, upper, omega, inverse, G, H)

    def step(
        s: np.ndarray, z: np.ndarray, s_next: np.ndarray, z_next: np.ndarray
    ) -> float:
        return kernel(*fixed, s, z, s_next, z_next, change)

    return step, omega


def adaptive_step(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    method: str,
    alpha: Any,
    beta: float | None,
    omega: Any,
    shift: Any,
    run: Callable[..., float] | None = None,
) -> AdaptiveStep:
    """Return a step that chooses where alpha or omega is "auto", the rest checked."""
    chosen = METHODS[method]
    fixed_alpha = None if isinstance(alpha, str) else alpha
    fixed_omega = None if isinstance(omega, str) else omega
    if chosen.factored:
        refuse_two_omegas(method, alpha, omega)
        shift = spread("shift", shift, q.size, positive_diagonal(A, method))
        shift = shift if chosen.own else None
    else:
        checked = triangular_parameters(
            A, method, fixed_alpha, beta, fixed_omega, shift
        )
        shift = checked[3]
        omega = omega if fixed_omega is None else checked[2]

    def build(alpha: float, omega: np.ndarray) -> tuple[Step | None, np.ndarray]:
        if chosen.factored:
            return factored_step(A, q, lower, upper, omega, shift), omega
        return triangular_step(
            A, q, lower, upper, method, alpha, beta, omega, shift, run
        )

    choice = Choice(A, chosen, alpha, beta, omega, shift)
    return AdaptiveStep(choice, build, lower, upper)


def triangular_parameters(
    A: Any,
    method: str,
    alpha: Any,
    beta: float | None,
    omega: Any,
    shift: Any,
) -> tuple[float, float, np.ndarray, np.ndarray | None]:
    """Return alpha, beta and the diagonals of Omega and E (None without E), checked."""
    chosen = METHODS[method]
    alpha = 1.0 if alpha is None else number("alpha", alpha, "(0, 2)")
    if beta is None:
        beta = alpha if chosen.beta is None else chosen.beta
    else:
        beta = number("beta", beta, "[0, 2)")
    D = positive_diagonal(A, method)
    default = D / alpha if chosen.reflected else D / (2.0 * alpha * alpha)
    omega = spread("omega", omega, D.size, default, positive=True)
    if "shift" not in chosen.takes:
        return alpha, beta, omega, None
    return alpha, beta, omega, spread("shift", shift, D.size, D)


def refuse_two_omegas(method: str, alpha: Any, omega: Any) -> None:
    """Raise if Omega is given twice, as alpha I and as itself."""
    if alpha is not None and omega is not None:
        raise ValueError(
            f"method {method!r} has Omega = alpha I: give alpha or omega, not both"
        )


def factored_omega(A: Any, method: str, alpha: Any, omega: Any) -> np.ndarray:
    """Return the diagonal of Omega for a method that factors once."""
    refuse_two_omegas(method, alpha, omega)
    n = A.shape[0]
    if alpha is not None:
        return np.full(n, number("alpha", alpha, "(0, inf)"))
    if omega is None and method == "modulus":
        return positive_diagonal(A, method)
    return spread("omega", omega, n, np.ones(n), positive=True)


def start(
    A: Any,
    q: np.ndarray,
    lower: np.ndarray,
    upper: np.ndarray,
    omega: np.ndarray,
    s0: Any,
    z0: Any,
) -> np.ndarray:
    """Return the first s, an array of our own."""
    if s0 is not None and z0 is not None:
        raise ValueError("s0 and z0 must not both be given: either fixes the start")
    if s0 is not None:
        return finite_vector("s0", s0, q.size, "A", A.shape).copy()
    if z0 is not None:
        z = finite_vector("z0", z0, q.size, "A", A.shape)
        return z - (A @ z + q) / omega
    return np.clip(np.zeros_like(q), lower, upper)
