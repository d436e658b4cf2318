"""The exact finish: guess the active pieces, solve for them, mend the guess.

With the active pieces A = {Z > W} as equations and the others left out,

    [P  A'  G_a'] [x]   [-q ]
    [A          ] [y] = [b  ]      (variables at an active bound held there)
    [G_a        ] [v]   [c_a]

is solved with the factors of its regularised form (diagonal + 1e-9, -1e-9: proximal
iterations, which converge for dependent active rows too). The next guess keeps the
active pieces with Z >= 0 and adds the violated ones: a primal-dual active set method.
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.limits import Deadline
from namlcp.qp.judge import Judge
from namlcp.qp.kkt import products
from namlcp.qp.transforms import ScaledQP

REGULAR = 1e-9, 1e-7  # the second where LDL' of the first breaks down (singular faces)
OFF = 1e20  # diagonal that switches a row or variable off
PASSES = 25
EXACT = 1e-14
NOISE = 1e-11  # residuals below are good enough to start with
WRONG = 1e-12  # a multiplier or slack below minus this is wrong
LARGE = 5_000  # entries of K above which a round must pay
DROP = 0.1, 1e-3  # of the worst residual between two finishes, for small and large K
STEADY = 100.0  # worst residual above which a finish waits for a steady active set


class Trigger:
    """When a finish can pay: near enough, better than last time, and a steady set."""

    def __init__(self, tol: float, is_large: bool) -> None:
        """Residuals come in units of `tol`."""
        self.tol, self.drop = tol, DROP[is_large]
        self.last = np.inf

    def pulled(
        self, worst: float, mu: float, active: np.ndarray, before: np.ndarray
    ) -> bool:
        """Decide, and remember the residual of the attempt."""
        near = self.tol * worst < 1e-2 or mu < 1e-7
        if not near or not worst <= self.drop * self.last:
            return False
        if worst >= STEADY and not np.array_equal(active, before):
            return False
        self.last = worst
        return True


class Finish:
    """Exact active-set rounds on a scaled problem; the factors of K are overwritten."""

    def __init__(self, problem: ScaledQP, judge: Judge, deadline: Deadline) -> None:
        """Allocate."""
        self.problem, self.judge, self.deadline = problem, judge, deadline
        self.face = Face(problem)

    def run(
        self,
        x: np.ndarray,
        y: np.ndarray,
        Z: np.ndarray,
        active: np.ndarray,
        rounds: int,
        good: float,
    ) -> float:
        """Try up to `rounds` sets, the first one given; return the best judgement.

        Stops at a judgement <= good, at a set seen just before, or, with a large K,
        at a round that does not halve the best one.
        """
        s = self.problem
        best = np.inf
        for _ in range(rounds):
            for regular in REGULAR:
                ready = self.face.factor(x, y, Z, active, s.b, s.c, regular)
                if ready and self.face.iterate(s.q, PASSES):
                    break
            if not ready:
                return best
            x, y, multiplier, slack = self.face.solution(s.q, s.c, active)
            Z = np.maximum(multiplier, 0.0)
            worst = self.judge.offer(s.point(x, y, Z))
            pays = worst <= 0.5 * best or s.kkt.base.size <= LARGE
            best = min(best, worst)
            new = np.where(active, multiplier > -WRONG, slack < -WRONG)
            if best <= good or not pays or np.array_equal(new, active):
                break
            if self.deadline.reached():
                break
            active = new
        return best


class Face:
    """min 1/2 x'Px + q'x, Ax = b, active pieces as equations: one factorisation."""

    def __init__(self, problem: ScaledQP) -> None:
        """Allocate for the problem's K."""
        self.problem = problem
        size, n = problem.kkt.size, problem.n
        self.x = np.empty(n)
        self.v, self.t, self.rhs, self.goal = np.empty((4, size))
        self.Px, self.Ctv = np.empty((2, n))
        self.held = np.empty(size, dtype=np.bool_)

    def factor(
        self,
        x: np.ndarray,
        y: np.ndarray,
        Z: np.ndarray,
        active: np.ndarray,
        b: np.ndarray,
        c: np.ndarray,
        regular: float,
    ) -> bool:
        """Factor for the active set and start at (x, y, Z); False if that fails."""
        s, kkt = self.problem, self.problem.kkt
        self.x[:] = x
        hold_active(
            kkt.base, kkt.diagonal, s.n, s.p, s.place, s.sign, c, active, Z, y, b,
            regular, self.x, self.held, self.goal, self.v, kkt.data,
        )  # fmt: skip
        return kkt.factor()

    def iterate(self, q: np.ndarray, passes: int) -> bool:
        """Correct until the unscaled residual is 1e-14 or fails twice to halve.

        Leaves the best point in x and v; tells whether it is any better than the start.
        """
        s, kkt = self.problem, self.problem.kkt
        first = best = np.inf
        failures = 0
        kept = self.x.copy(), self.v.copy()
        for _ in range(passes):
            error = face_residual(
                kkt.indptr, kkt.indices, kkt.base, s.unit, q, self.goal, self.held,
                self.x, self.v, self.Px, self.Ctv, self.t, self.rhs,
            )  # fmt: skip
            first = max(error, NOISE) if first == np.inf else first
            failures = 0 if error < 0.5 * best else failures + 1
            if error < best:
                kept = self.x.copy(), self.v.copy()
                best = error
            if error <= EXACT or failures == 2 or not np.isfinite(error):
                break
            du = kkt.solve_once(self.rhs)
            du[self.held] = 0.0
            self.x += du[: s.n]
            self.v[s.n :] += du[s.n :]
        self.x, self.v = kept
        return bool(best <= 0.1 * first)

    def solution(
        self, q: np.ndarray, c: np.ndarray, active: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return x, y, the pieces' multipliers (0 if inactive) and slacks c - Cx."""
        s, kkt = self.problem, self.problem.kkt
        multiplier, slack = np.empty((2, c.size))
        piece_values(
            kkt.indptr, kkt.indices, kkt.base, q, s.place, s.sign, c, active, self.x,
            self.v, self.Px, self.Ctv, self.t, multiplier, slack,
        )  # fmt: skip
        return self.x.copy(), self.v[s.n : s.n + s.p].copy(), multiplier, slack


@kernel
def hold_active(
    base, diagonal, n, p, place, sign, c, active, Z, y, b, regular, x, held, goal, v,
    data,
):  # fmt: skip
    """Set the diagonal, put x on its active bounds and v on y and the active rows' Z.

    `held` marks what does not move: variables at active bounds and inactive rows;
    `goal` is the right-hand side of the rows that count.
    """
    held[:n] = False
    held[n : n + p] = False
    held[n + p :] = True
    v[:] = 0.0
    for i in range(p):
        v[n + i] = y[i]
        goal[n + i] = b[i]
    for k in range(place.size):
        if active[k]:
            j = place[k]
            held[j] = j < n
            goal[j] = sign[k] * c[k]
            if j < n:
                x[j] = goal[j]
            else:
                v[j] = sign[k] * Z[k]
    for j in range(n):
        data[diagonal[j]] = OFF if held[j] else base[diagonal[j]] + regular
    for j in range(n, held.size):
        data[diagonal[j]] = -OFF if held[j] else -regular


@kernel
def face_residual(indptr, indices, base, unit, q, goal, held, x, v, Px, Ctv, t, rhs):
    """Set rhs = minus the residual of the face problem; return its unscaled size."""
    n = x.size
    products(indptr, indices, base, n, x, v, Px, Ctv, t)
    worst = 0.0
    for j in range(held.size):
        rhs[j] = 0.0
        if not held[j]:
            if j < n:
                rhs[j] = -(Px[j] + q[j] + Ctv[j])
                size = abs(rhs[j]) / unit[j]
            else:
                rhs[j] = goal[j] - t[j]
                size = abs(rhs[j]) * unit[j]
            if not size <= worst:
                worst = size
    return worst


@kernel
def piece_values(
    indptr, indices, base, q, place, sign, c, active, x, v, Px, Ctv, t, multiplier,
    slack,
):  # fmt: skip
    """Set the multiplier of every piece (bounds: from stationarity) and its slack."""
    n = x.size
    products(indptr, indices, base, n, x, v, Px, Ctv, t)
    for k in range(place.size):
        j = place[k]
        multiplier[k] = 0.0
        if active[k]:
            gradient = v[j] if j >= n else -(Px[j] + q[j] + Ctv[j])
            multiplier[k] = sign[k] * gradient
        slack[k] = c[k] - sign[k] * t[j]
