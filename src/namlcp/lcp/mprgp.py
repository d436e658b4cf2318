"""MPRGP for box LCPs with a symmetric A that is known only by its products.

If A is positive semidefinite, the LCP is the optimality condition of

    minimise f(z) = 1/2 z'A z + q'z  subject to  l <= z <= u.

The method works on the problem scaled to a unit diagonal (Jacobi preconditioning), y =
D^(1/2) z, D = diag(A), with the gradient g. Its free gradient phi is g at the free
variables, l < y < u, and 0 elsewhere; its chopped gradient beta is g at the active
variables whose bound -g leaves, and 0 elsewhere. Each iteration takes one of these
steps (Dostal 2009, algorithm 5.8, with phi in place of the reduced free gradient):

- if beta'beta <= phi'phi, a conjugate gradient step in the free variables; if that is
  infeasible, its projection where this decreases f enough (Kruzik, Horak, Cermak,
  Pospisil and Pecha 2020), else its feasible part;
- otherwise a step along -beta, which frees variables.

A direction v with A v = 0 along which f decreases without bound proves that there is no
solution; a direction of negative curvature proves that A is not semidefinite.

References
----------
Dostal, Optimal Quadratic Programming Algorithms (2009), ch. 5; Dostal and Schoberl,
Comput. Optim. Appl. 30 (2005) 23-43; Kruzik et al., Adv. Eng. Softw. 150 (2020)
102895; Polonsky and Keer, Wear 231 (1999) 206-219.
"""

import math

import numpy as np
from scipy.linalg.blas import dnrm2
from scipy.sparse.linalg import LinearOperator, cg

from namlcp.lcp.data import LCP, Criterion
from namlcp.limits import Limits
from namlcp.residuals import natural_residual
from namlcp.status import Outcome, Status

MAX_DESCENT_STEPS = 20_000
# The method stalls after so many consecutive times that the criterion accepts the
# updated gradient but not the recomputed one, and Res has not halved in between.
MISSES = 4
# Least decrease of f by a projected step d, relative to -g'd.
SUFFICIENT = 0.1
# A curvature p'A p / p'p of modulus up to ZERO_CURVATURE ||A|| counts as zero; one
# below INDEFINITE_CURVATURE ||A|| shows that A is not semidefinite.
ZERO_CURVATURE, INDEFINITE_CURVATURE = 1e-13, -1e-10
# ||A v|| up to RAY_PRODUCT ||A|| ||v|| counts as zero; conjugate gradient steps at most
# that make it so; entries of v up to RAY_ENTRY times the largest are set to 0.
RAY_PRODUCT, RAY_PRODUCTS, RAY_ENTRY = 1e-14, 500, 1e-9
# A start is replaced by clip(0) if its Res is larger than that of clip(0) by more than
# this factor: products with so large a z lose too many digits.
TOO_FAR = 1e6


def solve_by_products(lcp: LCP, z0: np.ndarray | None, limits: Limits) -> Outcome:
    """Return SOLVED only if the criterion accepts a recomputed gradient."""
    with np.errstate(all="ignore"):  # the code tests for infinities and NaN
        z, criterion = lcp.start(z0), Criterion(lcp, limits)
        if z0 is not None:
            there = criterion.residuals(z, lcp.w(z))[1]
            if not there <= TOO_FAR * criterion.size:
                z = lcp.start()
        descent = Descent(lcp, z)
        best, least, missed = z, math.inf, math.inf
        status: Status | None = None
        k = misses = 0
        while status is None and math.isfinite(descent.size):
            z, w = descent.point()
            if limits.report is not None:
                limits.report(k, lcp.residual(z, w), lcp.active(z))
            accepted = criterion.accepts(z, w)
            if descent.size < least or accepted:
                best, least = z, descent.size
            if accepted:
                descent.go(descent.y)
                least = descent.size
                if criterion.accepts(*descent.point()):
                    status = Status.SOLVED
                    break
                misses = 0 if descent.size < 0.5 * missed else misses + 1
                missed = min(missed, descent.size)
            if misses == MISSES or descent.size == 0.0:
                status = Status.STALLED
            elif k == (limits.max_iter or MAX_DESCENT_STEPS):
                status = Status.MAX_ITER
            elif limits.deadline.reached():
                status = Status.TIME_LIMIT
            else:
                status = descent.step()
                k += status is None
        w = lcp.w(best)
        if status is None or not (math.isfinite(descent.size) and np.isfinite(w).all()):
            status = Status.NUMERICAL_ERROR
            best = w = np.full(w.size, np.nan)
        return lcp.outcome(status, best, w, k, "mprgp", descent.message, descent.ray)


