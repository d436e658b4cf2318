"""QPs for the differentiable layers: all kinds of constraints, no kinks nearby."""

import numpy as np


def layer_data(n=5, m=6, p=2, lead=(), seed=0) -> list[np.ndarray]:
    """Return P, q, G, h, A, b, lb, ub of feasible QPs; A is shared by all items."""
    rng = np.random.default_rng(seed)
    B, x = rng.standard_normal((*lead, n, n)), rng.standard_normal((*lead, n))
    G, A = rng.standard_normal((*lead, m, n)), rng.standard_normal((p, n))
    P, q = B @ np.swapaxes(B, -1, -2) + np.eye(n), 3.0 * rng.standard_normal((*lead, n))
    h, b = (G @ x[..., None])[..., 0] + rng.random((*lead, m)), x @ A.T
    return [P, q, G, h, A, b, x - rng.random((*lead, n)), x + rng.random((*lead, n))]


SHARP = {"eps_abs": 1e-12, "eps_rel": 1e-13}
"""Options of solves whose differences are taken."""
