"""Box LCPs whose symmetric A is known by its products alone: MPRGP, face by face.

A positive semidefinite A makes the LCP the optimality condition of

    minimise f(z) = 1/2 z'A z + q'z  subject to  l <= z <= u,  w = A z + q its gradient.

In units of D = diag(A), y = D^(1/2) z (Jacobi preconditioning; the box stays a box),
with g the gradient there, the free gradient phi is g on the face (the free unknowns,
l < y < u), and the chopped gradient beta is g at the bounds from which -g points into
the box. The larger of phi and beta decides which of three steps is taken, each with one
product with A, two at the most (Dostal 2009, algorithm 5.8):

- phi: a step of conjugate gradients on the face, if it stays in the box;
- phi, if it does not: the whole step projected, where f then falls (Kruzik, Horak,
  Cermak, Pospisil and Pecha 2020), else the part up to the first bound;
- beta: a step along -beta, which frees its entries.

f never increases. The last face is solved by conjugate gradients to rounding.

A direction v with A v = 0 along which f falls for ever proves that there is no
solution, one of negative curvature that A is not semidefinite.

References
----------
Dostal, Optimal Quadratic Programming Algorithms (2009), ch. 5; Dostal and Schoberl,
Comput. Optim. Appl. 30 (2005) 23-43; Kruzik et al., Adv. Eng. Softw. 150 (2020)
102895; Polonsky and Keer, Wear 231 (1999) 206-219.
"""

import math

import numpy as np

from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP, Outcome
from namlcp.limits import Limits
from namlcp.residuals import natural_residual
from namlcp.status import Status

MAX_ITER = 20_000
"""Iterations at most, unless the caller says."""

MISSES = 4
"""Times that a fresh product may show, without progress, that the recursion's residual
was too small."""

SUFFICIENT = 0.1
"""A projected step is taken if f falls by this fraction of what its slope promises."""

FLAT, NEGATIVE = 1e-13, -1e-10
"""A curvature p'A p / p'p of modulus below FLAT ||A|| counts as zero; one below
NEGATIVE ||A|| shows that A is not semidefinite."""

RAY = 1e-14
"""||A v|| up to this times ||A|| ||v|| counts as zero."""

MINIMUM = 0.1
"""A flat direction has a minimum if at most this fraction of the residual is left
there."""

RAY_PRODUCTS = 500
"""Products with A at most that make a flat direction v satisfy A v = 0."""

RAY_ENTRY = 1e-9
"""Entries of a ray below this times the largest are set to 0."""


TOO_FAR = 1e6
"""A start with a residual so many times that of clip(0) loses the digits of products;
it is replaced by clip(0)."""


def solve_by_products(
    lcp: LCP, z0: np.ndarray | None, limits: Limits, criterion: Criterion
) -> Outcome:
    """Solve a box LCP with a symmetric A, an `Operator` with A.diagonal() >= 0.

    The criterion is asked for every iterate, and SOLVED is said only after a fresh
    product w = A z + q. z is the point with the least Res that was met. STALLED:
    rounding. UNSOLVABLE with a ray: no solution; without: A is not positive
    semidefinite. NUMERICAL_ERROR: a product is not finite; z and w are NaN.
    """
    with np.errstate(all="ignore"):  # numbers out of range are noticed
        z = lcp.start(z0)
        if z0 is not None:
            there = criterion.residuals(z, lcp.w(z))[1]
            if not there <= TOO_FAR * criterion.size:
                z = lcp.start()
        return descent_from(lcp, z, limits, criterion)


