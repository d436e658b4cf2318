"""alpha = "auto" and omega = "auto": the choice of alpha and Omega from eigenvalues.

A is scaled to a unit diagonal here; c = Omega/D, e = E/D, g = G + H. On the free rows
(l < z = s < u) a triangular method of `sweeps` is the linear iteration with the matrix

    M = (p I - g L)/2,    p = 1/alpha + c + e.

For g = 2 (nam*, am*, p*) this is SOR with relaxation parameter 2/p; g = 1 (m*, namj) is
not SOR. If L and L' are near (I - A)/2, the error in the direction of an eigenvector
with the eigenvalue x of A is multiplied in each sweep by

    (P - (4 - g) x) / (P + g x),    P = 2 p - g.

The moduli of this factor at the extreme eigenvalues a <= x <= b are equal if

    P = ((2 - g) S + sqrt((2 - g)^2 S^2 + 4 g (4 - g) a b)) / 2,    S = a + b.

For g = 2 this is p = 1 + sqrt(a b). A five-point matrix has b = 2 - a, and 2/p is then
Young's optimal parameter 2/(1 + sqrt(1 - mu^2)), mu = 1 - a. For g = 1 and a symmetric
positive definite A, P >= b makes the iteration a contraction in the norm of A, because
p > g/2 + (1 - g/2) b is Ostrowski's condition M + M' - A > 0.

In a row at a bound, the error of s is multiplied by 1 - 2 c/p; it perturbs the free
rows by G L ds. c is chosen so large that this factor is at most the square of the one
at x = a, and larger if b > 2 (A is no M-matrix), see LEAST_C.

a and b are Ritz values on the rows that are free at the sweeps 1, 2, 4, 8, ..., by a
few Lanczos steps. A nonsymmetric A is replaced by the symmetric C, c_ij = +-sqrt(a_ij
a_ji), or 0 if the signs of a_ij and a_ji differ; it has the eigenvalues of A if A is
diagonally similar to a symmetric matrix. Because of the scaling, the iterates do not
depend on k > 0 in (k A, k q) or on a positive diagonal S in (S A S, S q).

"modulus" has the factor (c - x)/(c + x) and c = sqrt(a b), with b cut off at 2, times
NONSYMMETRIC for nonsymmetric A. "nam" and "modified-nam" have the factor
(K - x/2)/(K + 3 x/2), K = c + e - 1/2.

The constants below were fitted once, to problems of `validation/paper/parameters.py`.

References
----------
Young, Iterative Solution of Large Linear Systems (1971), ch. 6; Hageman and Young,
Applied Iterative Methods (1981), ch. 9; Bai, Numer. Linear Algebra Appl. 17 (2010).
"""

import math
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.linalg import eigh_tridiagonal

from namlcp.lcp.data import LCP, diagonal_of
from namlcp.lcp.modulus.kernels import Z
from namlcp.lcp.modulus.methods import (
    SWEEPS,
    Parameters,
    Sweep,
    checked_parameters,
    positive_diagonal,
)
from namlcp.lcp.modulus.steps import Step, TriangularStep, factored_step
from namlcp.lcp.prepared import Prepared

