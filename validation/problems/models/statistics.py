"""Models that people write in CVXPY: regression, classification, denoising.

Each function takes sizes and returns the problem; data are drawn with a fixed seed.
`MODELS` lists them with a small and a large size.
"""

from collections.abc import Callable
from functools import partial
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


def local(m: int, n: int) -> tuple[sp.csr_array, np.ndarray]:
    """Return a sparse matrix whose rows have five entries near each other, and y."""
    rng = np.random.default_rng(m)
    start = np.sort(rng.integers(0, n - 8, m))
    near = rng.permuted(np.tile(np.arange(8), (m, 1)), axis=1)[:, :5]
    place = np.repeat(np.arange(m), 5), (start[:, None] + near).ravel()
    X = sp.coo_array((rng.standard_normal(5 * m), place), (m, n)) + sp.eye_array(m, n)
    return sp.csr_array(X), rng.standard_normal(m)


def scattered(m: int, n: int) -> tuple[sp.csr_array, np.ndarray]:
    """Return a sparse matrix without structure, whose factors fill, and y."""
    rng = np.random.default_rng(3)
    X = sp.random_array((m, n), density=4.0 / n, rng=rng) + sp.eye_array(m, n)
    return sp.csr_array(X), rng.standard_normal(m)


def scaled(m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return `regression` with columns of lengths from 1e-3 to 1e3."""
    X, y = regression(m, n)
    return X * np.logspace(-3.0, 3.0, n), y


def collinear(m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return `regression` with every column twice and one that is constant."""
    X, y = regression(m, n)
    return np.hstack((X, X, np.ones((m, 1)))), y


def exact(m: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return `regression` without noise."""
    return regression(m, n, 0.0)


Data = Callable[[int, int], tuple[Any, np.ndarray]]
"""From sizes to X and y."""


def square(r: Any) -> Any:
    return cp.sum_squares(r)


def l1(w: Any, X: np.ndarray, y: np.ndarray, fraction: float) -> Any:
    """Return an l1 penalty, a fraction of that from which on w = 0."""
    return fraction * 2.0 * np.abs(X.T @ y).max() * cp.norm1(w)


def hinge(w: Any, X: np.ndarray, labels: np.ndarray) -> Any:
    """Return the hinge loss of a plane with a free offset."""
    return cp.sum(cp.pos(1 - cp.multiply(labels, X @ w + cp.Variable())))


Fit = Callable[[Any, Any, np.ndarray], tuple[Any, ...]]
"""From w, X and y to the cost, and constraints."""

DENSE: dict[str, Fit] = {
    "least_squares": lambda w, X, y: (square(X @ w - y),),
    "least_squares_equality": lambda w, X, y: (
        square(X @ w - y),
        np.random.default_rng(1).standard_normal((w.size // 5, w.size)) @ w == 1,
    ),
    "ridge": lambda w, X, y: (square(X @ w - y) + 0.5 * square(w),),
    "ridge_faint": lambda w, X, y: (
        square(X @ w - y) + 1e-6 * square(w), cp.abs(w) <= 1,
    ),
    "nnls": lambda w, X, y: (square(X @ w - y), w >= 0),
    "box_least_squares": lambda w, X, y: (square(X @ w - y), w >= -0.5, w <= 0.5),
    "lasso_strong": lambda w, X, y: (square(X @ w - y) + l1(w, X, y, 0.3),),
    "lasso_weak": lambda w, X, y: (square(X @ w - y) + l1(w, X, y, 0.003),),
    "lasso_tall": lambda w, X, y: (square(X @ w - y) + l1(w, X, y, 0.05),),
    "elastic_net": lambda w, X, y: (
        square(X @ w - y) / 2 + l1(w, X, y, 0.05)
        + 0.05 * np.abs(X.T @ y).max() * square(w),
    ),
    "chebyshev_regression": lambda w, X, y: (cp.norm_inf(X @ w - y),),
    "dead_zone_regression": lambda w, X, y: (
        0.5 * square(w)
        + 2.0 * cp.sum(cp.pos(cp.abs(X @ w + cp.Variable() - y) - 0.3)),
    ),
    "fused_lasso": lambda w, X, y: (
        0.5 * square(X @ w - y) + 2.0 * cp.norm1(w) + 3.0 * cp.norm1(cp.diff(w)),
    ),
}  # fmt: skip
"""Fits to `regression`."""
ROBUST: dict[str, Fit] = {
    "huber": lambda w, X, y: (cp.sum(cp.huber(X @ w - y, 1.0)),),
    "absolute_regression": lambda w, X, y: (cp.norm1(X @ w - y),),
    "quantile_regression": lambda w, X, y: (
        cp.sum(0.9 * cp.pos(y - X @ w) + 0.1 * cp.neg(y - X @ w)),
    ),
}
"""Fits to `outliers`."""
MACHINES: dict[str, Fit] = {
    "svm_primal": lambda w, X, y: (0.5 * square(w) + hinge(w, X, y),),
    "svm_l1": lambda w, X, y: (cp.norm1(w) + hinge(w, X, y),),
}
"""Support vector machines, on `classes`."""
SPARSE: dict[str, Fit] = {
    "least_squares_sparse": lambda w, X, y: (square(X @ w - y),),
    "nnls_sparse": lambda w, X, y: (square(X @ w - y), w >= 0),
}
"""Fits to `local`."""
OTHERS: dict[str, tuple[Fit, Data]] = {
    "least_squares_random": (DENSE["least_squares"], scattered),
    "least_squares_scaled": (DENSE["least_squares"], scaled),
    "lasso_collinear": (DENSE["lasso_tall"], collinear),
    "basis_pursuit": (lambda w, X, y: (cp.norm1(w), X @ w == y), exact),
}
FITS: dict[str, tuple[Fit, Data]] = {
    **{name: (fit, regression) for name, fit in DENSE.items()},
    **{name: (fit, outliers) for name, fit in ROBUST.items()},
    **{name: (fit, classes) for name, fit in MACHINES.items()},
    **{name: (fit, local) for name, fit in SPARSE.items()},
    **OTHERS,
}


def fit(name: str, m: int, n: int) -> cp.Problem:
    """Return one of FITS to data of this size."""
    make, data = FITS[name]
    X, y = data(m, n)
    return least(*make(cp.Variable(X.shape[1]), X, y))


def polynomial_fit(m: int, n: int) -> cp.Problem:
    """Fit a polynomial in the monomial basis, with a nonnegative slope at points."""
    t = np.linspace(0.0, 1.0, m)
    X, slope = np.vander(t, n, increasing=True), np.zeros((m, n))
    slope[:, 1:] = X[:, :-1] * np.arange(1, n)
    c = cp.Variable(n)
    y = np.exp(2.0 * t) + 0.3 * np.sin(20.0 * t)
    return least(cp.sum_squares(X @ c - y), slope @ c >= 0)


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


def nonnegative_factor(m: int, n: int, rank: int) -> cp.Problem:
    """Find one factor of a nonnegative matrix, a matrix variable."""
    rng = np.random.default_rng(m)
    W, V = rng.random((m, rank)), rng.random((m, n))
    H = cp.Variable((rank, n), nonneg=True)
    return least(cp.sum_squares(V - W @ H))


SIZES = {
    "least_squares": ((30, 10), (2000, 300)),
    "least_squares_sparse": ((60, 30), (20_000, 10_000)),
    "least_squares_random": ((60, 30), (2000, 1200)),
    "least_squares_scaled": ((30, 10), (1000, 200)),
    "least_squares_equality": ((30, 20), (1000, 500)),
    "ridge": ((20, 40), (400, 1500)),
    "ridge_faint": ((20, 40), (200, 600)),
    "nnls": ((30, 20), (1000, 400)),
    "nnls_sparse": ((60, 50), (10_000, 8000)),
    "box_least_squares": ((30, 20), (1000, 400)),
    "lasso_strong": ((30, 60), (200, 2000)),
    "lasso_weak": ((30, 60), (200, 2000)),
    "lasso_tall": ((60, 30), (1000, 200)),
    "lasso_collinear": ((40, 15), (300, 150)),
    "elastic_net": ((30, 60), (200, 1000)),
    "huber": ((50, 10), (3000, 100)),
    "absolute_regression": ((50, 8), (3000, 50)),
    "chebyshev_regression": ((50, 8), (2000, 50)),
    "quantile_regression": ((50, 8), (3000, 50)),
    "dead_zone_regression": ((40, 8), (2000, 100)),
    "svm_primal": ((60, 5), (3000, 100)),
    "svm_l1": ((60, 10), (1000, 200)),
    "fused_lasso": ((40, 30), (500, 300)),
    "basis_pursuit": ((10, 40), (200, 1000)),
}
"""Samples and unknowns of FITS, small and large."""
MODELS = {
    **{name: Model(partial(fit, name), *sizes) for name, sizes in SIZES.items()},
    "polynomial_fit": Model(polynomial_fit, (40, 6), (1000, 12)),
    "svm_dual": Model(svm_dual, (60, 5), (2000, 50)),
    "svm_kernel": Model(svm_kernel, (40, 4), (800, 4)),
    "total_variation": Model(total_variation, (100,), (5000,)),
    "total_variation_image": Model(image_total_variation, (10,), (50,)),
    "trend_filter": Model(trend_filter, (100,), (3000,)),
    "isotonic": Model(isotonic, (100,), (10_000,)),
    "convex_regression": Model(convex_regression, (50,), (1000,)),
    "nonnegative_factor": Model(nonnegative_factor, (15, 8, 3), (100, 80, 20)),
}
