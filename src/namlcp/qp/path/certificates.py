"""Candidates for certificates that the path meets on its way, tested and projected."""

from math import inf
from typing import TYPE_CHECKING

import numpy as np

from namlcp.compiled import kernel, part
from namlcp.qp.certificates import accept_dual, accept_primal, largest
from namlcp.qp.guess import Guess
from namlcp.qp.judge import Judge
from namlcp.qp.kkt import products
from namlcp.qp.path.finish import Face
from namlcp.qp.problem import Point
from namlcp.qp.transforms import Contradiction, Presolved, ScaledQP
from namlcp.status import Status

if TYPE_CHECKING:
    from namlcp.qp.path.loop import Interior

FAST = 0.1  # a residual that falls below this part of the last one is no obstacle


PROMISING = 0.1  # relative residual of a candidate worth a test


PROJECTION = 1e-8  # weight of the distance in the polish


PASSES = 15


def contradiction(
    judge: Judge, small: Presolved, reason: Contradiction
) -> Point | None:
    """Return the proof of what presolve found, NaN where no multipliers can say it."""
    qp = judge.qp
    n, m, p = qp.q.size, qp.h.size, qp.b.size
    if reason.y is None:
        x, y, z = (np.full(k, np.nan) for k in (n, p, m))
        return Point(x, y, z, x)
    z = np.zeros(m) if reason.z is None else reason.z
    x = small.with_fixed(np.zeros(small.q.size))
    return accept_primal(qp, x, reason.y, z, judge.limits.eps_abs)