# c >= LEAST_C G sqrt(f) / (p - c), f the geometric mean of b - 2 for the free rows and
# for the whole matrix. c is at least SMALL_C: with less, s hardly changes at a bound.
LEAST_C, SMALL_C = 0.6, 0.01
# a b is reduced by the fraction BALANCE (2 - g): L is not (I - A)/2 when g < 2. For g =
# 4 the best P would be 0.
BALANCE, MOST_G = 0.3, 3.5
# Factor of c for "modulus" with a nonsymmetric A.
NONSYMMETRIC = 0.75
# Largest alpha that is chosen together with Omega, and those compared if beta is given.
LARGE_ALPHA, ALPHAS = 1.95, [0.05 * k for k in range(2, 40)]
# P is corrected from sweep FROM on; every EVERY sweeps the change of z is measured.
FROM, EVERY = 32, 8
# If g < 2, P is multiplied by SHRINK at every power of 2 from FROM on, until P is
# raised: that happens when a change of z exceeds GROWTH times the least one so far, or
# if the largest one between two powers of 2 exceeds STAGNATION times that of the
# interval before: the iterates wander. (Even an algebraic decay would be faster.)
SHRINK, GROWTH, STAGNATION = 0.93, 4.0, 0.7
# Most restarts after a divergence, each of which doubles P.
RETRIES = 8
# Largest relative change of Omega for which a factored method keeps its factors.
REFACTOR = 0.2
# Most Lanczos steps, and the error bound of both extreme Ritz values, relative to them,
# at which fewer are taken. An image orthogonal to the basis of a norm up to INVARIANT
# means that all eigenvalues are found.
LANCZOS, SHARP, INVARIANT = 14, 0.02, 1e-8
# Largest row sum of the scaled |I - A| for which the bounds 1 -+ row sum are used
# instead of Ritz values.
CERTAIN = 0.5
# Least values of `low`: before the first estimate, and of an estimate.
FIRST_LEAST, LEAST = 1e-3, 1e-5
# Error bound of the least Ritz value, relative to it, below which another estimate for
# the same free rows is not made.
SETTLED = 0.3


class AdaptiveStep(Step):
    """A step that chooses alpha or Omega, those that are "auto", during the run.

    When Omega changes, s = z - w/Omega is recomputed for the same z and w, so that a
    solution remains a fixed point. `step` is None if the first factorisation fails.
    """

    def __init__(self, lcp: LCP, method: str, parameters: Parameters):
        """Check the other parameters."""
        chosen = SWEEPS[method]
        names = ("alpha", "omega")
        free = {
            name: None for name in names if isinstance(getattr(parameters, name), str)
        }
        if chosen.factored:
            D = positive_diagonal(lcp.A, method)
            shift = (
                diagonal_of("shift", parameters.shift, D.size, D)
                if chosen.own
                else None
            )
            fixed = parameters._replace(shift=shift)
        else:
            checked = checked_parameters(lcp.A, method, parameters._replace(**free))
            fixed = parameters._replace(shift=checked.shift)
            if parameters.omega is not None and "omega" not in free:
                fixed = fixed._replace(omega=checked.omega)
        self.lcp, self.fixed = lcp, fixed
        self.choice = Choice(lcp.matrix, chosen, fixed)
        self.alpha, self.omega = self.choice.parameters()
        self.step: Any = self.build(self.alpha, self.omega)
        self.k = self.retries = 0
        self.before = np.empty(0)

    def build(self, alpha: float, omega: np.ndarray) -> Step | None:
        """Return a step with these parameters, None if the factorisation fails."""
        chosen, fixed = self.choice.method, self.fixed
        beta = fixed.beta_for(chosen, alpha)
        now = fixed._replace(alpha=alpha, beta=beta, omega=omega)
        if chosen.factored:
            return factored_step(self.lcp, now)
        return TriangularStep(self.lcp, chosen, now)

    def __call__(self, old: np.ndarray, new: np.ndarray) -> float:
        """Write the next iterate to `new` and return Res(z) of `old`.

        old[S] is overwritten if Omega changes.
        """
        z = old[Z]
        k, self.k = self.k, self.k + 1
        due, doubled = (k >= FROM and k % EVERY == 0), k > 0 and k & (k - 1) == 0
        changes = due and self.choice.watch(z - self.before)
        if doubled:
            free = (z > self.lcp.lower) & (z < self.lcp.upper)
            self.choice.look(k, free, z - self.before)
        if changes or doubled:
            self.change(old)
        if (k + 1) % EVERY == 0 or k & (k + 1) == 0:
            self.before = z.copy()
        return self.step(old, new)

    def retries_from(self, point: np.ndarray) -> bool:
        """Prepare a restart from an iterate with larger P; tell whether to restart."""
        if self.retries == RETRIES:
            return False
        self.retries += 1
        self.choice.raised = 2.0
        self.choice.take_care()
        self.choice.least = np.inf
        self.change(point)
        self.before = point[Z].copy()
        return True

    def change(self, point: np.ndarray) -> None:
        """Use the parameters of `choice` from now on; point[S] is overwritten."""
        s, z = point
        alpha, omega = self.choice.parameters()
        is_near = np.all(np.abs(omega - self.omega) <= REFACTOR * self.omega)
        if self.choice.method.factored and is_near:
            return
        step = self.build(alpha, omega)
        if step is None:
            return
        if not np.array_equal(omega, self.omega):
            np.subtract(z, (self.omega / omega) * (z - s), out=s)
        self.alpha, self.step, self.omega = alpha, step, omega


