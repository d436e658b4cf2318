"""The search for certificates of infeasibility in the interior-point method.

Candidates are the iterate and the last step, as they are and projected by means of one
factorisation of K. Those with small relative residuals (`promising_ratios`) are tested
by `accept_primal` and `accept_dual` on unscaled data.
"""

from collections.abc import Callable
from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.qp.certificates import accept_dual, accept_primal, largest
from namlcp.qp.guess import Guess
from namlcp.qp.judge import Judge
from namlcp.qp.kkt import products
from namlcp.qp.path.refinement import ActiveSetSystem
from namlcp.qp.path.steps import DUAL, DUAL_NORM, PRIMAL, ROW_NORM, SLACK_NORM, THIN
from namlcp.qp.problem import Point
from namlcp.qp.transforms import Contradiction, Presolved, ScaledQP
from namlcp.status import Status

if TYPE_CHECKING:
    from namlcp.qp.path.loop import Interior

# A residual converges if an iteration reduces it to this part: then there is no test.
CONVERGING = 0.1
# Relative residual of a candidate up to which it is tested.
PROMISING = 0.1
# A candidate is projected again when its relative residual fell to this part of that
# at the last projection.
AGAIN = 0.1
# In a projection, the weight of the distance to the candidate, where the residual has
# weight 1, and the refinement steps at most.
PROJECTION, PROJECTION_STEPS = 1e-8, 15
# A one-sided constraint is an equation in the projection of a ray d, max |d_j| = 1, if
# sign * C d, scaled, exceeds NEARLY_ACTIVE for d, or VIOLATED for a projection so far.
NEARLY_ACTIVE, VIOLATED, RAY_PROJECTIONS = -1e-3, 1e-13, 3


def contradiction(
    judge: Judge, small: Presolved, reason: Contradiction
) -> Point | None:
    """Return the certificate of what presolve found: NaN without multipliers."""
    qp = judge.qp
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    if reason.y is None:
        x, y, z = (np.full(k, np.nan) for k in (n, p, m))
        return Point(x, y, z, x)
    z = np.zeros(m) if reason.z is None else reason.z
    x = small.with_fixed(np.zeros(small.q.size))
    return accept_primal(qp, x, reason.y, z, judge.limits.eps_abs)