class LoopTests:
    """The tests of every iteration: cheap ratios first, polish where they promise."""

    def __init__(self, problem: ScaledQP, judge: Judge) -> None:
        """Allocate."""
        self.problem, self.judge = problem, judge
        self.proof: Point | None = None
        self.before = 0.0, 0.0
        self.promised = False  # some candidate was worth a test
        self.polished = np.full(4, PROMISING)  # ratio at which to polish again
        self.ratios = np.empty(4)
        self.face = Face(problem)
        n, size = problem.n, problem.kkt.size
        self.Px, self.Ctv = np.empty((2, n))
        self.v, self.t = np.empty((2, size))

    def decide(self, loop: "Interior") -> Status | None:
        """Return a verdict with `proof` set, or None.

        Candidates: iterate and step for either kind. No test where the residual that
        a proof would forbid to vanish is small, or ten times less than before.
        """
        s, kkt = self.problem, self.problem.kkt
        now = loop.norms[1], max(loop.norms[2:4])
        stuck = [new > FAST * old for new, old in zip(now, self.before, strict=True)]
        self.before = now
        eps = self.judge.limits.eps_abs
        dual = stuck[0] and loop.norms[6] > eps
        primal = stuck[1] and loop.norms[5] > eps
        if not (primal or dual):
            return None
        promising_ratios(
            kkt.indptr, kkt.indices, kkt.base, s.q, s.b, s.c, s.place, s.sign, loop.x,
            loop.y, loop.Z, loop.Px, loop.Ctv, loop.v, loop.t, loop.du, loop.dZ,
            self.Px, self.Ctv, self.v, self.t, self.ratios,
        )  # fmt: skip
        self.promised = self.promised or bool((self.ratios <= PROMISING).any())
        step_y, step_Z = loop.du[s.n : s.n + s.p], np.maximum(loop.dZ, 0.0)
        if primal:
            for k, y, Z in ((0, loop.y, loop.Z), (1, step_y, step_Z)):
                if self.ratios[k] <= PROMISING and self.primal(loop, k, y, Z):
                    return Status.PRIMAL_INFEASIBLE
        if dual:
            for k, d in ((2, loop.x), (3, loop.du[: s.n])):
                if self.ratios[k] <= PROMISING and self.dual(loop, k, d):
                    return Status.DUAL_INFEASIBLE
        return None

    def due(self, k: int) -> bool:
        """Tell whether candidate k improved enough for another polish."""
        if self.ratios[k] > 0.1 * self.polished[k]:
            return False
        self.polished[k] = self.ratios[k]
        return True

    def primal(self, loop: "Interior", k: int, y: np.ndarray, Z: np.ndarray) -> bool:
        """Test (y, Z), then its projection on the Farkas system."""
        s = self.problem
        tol = self.judge.limits.eps_abs
        x = s.small.with_fixed(loop.x * s.unit[: s.n])
        self.proof = accept_primal(self.judge.qp, x, *s.certificate(y, Z), tol)
        if self.proof is None and self.due(k):
            y, Z = self.polish_primal(y, Z)
            self.proof = accept_primal(self.judge.qp, x, *s.certificate(y, Z), tol)
        return self.proof is not None

    def project(self, x: np.ndarray, y: np.ndarray, z: np.ndarray) -> Point | None:
        """Test the user's multipliers of the rows after their projection."""
        s, qp = self.problem, self.judge.qp
        if not largest(y) + largest(z) > 0.0:
            return None
        z_box = -(qp.G.T @ z + qp.A.T @ y)
        active = np.zeros(z.size + 2 * z_box.size, dtype=np.int8)
        _, y, Z, _ = s.guess(Guess(x, y, z, z_box, active))
        y, Z = self.polish_primal(y, Z)
        return accept_primal(qp, x, *s.certificate(y, Z), self.judge.limits.eps_abs)

    def dual(self, loop: "Interior", k: int, d: np.ndarray) -> bool:
        """Test d, then its projection on the recession cone."""
        s, tol = self.problem, self.judge.limits.eps_abs
        x, y, z, _ = s.point(loop.x, loop.y, loop.Z)
        self.proof = accept_dual(self.judge.qp, x, y, z, s.ray(d), tol)
        if self.proof is None and self.due(k):
            for better in self.polish_dual(d):
                step = s.ray(better)
                self.proof = accept_dual(self.judge.qp, x, y, z, step, tol)
                if self.proof is not None:
                    break
        return self.proof is not None

    def polish_primal(
        self, y: np.ndarray, Z: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Project on the Farkas system, in the metric of w = sqrt(Z).

        min |A'(y + dy) + C'(Z + dZ)|^2/(2 eps) + |dy|^2/2 + sum dZ^2/(2 w), repeated.
        """
        s, kkt = self.problem, self.problem.kkt
        size = max(largest(y), largest(Z))
        y, Z = y / size, Z / size
        w = np.sqrt(Z)
        weight = np.bincount(s.place, w, minlength=kkt.size)
        kkt.data[:] = kkt.base
        kkt.data[: kkt.indptr[s.n]] = 0.0
        diagonal = np.full(kkt.size, -1.0)
        diagonal[: s.n] = PROJECTION + weight[: s.n]
        row = slice(s.n + s.p, None)
        diagonal[row] = -1.0 / np.maximum(weight[row], 1e-20)
        kkt.data[kkt.diagonal] = diagonal
        factored = kkt.factor()
        kkt.data[:] = kkt.base
        last, rhs = inf, np.zeros(kkt.size)
        for _ in range(PASSES if factored else 0):
            v = np.bincount(s.place, s.sign * Z, minlength=kkt.size)
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
        return best if last < inf else (y, Z)

    def polish_dual(self, d: np.ndarray) -> list[np.ndarray]:
        """Project d on P d = 0, A d = 0 and the pieces that d does not leave."""
        s = self.problem
        d = d / largest(d)
        self.multiply(d, np.zeros(s.kkt.size))
        active = s.sign * self.t[s.place] > -1e-3
        zero_y, zero, found = np.zeros(s.p), np.zeros(s.c.size), []
        for _ in range(3):
            if not self.face.factor(d, zero_y, zero, active, zero_y, zero, PROJECTION):
                break
            self.face.iterate(np.zeros(s.n), PASSES)
            better = self.face.x.copy()
            found.append(better)
            self.multiply(better, np.zeros(s.kkt.size))
            more = active | (s.sign * self.t[s.place] > 1e-13)
            if np.array_equal(more, active):
                break
            active = more
        return found[::-1]

    def multiply(self, x: np.ndarray, v: np.ndarray) -> None:
        """Set Px, Ctv and t for scaled x and v."""
        kkt = self.problem.kkt
        products(
            kkt.indptr, kkt.indices, kkt.base, self.problem.n, x, v, self.Px, self.Ctv,
            self.t,
        )  # fmt: skip


@kernel
def promising_ratios(
    indptr, indices, base, q, b, c, place, sign, x, y, Z, Px, Ctv, v, t, du, dZ,
    Pdx, Ctdv, dv, dt, ratios,
):  # fmt: skip
    """Set the relative residuals of four candidates, inf where they prove nothing.

    Farkas from the iterate and from the step (its Z cut at 0); a ray from the iterate
    and from the step. Pdx, Ctdv, dv and dt are work arrays.
    """
    n = x.size
    p = y.size
    dv[:] = 0.0
    for i in range(p):
        dv[n + i] = du[n + i]
    for k in range(place.size):
        dv[place[k]] += sign[k] * max(dZ[k], 0.0)
    products(indptr, indices, base, n, du[:n], dv, Pdx, Ctdv, dt)
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
    value = 0.0
    most = 0.0
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
    value = 0.0
    most = 0.0
    residual = 0.0
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
