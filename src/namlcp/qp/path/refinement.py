"""Active-set refinement: guess the active constraints, solve, correct the guess.

With the active one-sided constraints, at first those with Z > W, as equations and
without the others,

    [P  A'  G_a'] [x]   [-q ]
    [A          ] [y] = [b  ]      (variables at an active bound held there)
    [G_a        ] [v]   [c_a]

is solved by proximal iterations with the factors of its regularised matrix, which
converge for dependent active rows too. The next guess keeps the active constraints with
multipliers >= 0 and adds the violated ones: a primal-dual active-set method
(Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865-888).
"""

import numpy as np

from namlcp.compiled import kernel
from namlcp.limits import Deadline
from namlcp.qp.judge import Judge
from namlcp.qp.kkt import products
from namlcp.qp.transforms import ScaledQP

# Active sets tried by one refinement at most, and the residual over its tolerance, on
# unscaled data, up to which no other set is tried.
MOST_SETS, GOOD_ENOUGH = 6, 1e-2
# Added to the diagonal of P, and subtracted for rows. The second is tried where L D L'
# breaks down with the first, or where the iterations do not reduce the residual
# tenfold: the KKT system of the active set is singular then.
REGULARISATIONS = 1e-9, 1e-7
# Modulus of a diagonal entry of K~ that fixes a variable or drops a row.
OFF = 1e20
# Proximal iterations at most, and the unscaled residual that ends them.
PROXIMAL_STEPS, RESIDUAL_GOAL = 25, 1e-14
# A first residual below this counts as this in the demand for a tenfold reduction.
SMALL_ENOUGH = 1e-11
# A scaled multiplier or slack below minus this has the wrong sign.
WRONG_SIGN = 1e-12
# A K with more entries is large: a round that does not halve the residual is the last.
LARGE_KKT = 5_000
# The worst residual has to fall to this part of that at the last refinement before the
# next one, for small and for large K.
DROP = 0.1, 1e-3
# Worst residual over its tolerance from which on a refinement needs an active set that
# did not change in the last iteration.
STEADY = 100.0
# Refinement needs a worst residual, or a mean of W Z, below these.
NEAR, NEAR_MU = 1e-2, 1e-7


class RefinementTiming:
    """Decides when to refine: see DROP, STEADY and NEAR. Residuals are over `tol`."""

    def __init__(self, tol: float, is_large: bool) -> None:
        self.tol, self.drop = tol, DROP[is_large]
        self.last = np.inf

    def is_due(
        self, worst: float, mu: float, active: np.ndarray, before: np.ndarray
    ) -> bool:
        """Tell whether to refine now, and remember the residual if so."""
        near = self.tol * worst < NEAR or mu < NEAR_MU
        if not near or not worst <= self.drop * self.last:
            return False
        if worst >= STEADY and not np.array_equal(active, before):
            return False
        self.last = worst
        return True


class Refinement:
    """Rounds of the active-set method on a scaled problem; overwrites the factors."""

    def __init__(self, problem: ScaledQP, judge: Judge, deadline: Deadline) -> None:
        self.problem, self.judge, self.deadline = problem, judge, deadline
        self.system = ActiveSetSystem(problem)

    def run(
        self, x: np.ndarray, y: np.ndarray, Z: np.ndarray, active: np.ndarray
    ) -> None:
        """Try active sets, the given one first; offer every point found to the judge.

        Ends with a residual over its tolerance of GOOD_ENOUGH, where the set does not
        change, or, with a large K, where that ratio is not halved.
        """
        s, system = self.problem, self.system
        best = np.inf
        for _ in range(MOST_SETS):
            for regularisation in REGULARISATIONS:
                ready = system.factor(x, y, Z, active, s.b, s.c, regularisation)
                if ready and system.iterate(s.q, PROXIMAL_STEPS):
                    break
            if not ready:
                return
            x, y, multiplier, slack = system.solution(s.q, s.c, active)
            Z = np.maximum(multiplier, 0.0)
            worst = self.judge.offer(s.point(x, y, Z))
            pays = worst <= 0.5 * best or s.kkt.base.size <= LARGE_KKT
            best = min(best, worst)
            new = np.where(active, multiplier > -WRONG_SIGN, slack < -WRONG_SIGN)
            if best <= GOOD_ENOUGH or not pays or np.array_equal(new, active):
                return
            if self.deadline.reached():
                return
            active = new


