"""The step of a sweep method whose alpha or Omega is chosen during the run."""

from typing import Any

import numpy as np

from namlcp.lcp.data import LCP
from namlcp.lcp.modulus.factored import factored_step
from namlcp.lcp.modulus.kernels import Z
from namlcp.lcp.modulus.methods import (
    METHODS,
    Parameters,
    checked_parameters,
    positive_diagonal,
    spread,
)
from namlcp.lcp.modulus.parameters import EVERY, FROM, Choice
from namlcp.lcp.modulus.triangular import Step, TriangularStep

RETRIES = 8
"""Limit on restarts after a divergence; each doubles P, see `parameters`."""

REFACTOR = 0.2
"""Largest relative change of Omega for which a factored method keeps its factors."""


class AdaptiveStep(Step):
    """A step that chooses alpha or Omega, those that are "auto", during the run.

    When Omega changes, s = z - w/Omega is recomputed for the same z and w, so that a
    solution remains a fixed point. `step` is None if the first factorisation fails.
    """

    def __init__(self, lcp: LCP, method: str, given: Parameters, run: Any = None):
        """Check the other parameters; `run` is that of `TriangularStep`."""
        chosen = METHODS[method]
        names = ("alpha", "omega")
        free = {name: None for name in names if isinstance(getattr(given, name), str)}
        if chosen.factored:
            D = positive_diagonal(lcp.A, method)
            shift = spread("shift", given.shift, D.size, D) if chosen.own else None
            fixed = given._replace(shift=shift)
        else:
            checked = checked_parameters(lcp.A, method, given._replace(**free))
            fixed = given._replace(shift=checked.shift)
            if given.omega is not None and "omega" not in free:
                fixed = fixed._replace(omega=checked.omega)
        self.lcp, self.fixed, self.run = lcp, fixed, run
        self.choice = Choice(lcp.A, chosen, fixed)
        self.alpha, self.omega = self.choice.parameters()
        self.step: Any = self.build(self.alpha, self.omega)
        self.k = self.retries = 0
        self.before = np.empty(0)

    def build(self, alpha: float, omega: np.ndarray) -> Step | None:
        """Return a step with these parameters, None if the factorisation fails."""
        chosen, fixed = self.choice.method, self.fixed
        beta = fixed.beta_for(chosen, alpha)
        now = fixed._replace(alpha=alpha, beta=beta, omega=omega)
        if chosen.factored:
            return factored_step(self.lcp, now)
        return TriangularStep(self.lcp, chosen, now, self.run)

    def __call__(self, old: np.ndarray, new: np.ndarray) -> float:
        """Write the next iterate to `new` and return Res(z) of `old`.

        old[S] is overwritten if Omega changes.
        """
        z = old[Z]
        k, self.k = self.k, self.k + 1
        changes = False
        if is_due(k):
            changes = self.choice.watch(z - self.before)
        if is_power_of_2(k):
            free = (z > self.lcp.lower) & (z < self.lcp.upper)
            self.choice.look(k, free, z - self.before)
            changes = True
        if changes:
            self.change(old)
        if is_power_of_2(k + 1) or is_due(k + 1):
            self.before = z.copy()
        return self.step(old, new)

    def retries_from(self, point: np.ndarray) -> bool:
        """Prepare a restart from an iterate with larger P; tell whether to restart."""
        if self.retries == RETRIES:
            return False
        self.retries += 1
        self.choice.raised = 2.0
        self.choice.take_care()
        self.choice.least = np.inf
        self.change(point)
        self.before = point[Z].copy()
        return True

    def change(self, point: np.ndarray) -> None:
        """Use the parameters of `choice` from now on; point[S] is overwritten."""
        s, z = point
        alpha, omega = self.choice.parameters()
        is_near = np.all(np.abs(omega - self.omega) <= REFACTOR * self.omega)
        if self.choice.method.factored and is_near:
            return
        step = self.build(alpha, omega)
        if step is None:
            return
        if not np.array_equal(omega, self.omega):
            np.subtract(z, (self.omega / omega) * (z - s), out=s)
        self.alpha, self.step, self.omega = alpha, step, omega


def is_power_of_2(k: Any) -> bool:
    """Tell whether k = 1, 2, 4, 8, ..."""
    return k > 0 and k & (k - 1) == 0


def is_due(k: int) -> bool:
    """Tell whether the change of z is measured before sweep k."""
    return k >= FROM and k % EVERY == 0
