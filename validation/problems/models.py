"""What people model in CVXPY: fits, portfolios, control, projections, LPs, traps.

A fit is a function of w, X and y, a portfolio one of its weights, mean and risk,
control one of states and inputs, the others of x, a number of rows m and a generator of
random numbers; each returns the cost and the constraints.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import cvxpy as cp
import numpy as np
import scipy.sparse as sp

Rng = np.random.Generator
square = cp.sum_squares
Terms = tuple[Any, ...]
Size = tuple[int, ...]
Data = tuple[Any, np.ndarray]


class Model(NamedTuple):
    """A function that makes a problem, its small and its large size.

    `expected` is the status that is right: "optimal", "infeasible", "unbounded", or
    "refused" where P is not positive semidefinite.
    """

    make: Callable[..., cp.Problem]
    small: Size
    large: Size
    expected: str = "optimal"


def least(terms: Any, *constraints: Any) -> cp.Problem:
    """Return the problem of a cost, or a tuple of it and constraints, and of others."""
    cost, *rows = terms if isinstance(terms, tuple) else (terms,)
    return cp.Problem(cp.Minimize(cost), [*rows, *constraints])


# ---- fits: data, and what is made of them


def regression(m: int, n: int, noise: float = 0.3) -> Data:
    rng = np.random.default_rng(m + n)
    X = rng.standard_normal((m, n))
    truth = np.where(rng.random(n) < 0.3, rng.standard_normal(n), 0.0)
    return X, X @ truth + noise * rng.standard_normal(m)


def outliers(m: int, n: int) -> Data:
    X, y = regression(m, n)
    rng = np.random.default_rng(m)
    return X, y + np.where(rng.random(m) < 0.1, 10.0 * rng.standard_normal(m), 0.0)


def classes(m: int, n: int) -> Data:
    """Return two overlapping clouds of points and their labels -1, +1."""
    rng = np.random.default_rng(m + 7 * n)
    labels = np.where(np.arange(m) % 2 == 0, 1.0, -1.0)
    shift = np.outer(labels, rng.standard_normal(n)) / np.sqrt(n)
    return rng.standard_normal((m, n)) + shift, labels


def local(m: int, n: int) -> Data:
    """Return a sparse matrix whose rows have five entries near each other, and y."""
    rng = np.random.default_rng(m)
    start = np.sort(rng.integers(0, n - 8, m))
    near = rng.permuted(np.tile(np.arange(8), (m, 1)), axis=1)[:, :5]
    place = np.repeat(np.arange(m), 5), (start[:, None] + near).ravel()
    X = sp.coo_array((rng.standard_normal(5 * m), place), (m, n)) + sp.eye_array(m, n)
    return sp.csr_array(X), rng.standard_normal(m)


def scattered(m: int, n: int) -> Data:
    """Return a sparse matrix without structure, whose factors fill, and y."""
    rng = np.random.default_rng(3)
    X = sp.random_array((m, n), density=4.0 / n, rng=rng) + sp.eye_array(m, n)
    return sp.csr_array(X), rng.standard_normal(m)


def scaled(m: int, n: int) -> Data:
    """Return `regression` with columns of lengths from 1e-3 to 1e3."""
    X, y = regression(m, n)
    return X * np.logspace(-3.0, 3.0, n), y


def collinear(m: int, n: int) -> Data:
    X, y = regression(m, n)
    return np.hstack((X, X, np.ones((m, 1)))), y


def l1(w: Any, X: np.ndarray, y: np.ndarray) -> Any:
    """Return an l1 penalty times that from which on w = 0."""
    return 2.0 * np.abs(X.T @ y).max() * cp.norm1(w)


def hinge(w: Any, X: np.ndarray, labels: np.ndarray) -> Any:
    return cp.sum(cp.pos(1 - cp.multiply(labels, X @ w + cp.Variable())))


def lasso(fraction: float) -> Callable[..., Any]:
    return lambda w, X, y: square(X @ w - y) + fraction * l1(w, X, y)


def plain(w: Any, X: Any, y: np.ndarray) -> Any:
    return square(X @ w - y)


def nonnegative(w: Any, X: Any, y: np.ndarray) -> Terms:
    return square(X @ w - y), w >= 0


def fit(terms: Any, data: Callable[[int, int], Data], *sizes: Size) -> Model:
    def make(m: int, n: int) -> cp.Problem:
        X, y = data(m, n)
        return least(terms(cp.Variable(X.shape[1]), X, y))

    return Model(make, *sizes)


# ---- portfolios


def market(n: int, factors: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(n + factors)
    loadings = 0.05 * rng.standard_normal((n, factors))
    specific = 0.01 * rng.random(n) ** 2 + 1e-4
    return 0.01 + 0.02 * rng.random(n), loadings, specific


def portfolio(terms: Any, expected: str = "optimal") -> Model:
    def make(n: int) -> cp.Problem:
        mean, loadings, specific = market(n, max(2, n // 10))
        w = cp.Variable(n)
        sigma = loadings @ loadings.T + np.diag(specific)
        return least(terms(w, mean, cp.quad_form(w, cp.psd_wrap(sigma))))

    return Model(make, (20,), (500,), expected)


def capital(w: Any, mean: np.ndarray, risk: Any) -> Terms:
    """Invest ten million in units of money: quantities of sizes 1e-3 to 1e7."""
    cash = cp.Variable()
    limit = np.random.default_rng(w.size).choice([5e5, 2e6, 1e8], w.size)
    rows = cp.sum(w) + cash == 1e7, w >= 0, w <= limit, cash >= 1e5
    return 1e-7 * risk - mean @ w - 0.003 * cash, *rows


LONG: Callable[[Any], Terms] = lambda w: (cp.sum(w) == 1, w >= 0)  # noqa: E731


def factor_model(n: int, factors: int) -> cp.Problem:
    mean, loadings, specific = market(n, factors)
    w, f = cp.Variable(n), cp.Variable(factors)
    risk = square(f) + square(cp.multiply(np.sqrt(specific), w))
    return least(5.0 * risk - mean @ w, f == loadings.T @ w, *LONG(w), f[0] == 0)


def many_periods(n: int, periods: int) -> cp.Problem:
    mean, loadings, specific = market(n, 5)
    w, cost = cp.Variable((periods + 1, n)), 0
    for t in range(1, periods + 1):
        drift = mean * (1.0 + 0.5 * np.sin(t + np.arange(n)))
        risk = square(loadings.T @ w[t]) + square(cp.multiply(np.sqrt(specific), w[t]))
        cost += 5.0 * risk - drift @ w[t] + 0.003 * cp.norm1(w[t] - w[t - 1])
    return least(cost, w[0] == 1.0 / n, cp.sum(w, axis=1) == 1, w >= 0)


# ---- control


def plant(nx: int, nu: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a barely unstable linear system and where it starts."""
    rng = np.random.default_rng(nx)
    A = np.eye(nx) + 0.1 * rng.standard_normal((nx, nx))
    A *= 1.02 / np.abs(np.linalg.eigvals(A)).max()
    return A, rng.standard_normal((nx, nu)) / nx, rng.standard_normal(nx)