class Descent:
    """An iterate y of the problem scaled to a unit diagonal, and the steps from it.

    g: its gradient. free: whether l < y < u. size: Res(y). ray: proof that the unscaled
    problem has no solution.
    """

    def __init__(self, lcp: LCP, z0: np.ndarray):
        self.lcp = lcp
        root = self.root = lcp.matrix.root
        self.q = lcp.q / root
        self.lower, self.upper = lcp.lower * root, lcp.upper * root
        self.ray: np.ndarray | None = None
        self.message = ""
        self.norm = 0.0  # of A: the largest ||A p|| / ||p|| so far
        self.go(self.clipped(z0 * root))

    def clipped(self, y: np.ndarray) -> np.ndarray:
        return np.clip(y, self.lower, self.upper)

    def point(self) -> tuple[np.ndarray, np.ndarray]:
        """Return z and w of the unscaled problem."""
        lower, upper = self.lcp.lower, self.lcp.upper
        z = np.clip(self.y / self.root, lower, upper)
        z = np.where(self.y <= self.lower, lower, z)
        return np.where(self.y >= self.upper, upper, z), self.g * self.root

    def product(self, x: np.ndarray) -> np.ndarray:
        return (self.lcp.A @ (x / self.root)) / self.root

    def go(self, y: np.ndarray, g: np.ndarray | None = None) -> None:
        if g is None:
            g = self.product(y) + self.q
        self.p: np.ndarray | None = None  # next conjugate direction; None: phi
        self.y, self.g = y, g
        self.free = (y > self.lower) & (y < self.upper)
        self.phi = np.where(self.free, g, 0.0)
        self.size = natural_residual(y, g, self.lower, self.upper)

    def limit(self, p: np.ndarray) -> float:
        # the largest feasible step along -p
        moves = p != 0.0
        bound = np.where(p > 0.0, self.lower, self.upper)
        return float(np.min((self.y - bound)[moves] / p[moves], initial=math.inf))

    def step(self) -> Status | None:
        at_lower, at_upper = self.y <= self.lower, self.y >= self.upper
        inwards = np.where(at_lower, self.g < 0.0, at_upper & (self.g > 0.0))
        beta = np.where(inwards & ~(at_lower & at_upper), self.g, 0.0)
        keeps_active = float(beta @ beta) <= float(self.phi @ self.phi)
        p = beta
        if keeps_active:
            p = self.phi if self.p is None else self.p
        pp = float(p @ p)
        if pp == 0.0:
            return Status.STALLED
        Ap = self.product(p)
        self.norm = max(self.norm, dnrm2(Ap) / dnrm2(p))  # without overflow
        pAp = float(p @ Ap)
        if not math.isfinite(pAp):
            self.size = pAp
            return Status.NUMERICAL_ERROR
        if pAp < INDEFINITE_CURVATURE * self.norm * pp:
            self.message = "A is not positive semidefinite"
            return Status.STALLED
        feasible, optimal = self.limit(p), math.inf
        if pAp > ZERO_CURVATURE * self.norm * pp:
            optimal = float(self.g @ p) / pAp
        if optimal == feasible == math.inf:
            self.ray = self.proof(p)
            return Status.STALLED if self.ray is None else Status.UNSOLVABLE
        if optimal > feasible and keeps_active and optimal < math.inf:
            if self.project(optimal, p):
                # the direction is kept in the variables still free (Polonsky and Keer)
                rest = np.where(self.free, p, 0.0)
                rest = self.phi - (float(self.phi @ Ap) / pAp) * rest
                self.p = rest if float(self.g @ rest) > 0.0 else None
                return None
        step = min(optimal, feasible)
        self.go(self.clipped(self.y - step * p), self.g - step * Ap)
        if optimal <= feasible and keeps_active:
            self.p = self.phi - (float(self.phi @ Ap) / pAp) * p
        return None

    def project(self, step: float, p: np.ndarray) -> bool:
        """Go to clip(y - step p) if f decreases enough; tell if so."""
        y = self.clipped(self.y - step * p)
        d = y - self.y
        slope = float(self.g @ d)
        if not slope < 0.0:
            return False
        Ad = self.product(d)
        if slope + 0.5 * float(d @ Ad) > SUFFICIENT * slope:
            return False
        self.go(y, self.g + Ad)
        return True

    def proof(self, p: np.ndarray) -> np.ndarray | None:
        """Return v of the unscaled problem, A v = 0 up to rounding, q'v = -1; or None.

        z + t v meets no bound for any t >= 0, so that a solution has v'w >= 0; but v'w
        = v'(A z + q) = -1 for every z. To find v, conjugate gradients solve A x = A v
        for v = -p (scaled), and x is subtracted.
        """
        v = -p / np.max(np.abs(p))
        A = LinearOperator((v.size, v.size), matvec=self.product, dtype=np.float64)
        least = 0.1 * RAY_PRODUCT * self.norm * np.linalg.norm(v)
        v -= cg(A, A @ v, rtol=0.0, atol=least, maxiter=RAY_PRODUCTS)[0]
        v = np.where(np.abs(v) <= RAY_ENTRY * np.max(np.abs(v)), 0.0, v)
        fall = float(self.q @ v)
        most = RAY_PRODUCT * self.norm * np.linalg.norm(v)
        if np.linalg.norm(self.product(v)) > most or self.limit(-v) < math.inf:
            return None
        return v / (self.root * -fall) if fall < 0.0 else None
