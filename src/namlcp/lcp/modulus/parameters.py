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
at x = a, and larger if b > 2 (A is no M-matrix), see MIN_OMEGA_FACTOR.

a and b are Ritz values on the rows that are free at the sweeps 1, 2, 4, 8, ..., see
`spectrum`. Because of the scaling, the iterates do not depend on k > 0 in (k A, k q) or
on a positive diagonal S in (S A S, S q).

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

from namlcp.lcp.modulus.methods import Method, Parameters
from namlcp.lcp.modulus.spectrum import Spectrum

MIN_OMEGA_FACTOR = 0.6
"""c >= MIN_OMEGA_FACTOR G sqrt(f) / (p - c), f the geometric mean of b - 2 for the free
rows and for the whole matrix."""

BALANCE = 0.3
"""a b is reduced by the fraction BALANCE (2 - g): L is not (I - A)/2 when g < 2."""

MOST_G = 3.5
"""Upper bound of g: for g = 4 the best P would be 0."""

SMALL_OMEGA = 0.01
"""Lower bound of c: with a smaller one s hardly changes in a row at its bound."""

NONSYMMETRIC = 0.75
"""Factor of c for "modulus" with a nonsymmetric A."""

LARGE_ALPHA = 1.95
"""Largest alpha that is chosen together with Omega."""

ALPHAS = [0.05 * k for k in range(2, 40)]
"""Values of alpha that are compared if beta is given and Omega is chosen, too."""

FROM, EVERY = 32, 8
"""P is corrected from sweep FROM on; every EVERY sweeps the change of z is measured."""

SHRINK, GROWTH = 0.93, 4.0
"""If g < 2, P is multiplied by SHRINK at every power of 2 from FROM on, until P is
raised: that happens when a change of z exceeds GROWTH times the least one so far."""

STAGNATION = 0.7
"""P is also raised if the largest change of z between two powers of 2 exceeds that of
the interval before times this: the iterates wander. (Even a slow, algebraic decay would
be faster.)"""


def mean(x: np.ndarray) -> float:
    """Return the mean, 0 of nothing."""
    return float(np.sum(x)) / max(x.size, 1)


class Choice:
    """The choice of alpha and Omega of a sweep method during its run.

    A has a positive diagonal; `given` has checked arrays, and alpha or omega is "auto".
    """

    def __init__(self, A: Any, method: Method, given: Parameters):
        alpha, beta, omega, shift, _ = given
        self.D = np.array(A.diagonal())
        self.method = method
        self.given = alpha, omega
        self.beta: Any = method.beta if beta is None else beta
        self.e = 0.0 if shift is None else mean(shift / self.D)
        self.spectrum = Spectrum(A, self.D)
        self.all_free = False
        self.scale = 1.0  # factor of P and of the least c
        self.shrink = SHRINK
        self.raised = 1.1  # next factor by which to raise `scale`
        # Sizes of changes of z: least so far, largest since the last power of 2, and
        # largest between the two powers before that.
        self.least = math.inf
        self.peak = 0.0
        self.last_peak = math.inf

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
        alpha, omega = self.given
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
        return max(p - t, SMALL_OMEGA, self.least_omega(t, g, G))

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
        return max(K + 0.5 - self.e, SMALL_OMEGA, least)

    def best_p(self, g: float) -> float:
        """Return p, with equal error factors at x = a and x = b if b <= 2."""
        a, b = self.spectrum.low, self.spectrum.high
        over = max(b / 2.0, 1.0)  # above 1 the ordering of A is not consistent
        sum_ = (2.0 - g) * (a + b / math.sqrt(over))
        product = g * (4.0 - g) * (1.0 - BALANCE * max(2.0 - g, 0.0)) * a * b * over
        P = 0.5 * (sum_ + math.sqrt(sum_ * sum_ + 4.0 * product))
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
        return max(high, MIN_OMEGA_FACTOR * G * math.sqrt(f) / t) * self.scale
