"""The penalty of a lasso, chosen by the gradient of a validation error.

The lasso is solved by its dual QP, see `lasso`: r is the residual, the coefficients w
are the differences of multipliers, and the penalty is every entry of h. For an error
E(w) on other samples, `backward` with the gradient of E in the multipliers returns the
gradient in h, whose sum is dE / dpenalty.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np

from examples.lasso import FEATURES, regression
from namlcp import Solver, Status

KEPT = 50  # samples to learn from; the others are for validation
STEPS, RATE = 25, 0.4


def run(points: int = 60) -> SimpleNamespace:
    """Scan the penalty, descend from the largest one, and print what came out."""
    X, y = regression()
    y = y + 0.3 * np.random.default_rng(3).standard_normal(y.size)
    known, other = slice(None, KEPT), slice(KEPT, None)
    learn = X[known]
    most = abs(learn.T @ y[known]).max()
    solver = Solver(
        np.eye(KEPT), -y[known], np.vstack((learn.T, -learn.T)),
        np.full(2 * FEATURES, most),
    )  # fmt: skip
    solved = True

    def error(penalty: float) -> tuple[float, float, float]:
        """Return the penalty, the error, and its slope in log(penalty)."""
        nonlocal solved
        solver.update(h=np.full(2 * FEATURES, penalty))
        result = solver.solve()
        solved &= result.status is Status.SOLVED
        w = result.z[:FEATURES] - result.z[FEATURES:]
        misfit = X[other] @ w - y[other]
        gradient = X[other].T @ misfit
        slope = result.backward(dz=np.concatenate((gradient, -gradient))).h.sum()
        return penalty, 0.5 * misfit @ misfit, penalty * slope

    scan = np.array([error(share * most) for share in np.logspace(-3.0, -0.05, points)])
    penalty, descent = 0.6 * most, []
    for _ in range(STEPS):
        descent.append(error(penalty))
        penalty *= np.exp(-RATE * np.clip(descent[-1][2], -1.0, 1.0))
    best = descent[-1]
    print(
        f"from penalty {descent[0][0]:.3f}, error {descent[0][1]:.3f}\n"
        f"to           {best[0]:.3f}, error {best[1]:.3f}, in {STEPS} steps\n"
        f"least error of a scan: {scan[:, 1].min():.3f}"
    )
    return SimpleNamespace(scan=scan, descent=np.array(descent), solved=solved)


def draw(record: SimpleNamespace, figure: Any) -> None:
    """Draw the error, its slopes as tangents, and the descent."""
    axes = figure.subplots()
    axes.plot(*record.scan.T[:2], color="0.6", label="validation error")
    for at, height, steep in record.scan[::4]:
        reach = np.array([-0.15, 0.15])
        axes.plot(at * np.exp(reach), height + steep * reach, color="C1", linewidth=2)
    axes.plot([], [], color="C1", linewidth=2, label="slope, by backward")
    axes.plot(record.descent[:, 0], record.descent[:, 1], "o-", label="descent")
    axes.set(xscale="log", xlabel="penalty", ylabel="error")
    axes.legend()
