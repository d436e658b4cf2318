"""An efficient frontier: the least risk for every appetite for return.

    minimise  x'Cov x / 2 - appetite mean'x  subject to  sum x = 1,  0 <= x <= MOST

for one appetite after another (Markowitz 1952): only q changes.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from namlcp import Solver, Status

ASSETS, FACTORS = 60, 5
MOST = 0.2  # of the capital in one asset


def market() -> tuple[np.ndarray, np.ndarray]:
    """Return mean and covariance of yearly returns: a few factors, and noise."""
    rng = np.random.default_rng(1)
    loadings = 0.1 * rng.standard_normal((ASSETS, FACTORS))
    loadings[:, 0] = rng.uniform(0.1, 0.25, ASSETS)  # the market as a whole
    noise = rng.uniform(0.1, 0.3, ASSETS)
    covariance = loadings @ loadings.T + np.diag(noise**2)
    mean = 0.02 + 0.3 * loadings[:, 0] + 0.03 * rng.standard_normal(ASSETS)
    return mean, covariance


def run(points: int = 200) -> SimpleNamespace:
    """Follow the frontier, and print some of its portfolios."""
    mean, covariance = market()
    solver = Solver(
        covariance, np.zeros(ASSETS), A=np.ones((1, ASSETS)), b=np.ones(1),
        lb=np.zeros(ASSETS), ub=np.full(ASSETS, MOST),
    )  # fmt: skip
    results = []
    for appetite in np.append(0.0, np.logspace(-2.0, 1.0, points - 1)):
        solver.update(q=-appetite * mean)
        results.append(solver.solve())
    weights = np.array([result.x for result in results])
    risks = np.sqrt(np.einsum("ki,ij,kj->k", weights, covariance, weights))
    returns = weights @ mean
    print("  risk  return  assets held")
    for k in range(0, points, max(points // 5, 1)):
        held = np.count_nonzero(weights[k] > 1e-9)
        print(f"{risks[k]:6.1%}  {returns[k]:6.1%}  {held:11d}")
    seconds = np.median([result.solve_time for result in results])
    print(f"{1e6 * seconds:.1f} microseconds a solve (median)")
    solved = all(result.status is Status.SOLVED for result in results)
    return SimpleNamespace(weights=weights, risks=risks, returns=returns, solved=solved)


def draw(record: SimpleNamespace, figure: Any) -> None:
    """Draw the frontier, and the weights along it."""
    frontier, shares = figure.subplots(1, 2)
    mean, covariance = market()
    risk = np.sqrt(np.diag(covariance))
    frontier.plot(risk, mean, ".", color="0.6", label="single assets")
    frontier.plot(record.risks, record.returns, label="efficient portfolios")
    frontier.set(xlabel="risk a year", ylabel="return a year")
    frontier.legend(loc="lower right")
    held = record.weights[:, record.weights.max(axis=0) > 1e-9]
    shares.stackplot(record.risks, held.T, linewidth=0.0)
    shares.set(xlabel="risk a year", ylabel="share of each asset", ylim=(0.0, 1.0))
    shares.margins(x=0.0)
