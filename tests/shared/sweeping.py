"""Run the sweep methods on bare arrays, and keep what a test wants to see."""

from types import SimpleNamespace

import numpy as np

from namlcp import Prepared
from namlcp.lcp.data import LCP
from namlcp.lcp.methods import find_method
from namlcp.lcp.modulus import sweeps
from namlcp.lcp.modulus.methods import Parameters
from namlcp.limits import NEVER, Limits
from namlcp.linalg.factors import is_symmetric
from namlcp.status import LCP_COLUMNS, Progress


def box_lcp(A, q, lower, upper):
    """Return an LCP without any check."""
    return LCP(Prepared.unchecked(A, is_symmetric(A)), q, lower, upper)


def every_bounds(rng, n):
    """Return random bounds of every kind: infinite ones, equal ones, none."""
    lower = np.where(rng.random(n) < 0.3, -np.inf, rng.normal(size=n))
    upper = np.where(rng.random(n) < 0.3, np.inf, lower + rng.exponential(size=n))
    upper[lower == -np.inf] = 1.0
    lower[0], upper[0] = -np.inf, np.inf
    lower[1] = upper[1] = 0.7
    return lower, upper


def sweep(
    A, q, lower, upper, method, *, s0=None, z0=None, eps_abs, max_iter, deadline=NEVER,
    **given,
):  # fmt: skip
    """Return the outcome of `sweeps.sweep` with its history and its least residual."""
    rows = Progress(LCP_COLUMNS, verbose=False)
    limits = Limits(eps_abs, 0.0, max_iter, deadline, rows.row)
    solve = find_method(method, given).solve
    found = solve(box_lcp(A, q, lower, upper), z0, limits, s0=s0, **given)
    history = rows.history()
    residual = np.nanmin(history["residual"], initial=np.inf)
    parts = found._asdict() | found.point._asdict()
    return SimpleNamespace(**parts, history=history, residual=residual)


def step_of(A, q, lower, upper, method, **given):
    """Return one iteration of a method as a function."""
    return sweeps.step_of(box_lcp(A, q, lower, upper), method, Parameters(**given))


def one_step(step, s, lower, upper):
    """Return s+ and Res(z), z = clip(s)."""
    old, new = np.empty((2, 2, s.size))
    old[:] = s, np.clip(s, lower, upper)
    residual = step.run(old, new)
    np.testing.assert_array_equal(new[1], np.clip(new[0], lower, upper))
    return new[0], residual


def iterates(step, s, lower, upper, count):
    """Return s_1 ... s_count."""
    rows = []
    for _ in range(count):
        s, _ = one_step(step, s, lower, upper)
        rows.append(s)
    return np.array(rows)