class CertificateSearch:
    """The tests of every iteration; `proof` is the certificate found."""

    def __init__(self, problem: ScaledQP, judge: Judge) -> None:
        self.problem, self.judge = problem, judge
        self.tol = judge.limits.eps_abs
        self.proof: Point | None = None
        self.before = 0.0, 0.0  # dual and primal residual of the last iteration
        self.promised = False  # some candidate was worth a test
        self.projected = np.full(4, PROMISING)  # ratios at the last projections
        self.ratios = np.empty(4)
        self.system = ActiveSetSystem(problem)
        n, size = problem.n, problem.kkt.size
        self.Px, self.Ctv = np.empty((2, n))
        self.v, self.t = np.empty((2, size))

    def find(self, loop: "Interior") -> Status | None:
        """Return the verdict of the first candidate that is a proof, or None.

        In an infeasible (unbounded) problem the primal (dual) residual cannot vanish.
        While it is within the tolerance or falls tenfold, no candidate is tested.
        """
        s, norms = self.problem, loop.norms
        now = norms[DUAL_NORM], max(norms[ROW_NORM], norms[SLACK_NORM])
        before, self.before = self.before, now
        dual = now[0] > CONVERGING * before[0] and norms[DUAL] > self.tol
        primal = now[1] > CONVERGING * before[1] and norms[PRIMAL] > self.tol
        if not (primal or dual):
            return None
        promising_ratios(
            *s.kkt.triangle, s.q, s.b, s.c, s.place, s.sign, loop.x, loop.y, loop.Z,
            loop.Px, loop.Ctv, loop.v, loop.t, loop.du, loop.dZ, self.Px, self.Ctv,
            self.v, self.t, self.ratios,
        )  # fmt: skip
        promising = self.ratios <= PROMISING
        if not promising.any():
            return None
        self.promised = True
        step_x, step_y = loop.du[: s.n], loop.du[s.n : s.n + s.p]
        for k, stuck, *candidate in (
            (0, primal, loop.y, loop.Z),
            (1, primal, step_y, np.maximum(loop.dZ, 0.0)),
            (2, dual, loop.x),
            (3, dual, step_x),
        ):
            if stuck and promising[k] and self.is_proof(k, loop, candidate):
                return Status.PRIMAL_INFEASIBLE if k < 2 else Status.DUAL_INFEASIBLE
        return None

    def is_proof(self, k: int, loop: "Interior", candidate: list[np.ndarray]) -> bool:
        """Test candidate k, then its projections where it improved since the last."""
        proof: Callable[..., Point | None]
        projections: Callable[..., list[Any]]
        iterate: Any
        if k < 2:
            proof, projections = self.farkas_proof, self.project_multipliers
            iterate = self.problem.primal(loop.x)
        else:
            proof, projections = self.ray_proof, self.project_ray
            iterate = self.problem.point(loop.x, loop.y, loop.Z)
        self.proof = proof(iterate, *candidate)
        if self.proof is None and self.ratios[k] <= AGAIN * self.projected[k]:
            self.projected[k] = self.ratios[k]
            for better in projections(*candidate):
                self.proof = proof(iterate, *better)
                if self.proof is not None:
                    break
        return self.proof is not None

    def farkas_proof(self, x: np.ndarray, y: np.ndarray, Z: np.ndarray) -> Point | None:
        """Return the proof that scaled multipliers make, None if they make none."""
        y, z = self.problem.certificate(y, Z)
        return accept_primal(self.judge.qp, x, y, z, self.tol)

    def ray_proof(self, point: Point, d: np.ndarray) -> Point | None:
        """Return the proof that a scaled direction makes, None if it makes none."""
        d = self.problem.ray(d)
        return accept_dual(self.judge.qp, *point[:3], d, self.tol)

    def project(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Point | None:
        """Return the proof that unscaled multipliers make once projected, or None."""
        qp = self.judge.qp
        if not largest(y) + largest(z) > 0.0:
            return None
        z_box = -(qp.G.T @ z + qp.A.T @ y)
        active = np.zeros(z.size + 2 * z_box.size, dtype=np.int8)
        _, y_scaled, Z, _ = self.problem.guess(Guess(x, y, z, z_box, active))
        projection = self.project_multipliers(y_scaled, Z)[0]
        return self.farkas_proof(x, *projection)

    def project_multipliers(
        self, y: np.ndarray, Z: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Project on the Farkas system A'y + C'Z = 0, in a norm with w = sqrt(Z).

        min |A'(y + dy) + C'(Z + dZ)|^2/(2 eps) + |dy|^2/2 + sum dZ^2/(2 w), with eps =
        PROJECTION, is solved again as long as the residual is halved.
        """
        s, kkt = self.problem, self.problem.kkt
        size = max(largest(y), largest(Z))
        y, Z = y / size, Z / size
        w = np.sqrt(Z)
        weight = self.sums(w)
        kkt.data[:] = kkt.base
        kkt.data[: kkt.indptr[s.n]] = 0.0
        diagonal = np.full(kkt.size, -1.0)
        diagonal[: s.n] = PROJECTION + weight[: s.n]
        row = slice(s.n + s.p, None)
        diagonal[row] = -1.0 / np.maximum(weight[row], THIN)
        kkt.data[kkt.diagonal] = diagonal
        factored = kkt.factor()
        kkt.data[:] = kkt.base
        last, rhs = inf, np.zeros(kkt.size)
        for _ in range(PROJECTION_STEPS if factored else 0):
            v = self.sums(s.sign * Z)
            v[s.n : s.n + s.p] = y
            self.multiply(np.zeros(s.n), v)
            r = self.Ctv + v[: s.n]
            if not largest(r) <= 0.5 * last:
                break
            best = y, Z
            last = largest(r)
            rhs[: s.n] = -r
            u = kkt.solve_once(rhs)
            self.multiply(u[: s.n], v)
            y = y + u[s.n : s.n + s.p]
            Z = np.maximum(Z + w * s.sign * self.t[s.place], 0.0)
        return [best if last < inf else (y, Z)]

    def project_ray(self, d: np.ndarray) -> list[tuple[np.ndarray]]:
        """Project d on P d = 0, A d = 0 and, for nearly active constraints, C d = 0.

        Constraints that the result violates are added for another projection. Returns
        all results, the last one first.
        """
        s, system = self.problem, self.system
        d = d / largest(d)
        active = self.change_of_constraints(d) > NEARLY_ACTIVE
        zero_y, zero, found = np.zeros(s.p), np.zeros(s.c.size), []
        for _ in range(RAY_PROJECTIONS):
            if not system.factor(d, zero_y, zero, active, zero_y, zero, PROJECTION):
                break
            system.iterate(np.zeros(s.n), PROJECTION_STEPS)
            better = system.x.copy()
            found.append((better,))
            more = active | (self.change_of_constraints(better) > VIOLATED)
            if np.array_equal(more, active):
                break
            active = more
        return found[::-1]

    def change_of_constraints(self, d: np.ndarray) -> np.ndarray:
        """Return sign * C d, positive where d violates a one-sided constraint."""
        self.multiply(d, np.zeros(self.problem.kkt.size))
        return self.problem.sign * self.t[self.problem.place]

    def sums(self, values: np.ndarray) -> np.ndarray:
        """Add up the values of the one-sided constraints that share a row of K."""
        place, size = self.problem.place, self.problem.kkt.size
        return np.bincount(place, values, minlength=size).astype(float, copy=False)

    def multiply(self, x: np.ndarray, v: np.ndarray) -> None:
        """Set Px, Ctv and t for scaled x and v."""
        products(*self.problem.kkt.triangle, x, v, self.Px, self.Ctv, self.t)


@kernel
def promising_ratios(
    indptr, indices, base, q, b, c, place, sign, x, y, Z, Px, Ctv, v, t, du, dZ,
    Pdx, Ctdv, dv, dt, ratios,
):  # fmt: skip
    """Set `ratios` (4,) to the relative residuals of candidates, inf if they fail.

    They are Farkas multipliers from the iterate and from the step (its Z cut at 0), a
    ray from the iterate and from the step. Pdx, Ctdv, dv and dt are overwritten.
    """
    n, p = x.size, y.size
    dv[:] = 0.0
    for i in range(p):
        dv[n + i] = du[n + i]
    for k in range(place.size):
        dv[place[k]] += sign[k] * max(dZ[k], 0.0)
    products(indptr, indices, base, du[:n], dv, Pdx, Ctdv, dt)
    size = 1.0
    for j in range(n):
        size = max(size, abs(x[j]))
    ratios[0] = farkas_ratio(b, c, y, Z, v, Ctv, size)
    ratios[1] = farkas_ratio(b, c, du[n : n + p], dZ, dv, Ctdv, size)
    ratios[2] = ray_ratio(q, x, Px, t, place, sign, p)
    ratios[3] = ray_ratio(q, du[:n], Pdx, dt, place, sign, p)


@part
def farkas_ratio(b, c, y, Z, v, Ctv, size):
    """Return min(|r| |x| / -value, |r| / |multipliers|), inf if value >= 0."""
    value, most = 0.0, 0.0
    for i in range(b.size):
        value += b[i] * y[i]
        most = max(most, abs(y[i]))
    for k in range(c.size):
        value += c[k] * max(Z[k], 0.0)
        most = max(most, Z[k])
    if not value < 0.0:
        return np.inf
    residual = 0.0
    for j in range(Ctv.size):
        residual = max(residual, abs(Ctv[j] + v[j]))
    return min(residual * size / -value, residual / most)


@part
def ray_ratio(q, d, Pd, t, place, sign, p):
    """Return max(|P d|, |A d|, (C d)+) / |d|, inf if q'd >= 0."""
    value, most, residual = 0.0, 0.0, 0.0
    for j in range(d.size):
        value += q[j] * d[j]
        most = max(most, abs(d[j]))
        residual = max(residual, abs(Pd[j]))
    if not value < 0.0:
        return np.inf
    for i in range(d.size, d.size + p):
        residual = max(residual, abs(t[i]))
    for k in range(place.size):
        residual = max(residual, sign[k] * t[place[k]])
    return residual / most
