"""Models that people write in CVXPY: portfolios, control, projections, LPs, traps.

As `statistics`: functions of sizes, data with a fixed seed, a list at the end.
"""

from typing import Any

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

from validation.problems.models.statistics import Model, least


def market(n: int, factors: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return expected returns, factor loadings and specific variances."""
    rng = np.random.default_rng(n + factors)
    loadings = 0.05 * rng.standard_normal((n, factors))
    specific = 0.01 * rng.random(n) ** 2 + 1e-4
    return 0.01 + 0.02 * rng.random(n), loadings, specific


def covariance(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return expected returns and a dense positive definite covariance."""
    mean, loadings, specific = market(n, max(2, n // 10))
    return mean, loadings @ loadings.T + np.diag(specific)


def trade_off(n: int) -> tuple[cp.Variable, Any]:
    """Return the weights of n assets, and twice the variance less the return."""
    mean, sigma = covariance(n)
    w = cp.Variable(n)
    return w, 2.0 * cp.quad_form(w, cp.psd_wrap(sigma)) - mean @ w


def markowitz(n: int) -> cp.Problem:
    """Long-only mean-variance portfolio."""
    w, cost = trade_off(n)
    return least(cost, cp.sum(w) == 1, w >= 0)


def markowitz_target(n: int) -> cp.Problem:
    """Least variance at a wanted return, at most 10 % (20 % if few) in each."""
    mean, sigma = covariance(n)
    w = cp.Variable(n)
    rows = [cp.sum(w) == 1, mean @ w >= 0.02, w >= 0, w <= max(0.1, 4.0 / n)]
    return least(cp.quad_form(w, cp.psd_wrap(sigma)), *rows)


def markowitz_sample(n: int) -> cp.Problem:
    """Largest utility; the covariance of n / 2 samples is singular."""
    samples = np.random.default_rng(n).standard_normal((n // 2, n)) * 0.05
    mean, _, _ = market(n, 2)
    w = cp.Variable(n)
    risk = cp.sum_squares(samples @ w) / samples.shape[0]
    rows = [cp.sum(w) == 1, w >= -0.1, w <= 0.3]
    return cp.Problem(cp.Maximize(mean @ w - 2.0 * risk), rows)


def turnover_cost(n: int) -> cp.Problem:
    """Mean-variance with costs proportional to trades."""
    (w, cost), held = trade_off(n), np.full(n, 1.0 / n)
    trade = 0.002 * cp.norm1(w - held)
    return least(cost + trade, cp.sum(w) == 1, w >= 0)


def turnover_limit(n: int) -> cp.Problem:
    """Mean-variance with limits on trades and on leverage."""
    (w, cost), held = trade_off(n), np.full(n, 1.0 / n)
    return least(cost, cp.sum(w) == 1, cp.norm1(w - held) <= 0.5, cp.norm1(w) <= 1.6)


def factor_model(n: int, factors: int) -> cp.Problem:
    """Mean-variance with a factor model and market neutrality."""
    mean, loadings, specific = market(n, factors)
    w, f = cp.Variable(n), cp.Variable(factors)
    risk = cp.sum_squares(f) + cp.sum_squares(cp.multiply(np.sqrt(specific), w))
    rows = [f == loadings.T @ w, cp.sum(w) == 1, w >= 0, f[0] == 0]
    return least(5.0 * risk - mean @ w, *rows)


def many_periods(n: int, periods: int) -> cp.Problem:
    """Trade over several periods with costs."""
    mean, loadings, specific = market(n, 5)
    w = cp.Variable((periods + 1, n))
    rows = [w[0] == 1.0 / n, cp.sum(w, axis=1) == 1, w >= 0]
    cost = 0
    for t in range(1, periods + 1):
        drift = mean * (1.0 + 0.5 * np.sin(t + np.arange(n)))
        risk = cp.sum_squares(loadings.T @ w[t])
        risk += cp.sum_squares(cp.multiply(np.sqrt(specific), w[t]))
        cost += 5.0 * risk - drift @ w[t] + 0.003 * cp.norm1(w[t] - w[t - 1])
    return least(cost, *rows)


def capital(n: int) -> cp.Problem:
    """Invest ten million in units of money: quantities of sizes 1e-3 to 1e7."""
    mean, sigma = covariance(n)
    amount, cash = cp.Variable(n), cp.Variable()
    limit = np.random.default_rng(n).choice([5e5, 2e6, 1e8], n)
    risk = 1e-7 * cp.quad_form(amount, cp.psd_wrap(sigma))
    rows = [cp.sum(amount) + cash == 1e7, amount >= 0, amount <= limit, cash >= 1e5]
    return cp.Problem(cp.Maximize(mean @ amount + 0.003 * cash - risk), rows)


def value_at_risk(n: int, samples: int) -> cp.Problem:
    """Least mean of the worst tenth of losses, an LP."""
    losses = -0.01 - 0.1 * np.random.default_rng(n).standard_normal((samples, n))
    w = cp.Variable(n)
    tail = cp.sum_largest(losses @ w, samples // 10) / (samples // 10)
    return least(tail, cp.sum(w) == 1, w >= 0)


def plant(nx: int, nu: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a barely unstable linear system and where it starts."""
    rng = np.random.default_rng(nx)
    A = np.eye(nx) + 0.1 * rng.standard_normal((nx, nx))
    A *= 1.02 / np.abs(np.linalg.eigvals(A)).max()
    return A, rng.standard_normal((nx, nu)) / nx, rng.standard_normal(nx)


def moves(nx: int, nu: int, steps: int, scale: float = 1.0) -> tuple[Any, Any, list]:
    """Return states and inputs of `plant` and its equations, from scale times start."""
    A, B, start = plant(nx, nu)
    x, u = cp.Variable((nx, steps + 1)), cp.Variable((nu, steps))
    return x, u, [x[:, 0] == scale * start, x[:, 1:] == A @ x[:, :-1] + B @ u]


def control(nx: int, nu: int, steps: int) -> cp.Problem:
    """Linear model-predictive control with bounds."""
    x, u, rows = moves(nx, nu, steps)
    rows += [cp.abs(u) <= 0.5, x <= 5.0]
    return least(cp.sum_squares(x) + 0.1 * cp.sum_squares(u), *rows)


def soft_control(nx: int, nu: int, steps: int) -> cp.Problem:
    """Control with an l1 penalty on violated bounds and on the input."""
    x, u, rows = moves(nx, nu, steps)
    rows += [cp.abs(u) <= 0.5]
    cost = cp.sum_squares(x[:, -1]) + 0.1 * cp.sum(cp.abs(u))
    return least(cost + 10.0 * cp.sum(cp.pos(cp.abs(x) - 0.5)), *rows)


def terminal_control(nx: int, nu: int, steps: int) -> cp.Problem:
    """Control to rest, least energy, bounded rates of the input."""
    x, u, rows = moves(nx, nu, steps, 0.2)
    rows += [x[:, -1] == 0, cp.abs(cp.diff(u, axis=1)) <= 2.0]
    return least(cp.sum_squares(u), *rows)


def big_m(n: int) -> cp.Problem:
    """Buy from suppliers, an LP with fixed costs relaxed by a big M of 1e5."""
    rng = np.random.default_rng(n)
    amount, used = cp.Variable(n), cp.Variable(n)
    rows = [amount >= 0, amount <= 1e5 * used, used >= 0, used <= 1]
    rows += [cp.sum(amount) >= 100.0 * n, amount <= 150.0 + 300.0 * rng.random(n)]
    return least((1.0 + rng.random(n)) @ amount + 1e3 * rng.random(n) @ used, *rows)


def storage(hours: int) -> cp.Problem:
    """Buy, store and sell energy, an LP with ties between prices."""
    price = np.round(np.sin(np.arange(hours) / 3.8) + 1.5, 1)
    c, d, s = cp.Variable(hours), cp.Variable(hours), cp.Variable(hours + 1)
    rows = [s[1:] == s[:-1] + 0.9 * c - d, s[0] == 2.0, s[-1] == 2.0, s >= 0, s <= 5]
    rows += [c >= 0, c <= 1, d >= 0, d <= 1]
    return cp.Problem(cp.Maximize(price @ (d - c)), rows)


def polytope(n: int, m: int) -> cp.Problem:
    """Project a point onto {x : A x <= b}."""
    rng = np.random.default_rng(n)
    A = rng.standard_normal((m, n))
    x, point = cp.Variable(n), 3.0 * rng.standard_normal(n)
    b = 0.5 + rng.random(m)
    return least(cp.sum_squares(x - point), A @ x <= b)


def simplex(n: int) -> cp.Problem:
    """Project a point onto the simplex."""
    x = cp.Variable(n)
    point = np.random.default_rng(n).standard_normal(n)
    return least(cp.sum_squares(x - point), cp.sum(x) == 1, x >= 0)


def l1_ball(n: int) -> cp.Problem:
    """Project a point onto the l1 ball."""
    x = cp.Variable(n)
    point = np.random.default_rng(n).standard_normal(n)
    return least(cp.sum_squares(x - point), cp.norm1(x) <= 1)


def birkhoff(n: int) -> cp.Problem:
    """Nearest doubly stochastic matrix; one equation is redundant."""
    X = cp.Variable((n, n), nonneg=True)
    C = np.random.default_rng(n).standard_normal((n, n))
    return least(cp.sum_squares(X - C), cp.sum(X, axis=0) == 1, cp.sum(X, axis=1) == 1)


def dependent_rows(n: int) -> cp.Problem:
    """Least norm under equations of which half are sums of the others."""
    rng = np.random.default_rng(n)
    A = rng.standard_normal((n // 4, n))
    A = np.vstack([A, rng.standard_normal((n // 4, n // 4)) @ A])
    x = cp.Variable(n)
    return least(cp.sum_squares(x), A @ x == A @ rng.random(n), x >= 0)


def lp_unique(n: int, m: int) -> cp.Problem:
    """Pose an LP with one solution, a nondegenerate vertex."""
    rng = np.random.default_rng(n)
    A, x = rng.standard_normal((m, n)), cp.Variable(n)
    c = -A.T @ np.where(np.arange(m) < n, 0.5 + rng.random(m), 0.0)
    slack = np.where(np.arange(m) < n, 0.0, 0.5 + rng.random(m))
    return least(c @ x, A @ x <= A @ rng.standard_normal(n) + slack)


def lp_face(n: int, m: int) -> cp.Problem:
    """Pose an LP whose solutions are a whole face."""
    rng = np.random.default_rng(n)
    A, x = rng.random((m, n)), cp.Variable(n)
    rows = [A @ x <= A.sum(axis=1) / 2.0, x >= 0, x <= 1, cp.sum(x) <= n / 4.0]
    return cp.Problem(cp.Maximize(cp.sum(x)), rows)


def assignment(n: int) -> cp.Problem:
    """Assign at least cost, an LP: degenerate, one equation redundant."""
    X = cp.Variable((n, n))
    cost = np.random.default_rng(n).random((n, n))
    rows = [cp.sum(X, axis=0) == 1, cp.sum(X, axis=1) == 1, X >= 0]
    return least(cp.sum(cp.multiply(cost, X)), *rows)


def transport(n: int, m: int) -> cp.Problem:
    """Transport LP with integer costs: many solutions."""
    rng = np.random.default_rng(n)
    X, cost = cp.Variable((n, m)), rng.integers(1, 6, (n, m))
    supply, demand = np.full(n, float(m)), np.full(m, float(n))
    rows = [cp.sum(X, axis=1) == supply, cp.sum(X, axis=0) == demand, X >= 0]
    return least(cp.sum(cp.multiply(cost, X)), *rows)


def shortest_path(n: int) -> cp.Problem:
    """Shortest path through an n x n grid as a flow LP."""
    index = np.arange(n * n).reshape(n, n)
    tails = np.r_[index[:, :-1].ravel(), index[:-1].ravel()]
    heads = np.r_[index[:, 1:].ravel(), index[1:].ravel()]
    edges = np.arange(tails.size)
    shape = (n * n, tails.size)
    D = sp.coo_array((np.ones(tails.size), (tails, edges)), shape=shape)
    D = sp.csr_array(D - sp.coo_array((np.ones(tails.size), (heads, edges)), shape))
    demand = np.zeros(n * n)
    demand[0], demand[-1] = 1.0, -1.0
    f = cp.Variable(tails.size)
    length = np.random.default_rng(n).integers(1, 10, tails.size)
    return least(length @ f, D @ f == demand, f >= 0)


def minimax(n: int, m: int) -> cp.Problem:
    """Smallest maximum of affine functions, in a box."""
    rng = np.random.default_rng(n)
    A, x = rng.standard_normal((m, n)), cp.Variable(n)
    return least(cp.max(A @ x + rng.standard_normal(m)), x >= -1, x <= 1)


def feasibility(n: int, m: int) -> cp.Problem:
    """Find any point of a polytope: no objective."""
    rng = np.random.default_rng(n)
    A, C = rng.standard_normal((m, n)), rng.standard_normal((n // 5, n))
    x = cp.Variable(n)
    inside = rng.standard_normal(n)
    return least(0, A @ x <= A @ inside + rng.random(m), C @ x == C @ inside)


def infinite_sides(n: int) -> cp.Problem:
    """Project onto rows of which some sides are infinite."""
    rng = np.random.default_rng(n)
    A, x = rng.standard_normal((n, n)), cp.Variable(n)
    upper = np.where(rng.random(n) < 0.5, np.inf, rng.random(n))
    lower = np.where(rng.random(n) < 0.5, -np.inf, -rng.random(n))
    cost = cp.sum_squares(x - 3.0 * rng.standard_normal(n))
    return least(cost, A @ x <= upper, x >= lower)


def infeasible_bounds(n: int) -> cp.Problem:
    """One bound contradicts another."""
    x = cp.Variable(n)
    upper = np.ones(n)
    upper[n // 2] = -1e-3
    return least(cp.sum_squares(x - 1), x >= 0, x <= upper)


def infeasible_rows(n: int, m: int) -> cp.Problem:
    """Pose rows of which a positive combination says 0 <= -0.01."""
    rng = np.random.default_rng(n)
    A, proof, x = rng.standard_normal((m, n)), rng.random(m), cp.Variable(n)
    A[-1] = -proof[:-1] @ A[:-1]
    b = rng.standard_normal(m)
    b[-1] = -proof[:-1] @ b[:-1] - 0.01
    return least(cp.norm1(x), A @ x <= b)


def infeasible_equations(n: int) -> cp.Problem:
    """Dependent equations that contradict each other."""
    rng = np.random.default_rng(n)
    A = rng.standard_normal((n // 4, n))
    A = np.vstack([A, A.sum(axis=0)])
    b = rng.standard_normal(n // 4)
    x = cp.Variable(n)
    return least(cp.sum_squares(x), A @ x == np.append(b, b.sum() + 0.1))


def infeasible_control(nx: int, nu: int, steps: int) -> cp.Problem:
    """Control to a state that bounded inputs cannot reach."""
    x, u, rows = moves(nx, nu, steps)
    rows += [cp.abs(u) <= 0.01, x[:, -1] == 10.0]
    return least(cp.sum_squares(u), *rows)


def infeasible_portfolio(n: int) -> cp.Problem:
    """Ask for a return that no long-only portfolio has."""
    mean, sigma = covariance(n)
    w = cp.Variable(n)
    rows = [cp.sum(w) == 1, w >= 0, mean @ w >= 1.01 * mean.max()]
    return least(cp.quad_form(w, cp.psd_wrap(sigma)), *rows)


def unbounded_lp(n: int, m: int) -> cp.Problem:
    """Pose an LP that falls along a ray."""
    rng = np.random.default_rng(n)
    ray, A, x = rng.random(n), rng.standard_normal((m, n)), cp.Variable(n)
    A -= np.outer(np.maximum(A @ ray, 0.0), ray) / (ray @ ray)
    return least(-ray @ x, A @ x <= 1, x >= -1)


def unbounded_qp(n: int) -> cp.Problem:
    """Pose a QP that falls where its matrix is singular."""
    rng = np.random.default_rng(n)
    F, x = rng.standard_normal((n // 2, n)), cp.Variable(n)
    return least(cp.sum_squares(F @ x) + rng.standard_normal(n) @ x, x[0] >= 0)


def unbounded_maximum(n: int) -> cp.Problem:
    """Let a portfolio borrow without limit."""
    mean, loadings, _ = market(n, 2)
    w = cp.Variable(n)
    risk = cp.sum_squares(loadings.T @ w)
    return cp.Problem(cp.Maximize(mean @ w - risk), [cp.sum(w) == 1])


def infeasible_both(n: int) -> cp.Problem:
    """Neither the problem nor its dual has a feasible point."""
    x = cp.Variable(n)
    return least(-cp.sum(x), x[0] - x[1] >= 1, x[1] - x[0] >= 1)


def nonconvex(n: int) -> cp.Problem:
    """Pose a matrix that only claims to be positive semidefinite."""
    rng = np.random.default_rng(n)
    F, x = rng.standard_normal((n, n)), cp.Variable(n)
    P = F @ F.T / n
    P -= (np.linalg.eigvalsh(P)[0] + 0.05) * np.eye(n)
    cost = cp.quad_form(x, cp.psd_wrap(P))
    return least(cost + cp.sum(x), x >= -1, x <= 1)


MODELS = {
    "markowitz": Model(markowitz, (20,), (500,)),
    "markowitz_target": Model(markowitz_target, (20,), (500,)),
    "markowitz_sample": Model(markowitz_sample, (20,), (500,)),
    "turnover_cost": Model(turnover_cost, (20,), (500,)),
    "turnover_limit": Model(turnover_limit, (20,), (500,)),
    "factor_model": Model(factor_model, (50, 5), (5000, 50)),
    "many_periods": Model(many_periods, (8, 3), (100, 10)),
    "capital": Model(capital, (20,), (400,)),
    "value_at_risk": Model(value_at_risk, (10, 50), (50, 1000)),
    "control": Model(control, (4, 2, 10), (12, 4, 100)),
    "control_soft": Model(soft_control, (4, 2, 10), (12, 4, 100)),
    "control_terminal": Model(terminal_control, (4, 2, 12), (12, 4, 100)),
    "big_m": Model(big_m, (20,), (3000,)),
    "storage": Model(storage, (24,), (2000,)),
    "polytope": Model(polytope, (10, 30), (200, 2000)),
    "simplex": Model(simplex, (20,), (10_000,)),
    "l1_ball": Model(l1_ball, (20,), (5000,)),
    "birkhoff": Model(birkhoff, (6,), (60,)),
    "dependent_rows": Model(dependent_rows, (20,), (600,)),
    "lp_unique": Model(lp_unique, (10, 30), (200, 1000)),
    "lp_face": Model(lp_face, (10, 8), (500, 200)),
    "assignment": Model(assignment, (6,), (60,)),
    "transport": Model(transport, (5, 7), (60, 80)),
    "shortest_path": Model(shortest_path, (6,), (60,)),
    "minimax": Model(minimax, (8, 30), (100, 1000)),
    "feasibility": Model(feasibility, (10, 30), (300, 1000)),
    "infinite_sides": Model(infinite_sides, (20,), (500,)),
    "infeasible_bounds": Model(infeasible_bounds, (10,), (10_000,), "infeasible"),
    "infeasible_rows": Model(infeasible_rows, (8, 20), (100, 500), "infeasible"),
    "infeasible_equations": Model(infeasible_equations, (20,), (600,), "infeasible"),
    "infeasible_control": Model(
        infeasible_control, (4, 2, 10), (12, 4, 100), "infeasible"
    ),
    "infeasible_portfolio": Model(infeasible_portfolio, (20,), (500,), "infeasible"),
    "infeasible_both": Model(infeasible_both, (2,), (1000,), "infeasible"),
    "unbounded_lp": Model(unbounded_lp, (10, 20), (300, 600), "unbounded"),
    "unbounded_qp": Model(unbounded_qp, (10,), (500,), "unbounded"),
    "unbounded_maximum": Model(unbounded_maximum, (10,), (2000,), "unbounded"),
    "nonconvex": Model(nonconvex, (10,), (500,), "refused"),
}
