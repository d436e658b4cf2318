"""The path of the lasso: fewer and fewer features as the penalty grows.

    minimise  |X w - y|^2 / 2 + penalty |w|_1

(Tibshirani 1996) has the dual QP: minimise |r - y|^2 / 2 subject to X'r <= penalty,
-X'r <= penalty. Its solution r is the residual y - X w, and w is the difference of the
multipliers of the two rows of each feature. Along the path only h changes.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from namlcp import Solver, Status

SAMPLES, FEATURES, TRUE = 80, 30, 6


def regression() -> tuple[np.ndarray, np.ndarray]:
    """Return features, correlated and of norm 1, and what TRUE of them cause."""
    rng = np.random.default_rng(2)
    X = rng.standard_normal((SAMPLES, FEATURES)) + rng.standard_normal((SAMPLES, 1))
    X /= np.linalg.norm(X, axis=0)
    w = np.zeros(FEATURES)
    w[:TRUE] = rng.choice([-1.0, 1.0], TRUE) * rng.uniform(1.0, 3.0, TRUE)
    return X, X @ w + 0.05 * rng.standard_normal(SAMPLES)


def run(points: int = 200) -> SimpleNamespace:
    """Follow the path from the largest penalty, and print when features enter."""
    X, y = regression()
    most = abs(X.T @ y).max()
    solver = Solver(
        np.eye(SAMPLES), -y, np.vstack((X.T, -X.T)), np.full(2 * FEATURES, most)
    )
    penalties = np.logspace(0.0, -3.0, points)
    results = []
    for penalty in penalties:
        solver.update(h=np.full(2 * FEATURES, penalty * most))
        results.append(solver.solve())
    coefficients = np.array([r.z[:FEATURES] - r.z[FEATURES:] for r in results])
    print("penalty  features  |X w - y|")
    for k in range(0, points, max(points // 6, 1)):
        count = np.count_nonzero(coefficients[k])
        misfit = np.linalg.norm(X @ coefficients[k] - y)
        print(f"{penalties[k]:7.3f}  {count:8d}  {misfit:9.4f}")
    seconds = np.median([result.solve_time for result in results])
    print(f"{1e6 * seconds:.1f} microseconds a solve (median)")
    solved = all(result.status is Status.SOLVED for result in results)
    return SimpleNamespace(
        penalties=penalties, coefficients=coefficients, solved=solved
    )


def draw(record: SimpleNamespace, figure: Any) -> None:
    """Draw the coefficients against the penalty."""
    axes = figure.subplots()
    others = axes.plot(record.penalties, record.coefficients[:, TRUE:], color="0.75")
    causes = axes.plot(record.penalties, record.coefficients[:, :TRUE])
    axes.set(xscale="log", xlabel="penalty / largest", ylabel="coefficient")
    axes.invert_xaxis()
    axes.legend([causes[0], others[0]], ["features that cause y", "all others"])