class ActiveSetSystem:
    """The KKT system of min 1/2 x'Px + q'x with the active constraints.

    `x` and `v` hold its solution, v in the layout of K: 0, y, net z.
    """

    def __init__(self, problem: ScaledQP) -> None:
        self.problem = problem
        size, n = problem.kkt.size, problem.n
        self.x = np.empty(n)
        self.v, self.t, self.rhs, self.goal = np.empty((4, size))
        self.Px, self.Ctv = np.empty((2, n))
        self.held = np.empty(size, dtype=np.bool_)

    def factor(
        self, x: np.ndarray, y: np.ndarray, Z: np.ndarray, active: np.ndarray,
        b: np.ndarray, c: np.ndarray, regularisation: float,
    ) -> bool:  # fmt: skip
        """Factor for the active set and start at (x, y, Z); False if that fails."""
        s, kkt = self.problem, self.problem.kkt
        self.x[:] = x
        hold_active(
            kkt.base, kkt.diagonal, s.n, s.p, s.place, s.sign, c, active, Z, y, b,
            regularisation, self.x, self.held, self.goal, self.v, kkt.data,
        )  # fmt: skip
        return kkt.factor()

    def iterate(self, q: np.ndarray, passes: int) -> bool:
        """Correct x and v until the unscaled residual is rounding or twice not halved.

        Leaves the best point in x and v; tells whether the residual fell tenfold, or
        below a tenth of SMALL_ENOUGH.
        """
        s, kkt = self.problem, self.problem.kkt
        first = best = np.inf
        failures = 0
        kept = self.x.copy(), self.v.copy()
        for _ in range(passes):
            error = active_set_residual(
                *kkt.triangle, s.unit, q, self.goal, self.held, self.x, self.v, self.Px,
                self.Ctv, self.t, self.rhs,
            )  # fmt: skip
            first = max(error, SMALL_ENOUGH) if first == np.inf else first
            failures = 0 if error < 0.5 * best else failures + 1
            if error < best:
                kept = self.x.copy(), self.v.copy()
                best = error
            if error <= RESIDUAL_GOAL or failures == 2 or not np.isfinite(error):
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
        """Return x, y and what `multipliers_and_slacks` sets."""
        s, kkt = self.problem, self.problem.kkt
        multiplier, slack = np.empty((2, c.size))
        multipliers_and_slacks(
            *kkt.triangle, q, s.place, s.sign, c, active, self.x, self.v, self.Px,
            self.Ctv, self.t, multiplier, slack,
        )  # fmt: skip
        return self.x.copy(), self.v[s.n : s.n + s.p].copy(), multiplier, slack


@kernel
def hold_active(
    base, diagonal, n, p, place, sign, c, active, Z, y, b, regularisation, x, held,
    goal, v, data,
):  # fmt: skip
    """Set the diagonal in `data`, x on its active bounds, v to y and active rows' Z.

    `held` (size,) is set to True for variables at active bounds and inactive rows,
    `goal` (size,) to the right-hand side of the equations.
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
        data[diagonal[j]] = OFF if held[j] else base[diagonal[j]] + regularisation
    for j in range(n, held.size):
        data[diagonal[j]] = -OFF if held[j] else -regularisation


@kernel
def active_set_residual(
    indptr, indices, base, unit, q, goal, held, x, v, Px, Ctv, t, rhs
):
    """Set rhs to minus the residual of the system; return its unscaled max norm.

    Px, Ctv (n,) and t (size,) are overwritten by the products with x and v.
    """
    n = x.size
    products(indptr, indices, base, x, v, Px, Ctv, t)
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
def multipliers_and_slacks(
    indptr, indices, base, q, place, sign, c, active, x, v, Px, Ctv, t, multiplier,
    slack,
):  # fmt: skip
    """Set multiplier, 0 if inactive, by stationarity for bounds, and slack = c - Cx.

    Px, Ctv (n,) and t (size,) are overwritten by the products with x and v.
    """
    n = x.size
    products(indptr, indices, base, x, v, Px, Ctv, t)
    for k in range(place.size):
        j = place[k]
        multiplier[k] = 0.0
        if active[k]:
            gradient = v[j] if j >= n else -(Px[j] + q[j] + Ctv[j])
            multiplier[k] = sign[k] * gradient
        slack[k] = c[k] - sign[k] * t[j]
