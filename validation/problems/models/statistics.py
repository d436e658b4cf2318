"""Models that people write in CVXPY: regression, classification, denoising.

Each function takes sizes and returns the problem; data are drawn with a fixed seed.
`MODELS` lists them with a small and a large size.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import cvxpy as cp
import numpy as np
import scipy.sparse as sp


class Model(NamedTuple):
    """A function that makes a problem, its small and its large size.

    `expected` is the status that is right: "optimal", "infeasible", "unbounded", or
    "refused" where P is not positive semidefinite.
    """

    make: Callable[..., cp.Problem]
    small: tuple[Any, ...]
    large: tuple[Any, ...]
    expected: str = "optimal"


def least(cost: Any, *constraints: Any) -> cp.Problem:
    """Return the problem of the least cost."""
    return cp.Problem(cp.Minimize(cost), list(constraints))


def regression(m: int, n: int, noise: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Return a Gaussian matrix and a right-hand side from a sparse truth."""
    rng = np.random.default_rng(m + n)
    X = rng.standard_normal((m, n))
    truth = np.where(rng.random(n) < 0.3, rng.standard_normal(n), 0.0)
    return X, X @ truth + noise * rng.standard_normal(m)


def outliers(m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return `regression` with a tenth of the right-hand side far off."""
    X, y = regression(m, n)
    rng = np.random.default_rng(m)
    return X, y + np.where(rng.random(m) < 0.1, 10.0 * rng.standard_normal(m), 0.0)


def classes(m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return two overlapping clouds of points and their labels -1, +1."""
    rng = np.random.default_rng(m + 7 * n)
    labels = np.where(np.arange(m) % 2 == 0, 1.0, -1.0)
    shift = np.outer(labels, rng.standard_normal(n)) / np.sqrt(n)
    return rng.standard_normal((m, n)) + shift, labels


def steps(n: int) -> np.ndarray:
    """Return a noisy piecewise constant signal."""
    rng = np.random.default_rng(n)
    levels = np.repeat(rng.standard_normal(n // 10 + 1), 10)[:n]
    return levels + 0.2 * rng.standard_normal(n)


def least_squares(m: int, n: int) -> cp.Problem:
    """Least squares with a dense matrix."""
    X, y = regression(m, n)
    return least(cp.sum_squares(X @ cp.Variable(n) - y))


def local_matrix(m: int, n: int) -> sp.csr_array:
    """Return a sparse matrix whose rows have five entries, near each other."""
    rng = np.random.default_rng(m)
    start = np.sort(rng.integers(0, n - 8, m))
    columns = (
        start[:, None] + rng.permuted(np.tile(np.arange(8), (m, 1)), axis=1)[:, :5]
    )
    rows = np.repeat(np.arange(m), 5)
    entries = (rng.standard_normal(5 * m), (rows, columns.ravel()))
    return sp.csr_array(sp.coo_array(entries, (m, n)) + sp.eye_array(m, n))


def sparse_least_squares(m: int, n: int) -> cp.Problem:
    """Least squares with a sparse matrix of local structure."""
    y = np.random.default_rng(3).standard_normal(m)
    return least(cp.sum_squares(local_matrix(m, n) @ cp.Variable(n) - y))


def random_least_squares(m: int, n: int) -> cp.Problem:
    """Least squares with a sparse matrix without structure: its factors fill."""
    rng = np.random.default_rng(3)
    X = sp.random_array((m, n), density=4.0 / n, rng=rng) + sp.eye_array(m, n)
    y = rng.standard_normal(m)
    return least(cp.sum_squares(sp.csr_array(X) @ cp.Variable(n) - y))


def scaled_least_squares(m: int, n: int) -> cp.Problem:
    """Least squares whose columns have lengths from 1e-3 to 1e3."""
    X, y = regression(m, n)
    X = X * np.logspace(-3.0, 3.0, n)
    return least(cp.sum_squares(X @ cp.Variable(n) - y))


def polynomial_fit(m: int, n: int) -> cp.Problem:
    """Fit a polynomial in the monomial basis, with a nonnegative slope at points."""
    t = np.linspace(0.0, 1.0, m)
    X, slope = np.vander(t, n, increasing=True), np.zeros((m, n))
    slope[:, 1:] = X[:, :-1] * np.arange(1, n)
    c = cp.Variable(n)
    y = np.exp(2.0 * t) + 0.3 * np.sin(20.0 * t)
    return least(cp.sum_squares(X @ c - y), slope @ c >= 0)


def equality_least_squares(m: int, n: int) -> cp.Problem:
    """Least squares with linear equations."""
    X, y = regression(m, n)
    x = cp.Variable(n)
    C = np.random.default_rng(1).standard_normal((n // 5, n))
    return least(cp.sum_squares(X @ x - y), C @ x == 1)


def ridge(m: int, n: int) -> cp.Problem:
    """Ridge regression, more features than samples."""
    X, y = regression(m, n)
    w = cp.Variable(n)
    return least(cp.sum_squares(X @ w - y) + 0.5 * cp.sum_squares(w))


def faint_ridge(m: int, n: int) -> cp.Problem:
    """Ridge regression with a penalty of 1e-6, in a box, more features than samples."""
    X, y = regression(m, n)
    w = cp.Variable(n)
    return least(cp.sum_squares(X @ w - y) + 1e-6 * cp.sum_squares(w), cp.abs(w) <= 1)


def nonnegative_least_squares(m: int, n: int) -> cp.Problem:
    """Nonnegative least squares."""
    X, y = regression(m, n)
    x = cp.Variable(n, nonneg=True)
    return least(cp.sum_squares(X @ x - y))


def sparse_nonnegative(m: int, n: int) -> cp.Problem:
    """Nonnegative least squares with a sparse matrix of local structure."""
    x, y = cp.Variable(n), np.random.default_rng(4).standard_normal(m)
    return least(cp.sum_squares(local_matrix(m, n) @ x - y), x >= 0)


def box_least_squares(m: int, n: int) -> cp.Problem:
    """Least squares in a box."""
    X, y = regression(m, n)
    x = cp.Variable(n)
    return least(cp.sum_squares(X @ x - y), x >= -0.5, x <= 0.5)


def lasso(m: int, n: int, fraction: float) -> cp.Problem:
    """Lasso at a fraction of the penalty from which on w = 0."""
    X, y = regression(m, n)
    penalty = fraction * 2.0 * np.abs(X.T @ y).max()
    w = cp.Variable(n)
    return least(cp.sum_squares(X @ w - y) + penalty * cp.norm1(w))


def collinear_lasso(m: int, n: int) -> cp.Problem:
    """Lasso with every feature twice and one that is constant: many solutions."""
    X, y = regression(m, n)
    X = np.hstack([X, X, np.ones((m, 1))])
    w = cp.Variable(2 * n + 1)
    penalty = 0.1 * np.abs(X.T @ y).max()
    return least(cp.sum_squares(X @ w - y) + penalty * cp.norm1(w))


def elastic_net(m: int, n: int) -> cp.Problem:
    """Least squares with both penalties."""
    X, y = regression(m, n)
    w = cp.Variable(n)
    penalty = 0.1 * np.abs(X.T @ y).max()
    cost = cp.sum_squares(X @ w - y) / 2 + penalty * cp.norm1(w)
    return least(cost + 0.5 * penalty * cp.sum_squares(w))


def huber(m: int, n: int) -> cp.Problem:
    """Huber regression."""
    X, y = outliers(m, n)
    return least(cp.sum(cp.huber(X @ cp.Variable(n) - y, 1.0)))


def absolute_regression(m: int, n: int) -> cp.Problem:
    """Least absolute deviations, an LP."""
    X, y = outliers(m, n)
    return least(cp.norm1(X @ cp.Variable(n) - y))


def chebyshev_regression(m: int, n: int) -> cp.Problem:
    """Smallest largest deviation, an LP."""
    X, y = regression(m, n)
    return least(cp.norm_inf(X @ cp.Variable(n) - y))


def quantile_regression(m: int, n: int) -> cp.Problem:
    """Regression of the 0.9 quantile, an LP."""
    X, y = outliers(m, n)
    r = y - X @ cp.Variable(n)
    return least(cp.sum(0.9 * cp.pos(r) + 0.1 * cp.neg(r)))


def dead_zone_regression(m: int, n: int) -> cp.Problem:
    """Support vector regression: deviations up to 0.3 are free."""
    X, y = regression(m, n)
    w, c = cp.Variable(n), cp.Variable()
    loss = cp.sum(cp.pos(cp.abs(X @ w + c - y) - 0.3))
    return least(0.5 * cp.sum_squares(w) + 2.0 * loss)


def svm_primal(m: int, n: int) -> cp.Problem:
    """Support vector machine, hinge loss."""
    X, labels = classes(m, n)
    w, c = cp.Variable(n), cp.Variable()
    loss = cp.sum(cp.pos(1 - cp.multiply(labels, X @ w + c)))
    return least(0.5 * cp.sum_squares(w) + loss)


def svm_l1(m: int, n: int) -> cp.Problem:
    """Support vector machine with an l1 penalty, an LP."""
    X, labels = classes(m, n)
    w, c = cp.Variable(n), cp.Variable()
    loss = cp.sum(cp.pos(1 - cp.multiply(labels, X @ w + c)))
    return least(cp.norm1(w) + loss)


def svm_dual(m: int, n: int) -> cp.Problem:
    """Dual of the support vector machine; the matrix has rank n < m."""
    X, labels = classes(m, n)
    a = cp.Variable(m)
    Z = labels[:, None] * X
    cost = 0.5 * cp.sum_squares(Z.T @ a) - cp.sum(a)
    return least(cost, a >= 0, a <= 1, labels @ a == 0)


def svm_kernel(m: int, n: int) -> cp.Problem:
    """Dual with a Gaussian kernel, which is singular to rounding."""
    X, labels = classes(m, n)
    square = (X**2).sum(axis=1)
    distance = square[:, None] + square - 2.0 * X @ X.T
    K = np.outer(labels, labels) * np.exp(-distance / (4.0 * n))
    a = cp.Variable(m)
    cost = 0.5 * cp.quad_form(a, cp.psd_wrap(K)) - cp.sum(a)
    return least(cost, a >= 0, a <= 1, labels @ a == 0)


def total_variation(n: int) -> cp.Problem:
    """Denoise a line by total variation."""
    x = cp.Variable(n)
    return least(0.5 * cp.sum_squares(x - steps(n)) + 0.5 * cp.norm1(cp.diff(x)))


def image_total_variation(n: int) -> cp.Problem:
    """Denoise an n x n image by anisotropic total variation."""
    rng = np.random.default_rng(n)
    image = np.kron(rng.standard_normal((n // 5, n // 5)), np.ones((5, 5)))
    x = cp.Variable((n, n))
    fit = 0.5 * cp.sum_squares(x - image - 0.2 * rng.standard_normal((n, n)))
    jumps = cp.sum(cp.abs(cp.diff(x, axis=0))) + cp.sum(cp.abs(cp.diff(x, axis=1)))
    return least(fit + 0.2 * jumps)


def trend_filter(n: int) -> cp.Problem:
    """Fit a piecewise linear signal: l1 norm of second differences."""
    x = cp.Variable(n)
    return least(0.5 * cp.sum_squares(x - steps(n)) + 5.0 * cp.norm1(cp.diff(x, 2)))


def fused_lasso(m: int, n: int) -> cp.Problem:
    """Regression with sparse coefficients and sparse jumps."""
    X, y = regression(m, n)
    w = cp.Variable(n)
    cost = 0.5 * cp.sum_squares(X @ w - y) + 2.0 * cp.norm1(w)
    return least(cost + 3.0 * cp.norm1(cp.diff(w)))


def isotonic(n: int) -> cp.Problem:
    """Fit a nondecreasing sequence."""
    y = np.linspace(0.0, 3.0, n) + 3.0 * steps(n)
    x = cp.Variable(n)
    return least(cp.sum_squares(x - y), cp.diff(x) >= 0)


def convex_regression(n: int) -> cp.Problem:
    """Fit a convex sequence."""
    t = np.linspace(-1.0, 1.0, n)
    y = t**2 + 0.1 * np.random.default_rng(n).standard_normal(n)
    x = cp.Variable(n)
    return least(cp.sum_squares(x - y), cp.diff(x, 2) >= 0)


def basis_pursuit(m: int, n: int) -> cp.Problem:
    """Smallest l1 norm that satisfies equations, an LP."""
    X, y = regression(m, n, 0.0)
    w = cp.Variable(n)
    return least(cp.norm1(w), X @ w == y)


def nonnegative_factor(m: int, n: int, rank: int) -> cp.Problem:
    """Find one factor of a nonnegative matrix, a matrix variable."""
    rng = np.random.default_rng(m)
    W, V = rng.random((m, rank)), rng.random((m, n))
    H = cp.Variable((rank, n), nonneg=True)
    return least(cp.sum_squares(V - W @ H))


MODELS = {
    "least_squares": Model(least_squares, (30, 10), (2000, 300)),
    "least_squares_sparse": Model(sparse_least_squares, (60, 30), (20_000, 10_000)),
    "least_squares_random": Model(random_least_squares, (60, 30), (2000, 1200)),
    "least_squares_scaled": Model(scaled_least_squares, (30, 10), (1000, 200)),
    "least_squares_equality": Model(equality_least_squares, (30, 20), (1000, 500)),
    "polynomial_fit": Model(polynomial_fit, (40, 6), (1000, 12)),
    "ridge": Model(ridge, (20, 40), (400, 1500)),
    "ridge_faint": Model(faint_ridge, (20, 40), (200, 600)),
    "nnls": Model(nonnegative_least_squares, (30, 20), (1000, 400)),
    "nnls_sparse": Model(sparse_nonnegative, (60, 50), (10_000, 8000)),
    "box_least_squares": Model(box_least_squares, (30, 20), (1000, 400)),
    "lasso_strong": Model(lasso, (30, 60, 0.3), (200, 2000, 0.3)),
    "lasso_weak": Model(lasso, (30, 60, 0.003), (200, 2000, 0.003)),
    "lasso_tall": Model(lasso, (60, 30, 0.05), (1000, 200, 0.05)),
    "lasso_collinear": Model(collinear_lasso, (40, 15), (300, 150)),
    "elastic_net": Model(elastic_net, (30, 60), (200, 1000)),
    "huber": Model(huber, (50, 10), (3000, 100)),
    "absolute_regression": Model(absolute_regression, (50, 8), (3000, 50)),
    "chebyshev_regression": Model(chebyshev_regression, (50, 8), (2000, 50)),
    "quantile_regression": Model(quantile_regression, (50, 8), (3000, 50)),
    "dead_zone_regression": Model(dead_zone_regression, (40, 8), (2000, 100)),
    "svm_primal": Model(svm_primal, (60, 5), (3000, 100)),
    "svm_l1": Model(svm_l1, (60, 10), (1000, 200)),
    "svm_dual": Model(svm_dual, (60, 5), (2000, 50)),
    "svm_kernel": Model(svm_kernel, (40, 4), (800, 4)),
    "total_variation": Model(total_variation, (100,), (5000,)),
    "total_variation_image": Model(image_total_variation, (10,), (50,)),
    "trend_filter": Model(trend_filter, (100,), (3000,)),
    "fused_lasso": Model(fused_lasso, (40, 30), (500, 300)),
    "isotonic": Model(isotonic, (100,), (10_000,)),
    "convex_regression": Model(convex_regression, (50,), (1000,)),
    "basis_pursuit": Model(basis_pursuit, (10, 40), (200, 1000)),
    "nonnegative_factor": Model(nonnegative_factor, (15, 8, 3), (100, 80, 20)),
}