def control(terms: Any, scale: float, length: int, expected: str = "optimal") -> Model:
    """Return control from `scale` times the start, of `length` steps if small."""

    def make(nx: int, nu: int, steps: int) -> cp.Problem:
        A, B, start = plant(nx, nu)
        x, u = cp.Variable((nx, steps + 1)), cp.Variable((nu, steps))
        moves = x[:, 0] == scale * start, x[:, 1:] == A @ x[:, :-1] + B @ u
        return least(terms(x, u), *moves)

    return Model(make, (4, 2, length), (12, 4, 100), expected)


# ---- projections, signals, LPs, traps


def steps(n: int, rng: Rng, length: int = 10) -> np.ndarray:
    levels = np.repeat(rng.standard_normal(n // length + 1), length)[:n]
    return levels + 0.2 * rng.standard_normal(n)


def polynomial_fit(c: Any, m: int, rng: Rng) -> Terms:
    """Fit a polynomial in the monomial basis, with a nonnegative slope at points."""
    t, n = np.linspace(0.0, 1.0, m), c.size
    X, slope = np.vander(t, n, increasing=True), np.zeros((m, n))
    slope[:, 1:] = X[:, :-1] * np.arange(1, n)
    return square(X @ c - np.exp(2.0 * t) - 0.3 * np.sin(20.0 * t)), slope @ c >= 0


def svm_dual(a: Any, n: int, rng: Rng) -> Terms:
    """Dual of the support vector machine; the matrix has rank n < m."""
    X, labels = classes(a.size, n)
    cost = 0.5 * square((labels[:, None] * X).T @ a) - cp.sum(a)
    return cost, a >= 0, a <= 1, labels @ a == 0


def svm_kernel(a: Any, n: int, rng: Rng) -> Terms:
    """Dual with a Gaussian kernel, which is singular to rounding."""
    X, labels = classes(a.size, n)
    size = (X**2).sum(axis=1)
    distance = size[:, None] + size - 2.0 * X @ X.T
    K = np.outer(labels, labels) * np.exp(-distance / (4.0 * n))
    cost = 0.5 * cp.quad_form(a, cp.psd_wrap(K)) - cp.sum(a)
    return cost, a >= 0, a <= 1, labels @ a == 0


def image_total_variation(n: int) -> cp.Problem:
    rng = np.random.default_rng(n)
    image = np.kron(rng.standard_normal((n // 5, n // 5)), np.ones((5, 5)))
    x = cp.Variable((n, n))
    fit = 0.5 * square(x - image - 0.2 * rng.standard_normal((n, n)))
    jumps = cp.sum(cp.abs(cp.diff(x, axis=0))) + cp.sum(cp.abs(cp.diff(x, axis=1)))
    return least(fit + 0.2 * jumps)


def nonnegative_factor(m: int, n: int, rank: int) -> cp.Problem:
    rng = np.random.default_rng(m)
    H = cp.Variable((rank, n), nonneg=True)
    return least(square(rng.random((m, n)) - rng.random((m, rank)) @ H))


def big_m(amount: Any, m: int, rng: Rng) -> Terms:
    """Buy from suppliers, an LP with fixed costs relaxed by a big M of 1e5."""
    n, used = amount.size, cp.Variable(amount.size)
    cost = (1.0 + rng.random(n)) @ amount + 1e3 * rng.random(n) @ used
    rows = amount >= 0, amount <= 1e5 * used, used >= 0, used <= 1
    limits = cp.sum(amount) >= 100.0 * n, amount <= 150.0 + 300.0 * rng.random(n)
    return cost, *rows, *limits


def storage(c: Any, m: int, rng: Rng) -> Terms:
    """Buy, store and sell energy, an LP with ties between prices."""
    price = np.round(np.sin(np.arange(c.size) / 3.8) + 1.5, 1)
    d, s = cp.Variable(c.size), cp.Variable(c.size + 1)
    rows = s[1:] == s[:-1] + 0.9 * c - d, s[0] == 2.0, s[-1] == 2.0, s >= 0, s <= 5
    return price @ (c - d), *rows, c >= 0, c <= 1, d >= 0, d <= 1


def dependent_rows(x: Any, m: int, rng: Rng) -> Terms:
    """Least norm under equations of which half are sums of the others."""
    A = rng.standard_normal((m, x.size))
    A = np.vstack([A, rng.standard_normal((m, m)) @ A])
    return square(x), A @ x == A @ rng.random(x.size), x >= 0


def lp_unique(x: Any, m: int, rng: Rng) -> Terms:
    """Pose an LP with one solution, a nondegenerate vertex."""
    A, n, size = rng.standard_normal((m, x.size)), x.size, 0.5 + rng.random(m)
    c = -A.T @ np.where(np.arange(m) < n, size, 0.0)
    slack = np.where(np.arange(m) < n, 0.0, size)
    return c @ x, A @ x <= A @ rng.standard_normal(n) + slack


def lp_face(x: Any, m: int, rng: Rng) -> Terms:
    A = rng.random((m, x.size))
    rows = A @ x <= A.sum(axis=1) / 2.0, x >= 0, x <= 1, cp.sum(x) <= x.size / 4.0
    return -cp.sum(x), *rows


def to_and_fro(n: int, m: int, kind: str) -> cp.Problem:
    """Return a problem of a matrix with given sums; one equation is redundant."""
    rng, X = np.random.default_rng(n), cp.Variable((n, m), nonneg=True)
    rows = cp.sum(X, axis=1) == m / n, cp.sum(X, axis=0) == 1.0
    if kind == "birkhoff":
        return least(square(X - rng.standard_normal((n, m))), *rows)
    whole = kind == "transport"
    costs = rng.integers(1, 6, (n, m)) if whole else rng.random((n, m))
    return least(cp.sum(cp.multiply(costs, X)), *rows)


def shortest_path(n: int) -> cp.Problem:
    index = np.arange(n * n).reshape(n, n)
    tails = np.r_[index[:, :-1].ravel(), index[:-1].ravel()]
    heads = np.r_[index[:, 1:].ravel(), index[1:].ravel()]
    entries = np.repeat([1.0, -1.0], tails.size)
    place = np.r_[tails, heads], np.tile(np.arange(tails.size), 2)
    D = sp.csr_array((entries, place), shape=(n * n, tails.size))
    demand = np.zeros(n * n)
    demand[0], demand[-1] = 1.0, -1.0
    f = cp.Variable(tails.size)
    length = np.random.default_rng(n).integers(1, 10, tails.size)
    return least(length @ f, D @ f == demand, f >= 0)


def feasibility(x: Any, m: int, rng: Rng) -> Terms:
    n, inside = x.size, rng.standard_normal(x.size)
    A, C = rng.standard_normal((m, n)), rng.standard_normal((n // 5, n))
    return 0, A @ x <= A @ inside + rng.random(m), C @ x == C @ inside


def infinite_sides(x: Any, m: int, rng: Rng) -> Terms:
    """Project onto rows of which some sides are infinite."""
    n, A = x.size, rng.standard_normal((x.size, x.size))
    upper = np.where(rng.random(n) < 0.5, np.inf, rng.random(n))
    lower = np.where(rng.random(n) < 0.5, -np.inf, -rng.random(n))
    return square(x - 3.0 * rng.standard_normal(n)), A @ x <= upper, x >= lower


def infeasible_rows(x: Any, m: int, rng: Rng) -> Terms:
    """Pose rows of which a positive combination says 0 <= -0.01."""
    A, b = rng.standard_normal((m, x.size)), rng.standard_normal(m)
    proof = rng.random(m)
    A[-1], b[-1] = -proof[:-1] @ A[:-1], -proof[:-1] @ b[:-1] - 0.01
    return cp.norm1(x), A @ x <= b


def infeasible_equations(x: Any, m: int, rng: Rng) -> Terms:
    A, b = rng.standard_normal((m, x.size)), rng.standard_normal(m)
    A = np.vstack([A, A.sum(axis=0)])
    return square(x), A @ x == np.append(b, b.sum() + 0.1)


def unbounded_lp(x: Any, m: int, rng: Rng) -> Terms:
    """Pose an LP that falls along a ray."""
    ray, A = rng.random(x.size), rng.standard_normal((m, x.size))
    A -= np.outer(np.maximum(A @ ray, 0.0), ray) / (ray @ ray)
    return -ray @ x, A @ x <= 1, x >= -1


def nonconvex(x: Any, m: int, rng: Rng) -> Terms:
    """Pose a matrix that only claims to be positive semidefinite."""
    F = rng.standard_normal((x.size, x.size))
    P = F @ F.T / x.size
    P -= (np.linalg.eigvalsh(P)[0] + 0.05) * np.eye(x.size)
    return cp.quad_form(x, cp.psd_wrap(P)) + cp.sum(x), x >= -1, x <= 1


def near(x: Any, rng: Rng) -> Any:
    return square(x - rng.standard_normal(x.size))


def isotonic(x: Any, m: int, rng: Rng) -> Terms:
    rise = np.linspace(0.0, 3.0, x.size) + 3.0 * steps(x.size, rng)
    return square(x - rise), cp.diff(x) >= 0


def convex_regression(x: Any, m: int, rng: Rng) -> Terms:
    curve = np.linspace(-1.0, 1.0, x.size) ** 2
    return square(x - curve - steps(x.size, rng, 1) / 9), cp.diff(x, 2) >= 0


def polytope(x: Any, m: int, rng: Rng) -> Terms:
    cost = square(x - 3.0 * rng.standard_normal(x.size))
    return cost, rng.standard_normal((m, x.size)) @ x <= 0.5 + rng.random(m)


def other(terms: Any, small: Size, large: Size, expected: str = "optimal") -> Model:
    """Return a model of n unknowns and, where they count, m rows; sizes (n, m)."""

    def make(n: int, m: int = 0) -> cp.Problem:
        return least(terms(cp.Variable(n), m, np.random.default_rng(n)))

    return Model(make, small, large, expected)


MODELS: dict[str, Model] = {
    "least_squares": fit(plain, regression, (30, 10), (2000, 300)),
    "least_squares_sparse": fit(plain, local, (60, 30), (20_000, 10_000)),
    "least_squares_random": fit(plain, scattered, (60, 30), (2000, 1200)),
    "least_squares_scaled": fit(plain, scaled, (30, 10), (1000, 200)),
    "least_squares_equality": fit(
        lambda w, X, y: (
            square(X @ w - y),
            np.random.default_rng(1).standard_normal((w.size // 5, w.size)) @ w == 1,
        ), regression, (30, 20), (1000, 500),
    ),
    "ridge": fit(
        lambda w, X, y: square(X @ w - y) + 0.5 * square(w),
        regression, (20, 40), (400, 1500),
    ),
    "ridge_faint": fit(
        lambda w, X, y: (square(X @ w - y) + 1e-6 * square(w), cp.abs(w) <= 1),
        regression, (20, 40), (200, 600),
    ),
    "nnls": fit(nonnegative, regression, (30, 20), (1000, 400)),
    "nnls_sparse": fit(nonnegative, local, (60, 50), (10_000, 8000)),
    "box_least_squares": fit(
        lambda w, X, y: (square(X @ w - y), w >= -0.5, w <= 0.5),
        regression, (30, 20), (1000, 400),
    ),
    "lasso_strong": fit(lasso(0.3), regression, (30, 60), (200, 2000)),
    "lasso_weak": fit(lasso(0.003), regression, (30, 60), (200, 2000)),
    "lasso_tall": fit(lasso(0.05), regression, (60, 30), (1000, 200)),
    "lasso_collinear": fit(lasso(0.05), collinear, (40, 15), (300, 150)),
    "elastic_net": fit(
        lambda w, X, y: square(X @ w - y) / 2 + 0.05 * l1(w, X, y)
        + 0.05 * np.abs(X.T @ y).max() * square(w),
        regression, (30, 60), (200, 1000),
    ),
    "huber": fit(
        lambda w, X, y: cp.sum(cp.huber(X @ w - y, 1.0)),
        outliers, (50, 10), (3000, 100),
    ),
    "absolute_regression": fit(
        lambda w, X, y: cp.norm1(X @ w - y), outliers, (50, 8), (3000, 50),
    ),
    "chebyshev_regression": fit(
        lambda w, X, y: cp.norm_inf(X @ w - y), regression, (50, 8), (2000, 50),
    ),
    "quantile_regression": fit(
        lambda w, X, y: cp.sum(0.9 * cp.pos(y - X @ w) + 0.1 * cp.neg(y - X @ w)),
        outliers, (50, 8), (3000, 50),
    ),
    "dead_zone_regression": fit(
        lambda w, X, y: 0.5 * square(w)
        + 2.0 * cp.sum(cp.pos(cp.abs(X @ w + cp.Variable() - y) - 0.3)),
        regression, (40, 8), (2000, 100),
    ),
    "svm_primal": fit(
        lambda w, X, y: 0.5 * square(w) + hinge(w, X, y), classes, (60, 5), (3000, 100),
    ),
    "svm_l1": fit(
        lambda w, X, y: cp.norm1(w) + hinge(w, X, y), classes, (60, 10), (1000, 200),
    ),
    "fused_lasso": fit(
        lambda w, X, y: 0.5 * square(X @ w - y) + 2.0 * cp.norm1(w)
        + 3.0 * cp.norm1(cp.diff(w)), regression, (40, 30), (500, 300),
    ),
    "basis_pursuit": fit(
        lambda w, X, y: (cp.norm1(w), X @ w == y),
        partial(regression, noise=0.0), (10, 40), (200, 1000),
    ),
    "markowitz": portfolio(lambda w, mean, risk: (2.0 * risk - mean @ w, *LONG(w))),
    "markowitz_target": portfolio(lambda w, mean, risk: (
        risk, *LONG(w), mean @ w >= 0.02, w <= max(0.1, 4.0 / w.size),
    )),
    "turnover_cost": portfolio(lambda w, mean, risk: (
        2.0 * risk - mean @ w + 0.002 * cp.norm1(w - 1.0 / w.size), *LONG(w),
    )),
    "turnover_limit": portfolio(lambda w, mean, risk: (
        2.0 * risk - mean @ w, cp.sum(w) == 1, cp.norm1(w - 1.0 / w.size) <= 0.5,
        cp.norm1(w) <= 1.6,
    )),
    "capital": portfolio(capital),
    "infeasible_portfolio": portfolio(lambda w, mean, risk: (
        risk, *LONG(w), mean @ w >= 1.01 * mean.max(),
    ), "infeasible"),
    "control": control(
        lambda x, u: (square(x) + 0.1 * square(u), cp.abs(u) <= 0.5, x <= 5.0), 1.0, 10,
    ),
    "control_soft": control(  # an l1 penalty on violated bounds and on the input
        lambda x, u: (
            square(x[:, -1]) + 0.1 * cp.sum(cp.abs(u))
            + 10.0 * cp.sum(cp.pos(cp.abs(x) - 0.5)),
            cp.abs(u) <= 0.5,
        ),
        1.0, 10,
    ),
    "control_terminal": control(  # to rest, least energy, bounded rates of the input
        lambda x, u: (
            square(u), x[:, -1] == 0, cp.abs(cp.diff(u, axis=1)) <= 2.0,
        ),
        0.2, 12,
    ),
    "infeasible_control": control(
        lambda x, u: (square(u), cp.abs(u) <= 0.01, x[:, -1] == 10.0),
        1.0, 10, "infeasible",
    ),
    "markowitz_sample": other(  # largest utility; the covariance of n / 2 samples
        lambda w, m, rng: (
            0.005 / m * square(rng.standard_normal((m, w.size)) @ w)
            - market(w.size, 2)[0] @ w,
            cp.sum(w) == 1, w >= -0.1, w <= 0.3,
        ),
        (20, 10), (500, 250),
    ),
    "value_at_risk": other(  # least mean of the worst tenth of losses, an LP
        lambda w, m, rng: (
            cp.sum_largest((-0.01 - 0.1 * rng.standard_normal((m, w.size))) @ w, m / 10)
            / (m / 10),
            *LONG(w),
        ),
        (10, 50), (50, 1000),
    ),
    "polynomial_fit": other(polynomial_fit, (6, 40), (12, 1000)),
    "svm_dual": other(svm_dual, (60, 5), (2000, 50)),
    "svm_kernel": other(svm_kernel, (40, 4), (800, 4)),
    "total_variation": other(
        lambda x, m, rng:
        0.5 * square(x - steps(x.size, rng)) + 0.5 * cp.norm1(cp.diff(x)),
        (100,), (5000,),
    ),
    "trend_filter": other(  # l1 norm of second differences
        lambda x, m, rng:
        0.5 * square(x - steps(x.size, rng)) + 5.0 * cp.norm1(cp.diff(x, 2)),
        (100,), (3000,),
    ),
    "isotonic": other(isotonic, (100,), (10_000,)),
    "convex_regression": other(convex_regression, (50,), (1000,)),
    "big_m": other(big_m, (20,), (3000,)),
    "storage": other(storage, (24,), (2000,)),
    "polytope": other(polytope, (10, 30), (200, 2000)),
    "simplex": other(lambda x, m, rng: (near(x, rng), *LONG(x)), (20,), (10_000,)),
    "l1_ball": other(
        lambda x, m, rng: (near(x, rng), cp.norm1(x) <= 1), (20,), (5000,),
    ),
    "dependent_rows": other(dependent_rows, (20, 5), (600, 150)),
    "lp_unique": other(lp_unique, (10, 30), (200, 1000)),
    "lp_face": other(lp_face, (10, 8), (500, 200)),
    "minimax": other(  # smallest maximum of affine functions, in a box
        lambda x, m, rng: (
            cp.max(rng.standard_normal((m, x.size)) @ x + rng.standard_normal(m)),
            x >= -1, x <= 1,
        ),
        (8, 30), (100, 1000),
    ),
    "feasibility": other(feasibility, (10, 30), (300, 1000)),
    "infinite_sides": other(infinite_sides, (20,), (500,)),
    "infeasible_bounds": other(
        lambda x, m, rng: (
            square(x - 1), x >= 0, x <= np.where(np.arange(x.size) == 5, -1e-3, 1.0),
        ),
        (10,), (10_000,), "infeasible",
    ),
    "infeasible_rows": other(infeasible_rows, (8, 20), (100, 500), "infeasible"),
    "infeasible_equations": other(
        infeasible_equations, (20, 5), (600, 150), "infeasible",
    ),
    "infeasible_both": other(  # neither the problem nor its dual has a feasible point
        lambda x, m, rng: (-cp.sum(x), x[0] - x[1] >= 1, x[1] - x[0] >= 1),
        (2,), (1000,), "infeasible",
    ),
    "unbounded_lp": other(unbounded_lp, (10, 20), (300, 600), "unbounded"),
    "unbounded_qp": other(  # falls where its matrix is singular
        lambda x, m, rng: (
            square(rng.standard_normal((m, x.size)) @ x)
            + rng.standard_normal(x.size) @ x,
            x[0] >= 0,
        ),
        (10, 5), (500, 250), "unbounded",
    ),
    "unbounded_maximum": other(  # borrow without limit
        lambda w, m, rng: (
            square(market(w.size, 2)[1].T @ w) - market(w.size, 2)[0] @ w,
            cp.sum(w) == 1,
        ),
        (10,), (2000,), "unbounded",
    ),
    "nonconvex": other(nonconvex, (10,), (500,), "refused"),
    "birkhoff": Model(partial(to_and_fro, kind="birkhoff"), (6, 6), (60, 60)),
    "assignment": Model(partial(to_and_fro, kind="assignment"), (6, 6), (60, 60)),
    "transport": Model(partial(to_and_fro, kind="transport"), (5, 7), (60, 80)),
    "factor_model": Model(factor_model, (50, 5), (5000, 50)),
    "many_periods": Model(many_periods, (8, 3), (100, 10)),
    "total_variation_image": Model(image_total_variation, (10,), (50,)),
    "nonnegative_factor": Model(nonnegative_factor, (15, 8, 3), (100, 80, 20)),
    "shortest_path": Model(shortest_path, (6,), (60,)),
}  # fmt: skip
