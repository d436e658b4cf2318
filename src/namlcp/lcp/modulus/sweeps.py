"""The sweep methods of Bai, of Kumar, Deepmala and Das, of Zheng and Yin, and PSOR.

"The paper" is that of Kumar, Deepmala and Das, corrected, see `validation/paper.md`. In
its notation r = 2. Let A = D - L - U, M = (D - beta L)/alpha, N = M - A, E =
diag(shift), R(s) = 2 clip(s, l, u) - s, that is |s| if l = 0 and u = inf. The
triangular methods are

    nam*:    (M + Omega + E - L) s+ = (N + E - L) s + (Omega - A) R(s) - 2 q
    m*:      (M + Omega) s+ = N s + (Omega - A) R(s) - 2 q
    am*, p*: (M + Omega) s+ = N s + (Omega - D + U) R(s) + L R(s+) - 2 q

The first is the paper's Method 3.1, equation (4), where E = I; by its Theorem 3.1
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
(2013) 245-262; Cryer, SIAM J. Control 9 (1971) 385-392; Young, Iterative Solution of
Large Linear Systems (1971), ch. 6; Hageman and Young, Applied Iterative Methods (1981),
ch. 9.
"""

import math
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import eigh_tridiagonal

from namlcp.checks import vector
from namlcp.lcp.data import LCP
from namlcp.lcp.loops import S, Z
from namlcp.lcp.modulus.methods import (
    SWEEPS,
    Parameters,
    Step,
    checked_parameters,
    fixed_step,
    positive_diagonal,
)
from namlcp.limits import Limits
from namlcp.status import Outcome, Status

# Default limit on sweeps.
MAX_NAMED_SWEEPS = 100_000
# Of `iterate`: relative tolerance for a repeated s and its Res; relative change of s in
# a sweep that counts as rounding; what it has seen of Res at first.
FIRST, GROWTH, REPEAT, STILL = 32, 1e4, 1e-10, 1e-8
BEFORE = 0.0, math.inf, 0.0, math.inf
# c >= LEAST_C G sqrt(f) / (p - c), f the geometric mean of b - 2 for the free rows and
# for the whole matrix. c is at least SMALL_C: with less, s hardly changes at a bound.
LEAST_C, SMALL_C = 0.6, 0.01
# Largest g: for g = 4 the best P would be 0. Factor of c for "modulus" with a
# nonsymmetric A.
MOST_G, NONSYMMETRIC = 3.5, 0.75
# Largest alpha that is chosen together with Omega, and those compared if beta is given.
LARGE_ALPHA, ALPHAS = 1.95, [0.05 * k for k in range(2, 40)]
# From sweep FROM on the change of z is measured every EVERY sweeps. P is raised if it
# exceeds GROWN times the least one so far; until then, if g < 2, P is multiplied by
# SHRINK at every power of 2.
FROM, EVERY, GROWN, SHRINK = 32, 8, 4.0, 0.93
# Most restarts after a divergence, each of which doubles P.
RETRIES = 8
# Largest relative change of Omega for which a factored method keeps its factors.
REFACTOR = 0.2
# Most Lanczos steps. An image orthogonal to the basis of a norm up to INVARIANT means
# that all eigenvalues are found.
LANCZOS, INVARIANT = 14, 1e-8
# Largest row sum of the scaled |I - A| for which the bounds 1 -+ row sum are used
# instead of Ritz values; and from which on they are, too, as squares would overflow.
CERTAIN, WILD = 0.5, 1e30
# Least values of `low`: before the first estimate, and of an estimate.
FIRST_LEAST, LEAST = 1e-3, 1e-5
# Error bound of the least Ritz value, relative to it, below which another estimate for
# the same free rows is not made.
SETTLED = 0.3


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
        # the w of a step is summed in another order
        if status is Status.SOLVED and not lcp.residual(z, w) < limits.eps_abs:
            status = Status.STALLED
        return lcp.outcome(status, z, w, k, method, s=s)


def step_of(lcp: LCP, method: str, parameters: Parameters) -> Step | None:
    """Check the parameters; return the step, None if its factorisation fails."""
    if isinstance(parameters.alpha, str) or isinstance(parameters.omega, str):
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


# ---- alpha and Omega chosen during the run