class Spectrum:
    """Estimates of the extreme eigenvalues of the scaled A on the free rows.

    low, high: the least and the largest one, a and b of the module. above: b of the
    whole matrix, 0 before the first estimate. products: products with A so far.
    """

    def __init__(self, matrix: Prepared):
        self.symmetric = matrix.symmetric
        self.C = matrix.A if self.symmetric else symmetric_form(matrix.A)
        self.root = matrix.root
        rows = (abs(self.C) @ (1.0 / self.root)) / self.root - 1.0
        self.row_sum = float(np.max(rows, initial=0.0))
        self.low = max(1.0 - self.row_sum, FIRST_LEAST)
        self.high = 1.0 + self.row_sum
        self.above = 0.0
        self.products = 0
        self.free = np.empty(0, dtype=bool)
        self.sharp = False

    def estimate(self, free: np.ndarray, change: np.ndarray) -> None:
        """Update low, high and above for the rows `free` (bool).

        The last `change` of z is rich in the eigenvectors of small eigenvalues.
        """
        if self.row_sum <= CERTAIN or not free.any():
            return
        if self.sharp and np.array_equal(free, self.free):
            return
        if self.above == 0.0:
            everything = np.ones_like(free)
            self.above = self.ritz_values(everything, change, LANCZOS // 2)[1]
        low, high, error = self.ritz_values(free, change, LANCZOS)
        self.low = max(low, 1.0 - self.row_sum, LEAST)
        self.high = min(high, 1.0 + self.row_sum)
        self.free, self.sharp = free, error < SETTLED * low

    def ritz_values(
        self, free: np.ndarray, change: np.ndarray, steps: int
    ) -> tuple[float, float, float]:
        """Return the extreme Ritz values and the error bound of the lower one.

        The start vector is (1, ..., 1), near the lowest eigenvector of an M-matrix,
        plus the change of z, both normalised.
        """
        v = free / math.sqrt(np.count_nonzero(free))
        y = np.where(free, change * self.root, 0.0)
        size = np.linalg.norm(y)
        if 0.0 < size < math.inf:
            v = v + y / (size if v @ y >= 0.0 else -size)
        basis: list[np.ndarray] = []
        diagonal: list[float] = []
        beside = [float(np.linalg.norm(v))]
        values, error = np.ones(1), np.zeros(1)
        while len(basis) < steps and beside[-1] > INVARIANT:
            basis.append(v / beside[-1])
            v = np.where(free, (self.C @ (basis[-1] / self.root)) / self.root, 0.0)
            self.products += 1
            diagonal.append(float(basis[-1] @ v))
            for u in basis:  # full reorthogonalisation
                v = v - (u @ v) * u
            beside.append(float(np.linalg.norm(v)))
            values, vectors = eigh_tridiagonal(diagonal, beside[1:-1])
            error = beside[-1] * np.abs(vectors[-1])
            if (error[[0, -1]] < SHARP * values[[0, -1]]).all():
                break
        return float(values[0]), float(values[-1]), float(error[0])


def symmetric_form(A: Any) -> Any:
    """Return +-sqrt(a_ij a_ji), 0 where signs differ."""
    if isinstance(A, np.ndarray):
        root = np.sign(A) * np.sqrt(np.abs(A))
        return np.sign(A) * np.maximum(root * root.T, 0.0)
    root = A.copy()
    root.data = np.sign(A.data) * np.sqrt(np.abs(A.data))
    C = sp.csr_array(root.multiply(root.T.tocsr()))
    C.data = np.maximum(C.data, 0.0)
    return sp.csr_array(C.multiply(A.sign()))


def mean(x: np.ndarray) -> float:
    return float(np.sum(x)) / max(x.size, 1)


class Choice:
    """The choice of alpha and Omega of a sweep method during its run.

    A has a positive diagonal; `parameters` are checked arrays, alpha or omega "auto".
    """

    def __init__(self, matrix: Prepared, method: Sweep, parameters: Parameters):
        alpha, beta, omega, shift = parameters
        self.D = np.array(matrix.diagonal)
        self.method = method
        self.asked = alpha, omega
        self.beta: Any = method.beta if beta is None else beta
        self.e = 0.0 if shift is None else mean(shift / self.D)
        self.spectrum = Spectrum(matrix)
        self.all_free = False
        self.scale = 1.0  # factor of P and of the least c
        self.shrink = SHRINK
        self.raised = 1.1  # next factor by which to raise `scale`
        # Sizes of changes of z: least so far, largest since the last power of 2, and
        # largest between the two powers before that.
        self.least, self.peak, self.last_peak = math.inf, 0.0, math.inf

    def watch(self, change: np.ndarray) -> bool:
        """Note the size of a change of z; tell whether P was raised because of it.

        The size is |D^(1/2) dz|, which unlike Res does not depend on the scaling.
        """
        size = float(np.linalg.norm(change * self.spectrum.root))
        self.least = min(self.least, size)
        self.peak = max(self.peak, size)
        if not size > GROWTH * self.least:
            return False
        self.least = size
        self.take_care()
        self.peak = math.inf  # STAGNATION is not applied at the next power of 2
        return True

    def take_care(self) -> None:
        """Raise P and the least c for good, by 1.1, 1.2, 1.4, 1.8, 2, 2, ..."""
        self.scale *= self.raised
        self.raised = min(2.0 * self.raised - 1.0, 2.0)
        self.shrink = 1.0

    def look(self, k: int, free: np.ndarray, change: np.ndarray) -> None:
        """Update the spectrum and P for iterate k, its free rows and change of z."""
        self.all_free = bool(free.all())
        self.spectrum.estimate(free, change)
        if k > FROM:
            if STAGNATION * self.last_peak < self.peak < math.inf:
                self.take_care()
            self.last_peak, self.peak = self.peak, 0.0
        ratio = 1.0 if self.beta is None else self.beta
        if k >= FROM and not self.method.factored and self.weight(ratio)[0] < 2.0:
            self.scale *= self.shrink

    def weight(self, ratio: float) -> tuple[float, float]:
        """Return g = G + H in [0, MOST_G] and G >= 0 for beta/alpha = ratio."""
        G = ratio + self.method.own
        return min(max(G + self.method.reflected, 0.0), MOST_G), max(G, 0.0)

    def parameters(self) -> tuple[float, np.ndarray]:
        """Return alpha and the diagonal of Omega."""
        alpha, omega = self.asked
        if self.method.factored:
            c = self.factored_omega()
            if alpha == "auto":  # Omega = alpha I
                return 1.0, np.full_like(self.D, c * math.exp(mean(np.log(self.D))))
            return 1.0, c * self.D
        if alpha == "auto":
            if not isinstance(omega, str):
                return self.alpha_for(omega)
            alpha = self.free_alpha()
        alpha = 1.0 if alpha is None else alpha
        return alpha, self.best_c(alpha) * self.D

    def free_alpha(self) -> float:
        """Return alpha if Omega is chosen, too.

        With beta = alpha its value matters little: p - c = 1, or as near as LARGE_ALPHA
        allows. A given beta makes g depend on alpha: the least error factor decides.
        """
        if self.beta is None:
            return min(1.0 / max(1.0 - self.e, 1e-9), LARGE_ALPHA)
        return min(ALPHAS, key=self.error_factor)

    def error_factor(self, alpha: float) -> float:
        """Return the modulus of the error factor at x = a for the best c."""
        g = self.weight(self.beta / alpha)[0]
        P = 2.0 * (1.0 / alpha + self.e + self.best_c(alpha)) - g
        a = self.spectrum.low
        return abs((P - (4.0 - g) * a) / (P + g * a))

    def best_c(self, alpha: float) -> float:
        """Return the best c for a given alpha."""
        g, G = self.weight(1.0 if self.beta is None else self.beta / alpha)
        p = self.best_p(g)
        t = 1.0 / alpha + self.e
        return max(p - t, SMALL_C, self.least_omega(t, g, G))

    def alpha_for(self, omega: Any) -> tuple[float, np.ndarray]:
        """Return the best alpha for a given Omega, or for the default one (None)."""
        ratio = 1.0 if self.beta is None else self.beta / self.free_alpha()
        x = self.best_p(self.weight(ratio)[0]) - self.e  # 1/alpha + c
        if omega is not None:
            x -= mean(omega / self.D)
        elif self.method.reflected:  # c = 1/alpha
            x /= 2.0
        else:  # c = 1/(2 alpha^2)
            x = math.sqrt(max(1.0 + 2.0 * x, 1.0)) - 1.0
        alpha = min(1.0 / max(x, 1e-9), 1.999)
        if omega is None:
            c = 1.0 / alpha if self.method.reflected else 0.5 / (alpha * alpha)
            omega = c * self.D
        return alpha, omega

    def factored_omega(self) -> float:
        """Return c for a method with M = A."""
        a, b = self.spectrum.low, self.spectrum.high
        if not self.method.own:
            skew = 1.0 if self.spectrum.symmetric else NONSYMMETRIC
            return math.sqrt(a * min(b, 2.0)) * skew * self.scale
        K = 0.25 * (math.sqrt((a + b) ** 2 + 12.0 * a * b) - (a + b))
        least = self.least_omega(2.0, 2.0, 1.5)
        return max(K + 0.5 - self.e, SMALL_C, least)

    def best_p(self, g: float) -> float:
        """Return p, with equal error factors at x = a and x = b if b <= 2."""
        a, b = self.spectrum.low, self.spectrum.high
        over = max(b / 2.0, 1.0)  # above 1 the ordering of A is not consistent
        sum_ = (2.0 - g) * (a + b / math.sqrt(over))
        product = g * (4.0 - g) * (1.0 - BALANCE * max(2.0 - g, 0.0)) * a * b * over
        # rounding may make `a` of a singular matrix negative
        P = 0.5 * (sum_ + math.sqrt(max(sum_ * sum_ + 4.0 * product, 0.0)))
        return 0.5 * (g + P * self.scale)

    def least_omega(self, t: float, g: float, G: float) -> float:
        """Return the least c for the rows at their bounds, by bisection; p = t + c."""
        if self.all_free or G == 0.0:
            return 0.0
        a, b, above = self.spectrum.low, self.spectrum.high, self.spectrum.above
        low, high = 0.0, t
        for _ in range(30):
            c = 0.5 * (low + high)
            P = 2.0 * (t + c) - g
            free = (P - (4.0 - g) * a) / (P + g * a)
            if (t - c) / (t + c) > free * abs(free):
                low = c
            else:
                high = c
        f = math.sqrt(max(b - 2.0, 0.0) * max(above - 2.0, 0.0))
        return max(high, LEAST_C * G * math.sqrt(f) / t) * self.scale