def descent_from(
    lcp: LCP, z0: np.ndarray, limits: Limits, criterion: Criterion
) -> Outcome:
    """Take steps from z0 in the box until one of the ends of `solve_by_products`."""
    _, _, lower, upper = lcp
    root = lcp.matrix.root
    max_iter = limits.max_iter or MAX_ITER

    def caller(y: np.ndarray, g: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        z = np.where(y <= descent.lower, lower, np.clip(y / root, lower, upper))
        return np.where(y >= descent.upper, upper, z), g * root

    descent = Descent(lcp, z0)
    best = descent.y, descent.g
    least = missed = math.inf
    misses = 0
    status = Status.MAX_ITER
    k = 0
    while math.isfinite(descent.size):
        size = descent.size
        if size < least:
            best, least = (descent.y, descent.g), size
        if limits.report is not None:
            here = lcp.residual(*caller(descent.y, descent.g))
            limits.report(k, here, int(np.count_nonzero(~descent.free)))
        if criterion.accepts(*caller(descent.y, descent.g)):
            descent.refresh()
            best, least = (descent.y, descent.g), descent.size
            if criterion.accepts(*caller(descent.y, descent.g)):
                status = Status.SOLVED
                break
            misses = 0 if descent.size < 0.5 * missed else misses + 1
            missed = min(missed, descent.size)
        if misses == MISSES or descent.size == 0.0:
            status = Status.STALLED
            break
        if k == max_iter:
            break
        if limits.deadline.reached():
            status = Status.TIME_LIMIT
            break
        trouble = descent.step()
        if trouble is not None:
            status = trouble
            break
        k += 1
    z = caller(*best)[0]
    w = lcp.w(z)
    if not (math.isfinite(descent.size) and np.isfinite(w).all()):
        nothing = np.full(z.size, np.nan)
        return Outcome(Status.NUMERICAL_ERROR, nothing, nothing, k, "mprgp")
    return Outcome(status, z, w, k, "mprgp", descent.ray)


class Descent:
    """The iterate in units of D and the steps that MPRGP takes from it.

    Attributes
    ----------
    y, g : (n,) array
        Iterate and gradient there; each step makes new ones.
    free : (n,) bool array
        The face, l < y < u.
    size : float
        Res(y) in these units.
    ray : (n,) array or None
        The proof that there is no solution, in the caller's units.
    """

    def __init__(self, lcp: LCP, z0: np.ndarray):
        self.A, self.root = lcp.A, lcp.matrix.root
        root = self.root
        self.q, self.lower, self.upper = (
            lcp.q / root,
            lcp.lower * root,
            lcp.upper * root,
        )
        self.ray: np.ndarray | None = None
        self.norm = 0.0  # largest ||A p|| / ||p|| that was met
        self.y = np.clip(z0 * root, self.lower, self.upper)
        self.refresh()

    def product(self, x: np.ndarray) -> np.ndarray:
        """Return D^(-1/2) A D^(-1/2) x."""
        return (self.A @ (x / self.root)) / self.root

    def refresh(self) -> None:
        """Compute the gradient anew, without the errors of the recursion."""
        self.g = self.product(self.y) + self.q
        self.p: np.ndarray | None = None  # direction of the conjugate gradients
        self.look()

    def look(self) -> None:
        """Sort the entries of the gradient at a new iterate."""
        self.free = (self.y > self.lower) & (self.y < self.upper)
        self.phi = np.where(self.free, self.g, 0.0)
        self.size = natural_residual(self.y, self.g, self.lower, self.upper)

    def move(self, step: float, p: np.ndarray, Ap: np.ndarray) -> None:
        """Go to clip(y - step p); only rounding is clipped."""
        self.y = np.clip(self.y - step * p, self.lower, self.upper)
        self.g = self.g - step * Ap
        self.look()

    def limit(self, p: np.ndarray) -> float:
        """Return the step along -p that meets the first bound."""
        down, up = p > 0.0, p < 0.0
        room = np.inf
        if down.any():
            room = np.min((self.y - self.lower)[down] / p[down])
        if up.any():
            room = min(room, np.min((self.y - self.upper)[up] / p[up]))
        return float(room)

    def curvature(self, p: np.ndarray) -> tuple[np.ndarray, float]:
        """Return A p and p'A p, 0 where it is only rounding."""
        Ap = self.product(p)
        pp = float(p @ p)
        self.norm = max(self.norm, math.sqrt(float(Ap @ Ap) / pp))
        pAp = float(p @ Ap)
        return Ap, 0.0 if abs(pAp) <= FLAT * self.norm * pp else pAp

    def step(self) -> Status | None:
        """Take one step; return UNSOLVABLE or STALLED where there is none."""
        at_lower, at_upper = self.y <= self.lower, self.y >= self.upper
        inwards = np.where(at_lower, self.g < 0.0, at_upper & (self.g > 0.0))
        beta = np.where(inwards & ~(at_lower & at_upper), self.g, 0.0)
        on_face = float(beta @ beta) <= self.reduced()
        if on_face:
            p = self.phi if self.p is None else self.p
        else:
            p = beta
        if float(p @ p) == 0.0:
            return Status.STALLED
        Ap, pAp = self.curvature(p)
        if not math.isfinite(pAp):
            self.size = pAp
            return Status.NUMERICAL_ERROR
        if pAp < NEGATIVE * self.norm * float(p @ p):
            return Status.UNSOLVABLE
        room = self.limit(p)
        whole = float(self.g @ p) / pAp if pAp > 0.0 else math.inf
        if whole == room == math.inf:
            self.ray = self.proof(p)
            if self.leap(p) or (
                self.ray is not None and self.leap(-self.ray * self.root)
            ):
                self.ray = None
                return None
            return Status.STALLED if self.ray is None else Status.UNSOLVABLE
        if whole <= room:
            self.move(whole, p, Ap)
            # the face is the same, but for entries that came to rest on a bound
            self.p = self.phi - (float(self.phi @ Ap) / pAp) * p if on_face else None
        elif on_face and whole < math.inf and self.project(whole, p):
            # What is left of the direction serves on (Polonsky and Keer 1999 do so).
            rest = np.where(self.free, p, 0.0)
            rest = self.phi - (float(self.phi @ Ap) / pAp) * rest
            self.p = rest if float(self.g @ rest) > 0.0 else None
        else:
            self.move(room, p, Ap)
            self.p = None
        return None

    def reduced(self) -> float:
        """Return phi'phi_r, phi_r the part of phi that a gradient step can use."""
        if self.norm == 0.0:
            return float(self.phi @ self.phi)
        step = 1.0 / self.norm
        projected = np.clip(self.y - step * self.phi, self.lower, self.upper)
        return float(self.phi @ (self.y - projected)) * self.norm

    def project(self, step: float, p: np.ndarray) -> bool:
        """Go to clip(y - step p), if f falls there."""
        y = np.clip(self.y - step * p, self.lower, self.upper)
        d = y - self.y
        slope = float(self.g @ d)
        if not slope < 0.0:
            return False
        Ad = self.product(d)
        if slope + 0.5 * float(d @ Ad) > SUFFICIENT * slope:
            return False
        self.y, self.g = y, self.g + Ad
        self.look()
        return True

    def leap(self, p: np.ndarray) -> bool:
        """Go to the minimum along -p, where its curvature is tiny, if it is one.

        A curvature that is not rounding, however small, has a minimum far away.
        """
        pAp = float(p @ self.product(p))
        if not pAp > 0.0:
            return False
        y = np.clip(self.y - float(self.g @ p) / pAp * p, self.lower, self.upper)
        g = self.product(y) + self.q
        if not natural_residual(y, g, self.lower, self.upper) <= MINIMUM * self.size:
            return False
        self.y, self.g, self.p = y, g, None
        self.look()
        return True

    def proof(self, p: np.ndarray) -> np.ndarray | None:
        """Return v in the caller's units, A v = 0 up to rounding and q'v = -1, or None.

        v leads into no finite bound; then v'w = v'(A z + q) < 0 for every z, but >= 0
        for a solution. -p is v but for a part that A sees, x: conjugate gradients for
        A x = -A p.
        """
        v = -p / np.max(np.abs(p))
        r = self.product(v)
        d = r
        for _ in range(RAY_PRODUCTS):
            rr = float(r @ r)
            if rr <= (0.1 * RAY * self.norm) ** 2 * float(v @ v):
                break
            Ad = self.product(d)
            dAd = float(d @ Ad)
            if not dAd > 0.0:
                break
            v = v - (rr / dAd) * d
            r = r - (rr / dAd) * Ad
            d = r + (float(r @ r) / rr) * d
        v = np.where(np.abs(v) <= RAY_ENTRY * np.max(np.abs(v)), 0.0, v)
        fall = float(self.q @ v)
        rest = np.linalg.norm(self.product(v))
        if rest > RAY * self.norm * np.linalg.norm(v) or self.limit(-v) < math.inf:
            return None
        return v / (self.root * -fall) if fall < 0.0 else None