class AdaptiveStep(Step):
    """A step that chooses alpha or Omega, those that are "auto", from eigenvalues.

    A is scaled to a unit diagonal here; c = Omega/D, e = E/D, g = G + H. On the free
    rows (l < z = s < u) a triangular method is the linear iteration with the matrix

        M = (p I - g L)/2,    p = 1/alpha + c + e.

    For g = 2 (nam*, am*, p*) this is SOR with relaxation parameter 2/p; g = 1 (m*,
    namj) is not SOR. If L and L' are near (I - A)/2, the error in the direction of an
    eigenvector with the eigenvalue x of A is multiplied in each sweep by

        (P - (4 - g) x) / (P + g x),    P = 2 p - g.

    The moduli of this factor at the extreme eigenvalues a <= x <= b are equal if

        P = ((2 - g) S + sqrt((2 - g)^2 S^2 + 4 g (4 - g) a b)) / 2,    S = a + b.

    For g = 2 this is p = 1 + sqrt(a b). A five-point matrix has b = 2 - a, and 2/p is
    then Young's optimal parameter 2/(1 + sqrt(1 - mu^2)), mu = 1 - a. For g = 1 and a
    symmetric positive definite A, P >= b makes the iteration a contraction in the norm
    of A, because p > g/2 + (1 - g/2) b is Ostrowski's condition M + M' - A > 0.

    In a row at a bound, the error of s is multiplied by 1 - 2 c/p; it perturbs the free
    rows by G L ds. c is chosen so large that this factor is at most the square of the
    one at x = a, and larger if b > 2 (A is no M-matrix), see LEAST_C.

    a and b (low and high) are Ritz values on the rows that are free at the sweeps 1, 2,
    4, 8, ..., by a few Lanczos steps; `above` is b of the whole matrix, 0 at first. A
    nonsymmetric A is replaced by the symmetric C, c_ij = +-sqrt(a_ij a_ji), or 0 if the
    signs of a_ij and a_ji differ; it has the eigenvalues of A if A is diagonally
    similar to a symmetric matrix. Because of the scaling, the iterates do not depend on
    k > 0 in (k A, k q) or on a positive diagonal S in (S A S, S q).

    "modulus" has the factor (c - x)/(c + x) and c = sqrt(a b), with b cut off at 2,
    times NONSYMMETRIC for nonsymmetric A. "nam" and "modified-nam" have the factor
    (K - x/2)/(K + 3 x/2), K = c + e - 1/2.

    When Omega changes, s = z - w/Omega is recomputed for the same z and w, so that a
    solution remains a fixed point. `step` is None if the first factorisation fails.
    The constants were fitted once, to problems of `validation/paper/parameters.py`.
    """

    def __init__(self, lcp: LCP, name: str, parameters: Parameters):
        self.lcp, self.method, matrix = lcp, SWEEPS[name], lcp.matrix
        given = checked_parameters(lcp.A, name, parameters)
        D = self.D = positive_diagonal(lcp.A, name)
        alpha, beta, omega, _ = parameters
        self.omega_is_free = isinstance(omega, str)
        self.given_alpha = None if isinstance(alpha, str) else given.alpha
        has_omega = not (omega is None or self.omega_is_free)
        self.given_omega = given.omega if has_omega else None
        self.beta = self.method.beta if beta is None else given.beta
        self.shift = given.shift
        self.e = 0.0 if self.shift is None else mean(self.shift / D)
        self.C = matrix.A if matrix.symmetric else symmetric_form(matrix.A)
        self.root = matrix.root
        rows = (abs(self.C) @ (1.0 / self.root)) / self.root - 1.0
        self.row_sum = min(float(np.max(rows, initial=0.0)), WILD)
        self.low = max(1.0 - self.row_sum, FIRST_LEAST)
        self.high, self.above = 1.0 + self.row_sum, 0.0
        self.free, self.is_sharp = np.zeros(D.size, dtype=bool), False
        self.scale, self.shrink = 1.0, SHRINK  # factors of P: so far, and the next one
        self.raised = 1.1  # the next one by which P is raised
        self.k = self.retries = self.products = 0
        self.before, self.least = np.empty(0), math.inf
        self.alpha, self.omega = self.choice()
        self.step: Any = self.build(self.alpha, self.omega)

    def build(self, alpha: float, omega: np.ndarray) -> Step | None:
        beta = alpha if self.beta is None else self.beta
        now = Parameters(alpha, beta, omega, self.shift)
        return fixed_step(self.lcp, self.method, now)

    def run(self, old: np.ndarray, new: np.ndarray) -> float:
        """Write the next iterate to `new` and return Res(z) of `old`.

        old[S] is overwritten if Omega changes.
        """
        z, k = old[Z], self.k
        self.k += 1
        doubled = k > 0 and k & (k - 1) == 0
        grows = k >= FROM and k % EVERY == 0 and self.grows(z - self.before)
        if doubled:
            self.estimate((z > self.lcp.lower) & (z < self.lcp.upper), z - self.before)
            if k >= FROM and not self.method.factored and self.weight(1.0)[0] < 2.0:
                self.scale *= self.shrink
        if doubled or grows:
            self.change(old)
        if (k + 1) % EVERY == 0 or k & (k + 1) == 0:
            self.before = z.copy()
        return self.step.run(old, new)

    def grows(self, change: np.ndarray) -> bool:
        """Raise P and the least c for good, by 1.1, 1.2, 1.4, 1.8, 2, if z moves more.

        The size is |D^(1/2) dz|, which unlike Res does not depend on the scaling.
        """
        size = float(np.linalg.norm(change * self.root))
        self.least = min(self.least, size)
        if not size > GROWN * self.least:
            return False
        self.least, self.shrink = size, 1.0
        self.scale *= self.raised
        self.raised = min(2.0 * self.raised - 1.0, 2.0)
        return True

    def retries_from(self, point: np.ndarray) -> bool:
        """Prepare a restart from an iterate with larger P; tell whether to restart."""
        self.retries += 1
        self.scale, self.shrink, self.raised = 2.0 * self.scale, 1.0, 2.0
        self.least, self.before = math.inf, point[Z].copy()
        self.change(point)
        return self.retries <= RETRIES

    def change(self, point: np.ndarray) -> None:
        """Use the parameters of `choice` from now on; point[S] is overwritten."""
        s, z = point
        alpha, omega = self.choice()
        change = np.abs(omega - self.omega)
        if self.method.factored and np.all(change <= REFACTOR * self.omega):
            return
        step = self.build(alpha, omega)
        if step is not None:
            np.subtract(z, (self.omega / omega) * (z - s), out=s)
            self.alpha, self.step, self.omega = alpha, step, omega

    def choice(self) -> tuple[float, np.ndarray]:
        """Return alpha and the diagonal of Omega."""
        D, alpha, omega = self.D, self.given_alpha, self.given_omega
        reflected = self.method.reflected
        if self.method.factored:
            c = self.factored_c()
            if alpha is None:  # Omega = alpha I
                return 1.0, np.full_like(D, c * math.exp(mean(np.log(D))))
            return 1.0, c * D
        if alpha is None:
            alpha = self.free_alpha()
        if self.omega_is_free:
            return alpha, self.best_c(alpha) * D
        x = self.best_p(self.weight(alpha)[0]) - self.e  # 1/alpha + c
        if omega is not None:
            x -= mean(omega / D)
        else:  # c = 1/alpha or 1/(2 alpha^2)
            x = x / 2.0 if reflected else math.sqrt(max(1.0 + 2.0 * x, 1.0)) - 1.0
        alpha = min(1.0 / max(x, 1e-9), 1.999)
        c = 1.0 / alpha if reflected else 0.5 / (alpha * alpha)
        return alpha, c * D if omega is None else omega

    def weight(self, alpha: float) -> tuple[float, float]:
        """Return g = G + H in [0, MOST_G] and G >= 0."""
        G = (1.0 if self.beta is None else self.beta / alpha) + self.method.own
        return min(max(G + self.method.reflected, 0.0), MOST_G), max(G, 0.0)

    def free_alpha(self) -> float:
        """Return alpha if Omega is chosen, too.

        With beta = alpha its value matters little: p - c = 1, or as near as LARGE_ALPHA
        allows. A given beta makes g depend on alpha: the least error factor at x = a
        decides.
        """
        if self.beta is None:
            return min(1.0 / max(1.0 - self.e, 1e-9), LARGE_ALPHA)

        def error_factor(alpha: float) -> float:
            g = self.weight(alpha)[0]
            P = 2.0 * (1.0 / alpha + self.e + self.best_c(alpha)) - g
            return abs(factor(P, g, self.low))

        return min(ALPHAS, key=error_factor)

    def best_c(self, alpha: float) -> float:
        g, G = self.weight(alpha)
        t = 1.0 / alpha + self.e
        return max(self.best_p(g) - t, SMALL_C, self.least_c(t, g, G))

    def factored_c(self) -> float:
        a, b = self.low, self.high
        if not self.method.own:
            skew = 1.0 if self.lcp.matrix.symmetric else NONSYMMETRIC
            return math.sqrt(a * min(b, 2.0)) * skew * self.scale
        K = 0.25 * (math.sqrt((a + b) ** 2 + 12.0 * a * b) - (a + b))
        return max(K + 0.5 - self.e, SMALL_C, self.least_c(2.0, 2.0, 1.5))

    def best_p(self, g: float) -> float:
        """Return p, with equal error factors at x = a and x = b if b <= 2."""
        a, b = self.low, self.high
        over = max(b / 2.0, 1.0)  # above 1 the ordering of A is not consistent
        sum_ = (2.0 - g) * (a + b / math.sqrt(over))
        product = g * (4.0 - g) * a * b * over
        # rounding may make `a` of a singular matrix negative
        P = 0.5 * (sum_ + math.sqrt(max(sum_ * sum_ + 4.0 * product, 0.0)))
        return 0.5 * (g + P * self.scale)

    def least_c(self, t: float, g: float, G: float) -> float:
        """Return the least c for the rows at their bounds, by bisection; p = t + c."""
        if self.free.all() or G == 0.0:
            return 0.0
        low, high = 0.0, t
        for _ in range(30):
            c = 0.5 * (low + high)
            free = factor(2.0 * (t + c) - g, g, self.low)
            is_less = (t - c) / (t + c) > free * abs(free)
            low, high = (c, high) if is_less else (low, c)
        above = max(self.high - 2.0, 0.0) * max(self.above - 2.0, 0.0)
        return max(high, LEAST_C * G * above**0.25 / t) * self.scale

    def estimate(self, free: np.ndarray, change: np.ndarray) -> None:
        """Update low, high and above for the rows `free` (bool).

        The last `change` of z is rich in the eigenvectors of small eigenvalues.
        """
        is_known = self.is_sharp and np.array_equal(free, self.free)
        self.free = free
        if is_known or not CERTAIN < self.row_sum < WILD or not free.any():
            return
        if self.above == 0.0:
            everything = np.ones_like(free)
            self.above = self.ritz_values(everything, change, LANCZOS // 2)[1]
        low, high, error = self.ritz_values(free, change, LANCZOS)
        self.low = max(low, 1.0 - self.row_sum, LEAST)
        self.high = max(min(high, 1.0 + self.row_sum), self.low)
        self.is_sharp = error < SETTLED * low

    def ritz_values(
        self, free: np.ndarray, change: np.ndarray, steps: int
    ) -> tuple[float, float, float]:
        """Return the extreme Ritz values and the error bound of the lower one.

        The start vector is the change of z, or (1, ..., 1), near the lowest eigenvector
        of an M-matrix.
        """
        v = np.where(free, change * self.root, 0.0)
        if not 0.0 < np.linalg.norm(v) < math.inf:
            v = free / 1.0
        v = v / np.linalg.norm(v)
        basis: list[np.ndarray] = []
        diagonal: list[float] = []
        beside = [float(np.linalg.norm(v))]
        values, error = np.ones(1), 0.0
        while len(basis) < steps and beside[-1] > INVARIANT:
            basis.append(v / beside[-1])
            v = np.where(free, (self.C @ (basis[-1] / self.root)) / self.root, 0.0)
            self.products += 1
            diagonal.append(float(basis[-1] @ v))
            for u in basis:  # full reorthogonalisation
                v = v - (u @ v) * u
            beside.append(float(np.linalg.norm(v)))
            values, vectors = eigh_tridiagonal(diagonal, beside[1:-1])
            error = beside[-1] * abs(float(vectors[-1, 0]))
        return float(values[0]), float(values[-1]), error


def factor(P: float, g: float, x: float) -> float:
    """Return the error factor for an eigenvalue x."""
    return (P - (4.0 - g) * x) / (P + g * x)


def mean(x: np.ndarray) -> float:
    return float(np.sum(x)) / max(x.size, 1)


def symmetric_form(A: Any) -> Any:
    """Return +-sqrt(a_ij a_ji), 0 where signs differ."""
    root = sparse.csr_array(A)
    root.data = np.sign(root.data) * np.sqrt(np.abs(root.data))
    C = sparse.csr_array(root.multiply(root.T.tocsr()))
    C.data = np.maximum(C.data, 0.0)
    return sparse.csr_array(C.multiply(root.sign()))
