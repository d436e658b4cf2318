"""A step of a sweep method whose alpha or Omega is chosen during the run."""

from collections.abc import Callable
from typing import Any

import numpy as np

from namlcp.lcp.modulus.parameters import EVERY, FROM, Choice

RETRIES = 8
"""Fresh starts after a divergence, each with P twice as large."""

REFACTOR = 0.2
"""A change of Omega below 20 % is not worth another factorisation."""


class AdaptiveStep:
    """The step of `sweeps.iterate`, with parameters that `Choice` looks up.

    Where Omega changes s is written anew, s = z - w/Omega with the w of before, so that
    a solution stays a fixed point.

    Parameters
    ----------
    choice : Choice
    build : callable
        build(alpha, omega) returns the step for fixed parameters, None if there is no
        factorisation, and its Omega.
    lower, upper : (n,) array
        Bounds.

    Attributes
    ----------
    omega : (n,) array
        Diagonal of Omega of the last iterate.
    """

    def __init__(
        self, choice: Choice, build: Callable, lower: np.ndarray, upper: np.ndarray
    ):
        self.choice = choice
        self.build = build
        self.lower, self.upper = lower, upper
        self.k = 0
        self.retries = 0
        self.before = np.empty(0)
        self.alpha, omega = choice.parameters()
        self.step, self.omega = build(self.alpha, omega)

    def __call__(
        self, s: np.ndarray, z: np.ndarray, s_next: np.ndarray, z_next: np.ndarray
    ) -> float:
        """Write the next iterate and return Res(z); s may be written anew before."""
        k, self.k = self.k, self.k + 1
        changes = False
        if is_due(k):
            changes = self.choice.watch(z - self.before)
        if is_power_of_2(k):
            free = (z > self.lower) & (z < self.upper)
            self.choice.look(k, free, z - self.before)
            changes = True
        if changes:
            self.change(s, z)
        if is_power_of_2(k + 1) or is_due(k + 1):
            self.before = z.copy()
        return self.step(s, z, s_next, z_next)

    def retries_from(self, s: np.ndarray, z: np.ndarray) -> bool:
        """Tell whether to go on after a divergence, from s and z, more carefully."""
        if self.retries == RETRIES:
            return False
        self.retries += 1
        self.choice.raised = 2.0
        self.choice.take_care()
        self.choice.least = np.inf
        self.change(s, z)
        self.before = z.copy()
        return True

    def change(self, s: np.ndarray, z: np.ndarray) -> None:
        """Take the new parameters, and the s that they need."""
        alpha, omega = self.choice.parameters()
        if self.choice.method.factored:
            if np.all(np.abs(omega - self.omega) <= REFACTOR * self.omega):
                return
            step, omega = self.build(alpha, omega)
            if step is None:
                return
        else:
            step, omega = self.build(alpha, omega)
        if not np.array_equal(omega, self.omega):
            np.subtract(z, (self.omega / omega) * (z - s), out=s)
        self.alpha, self.step, self.omega = alpha, step, omega


def is_power_of_2(k: Any) -> bool:
    """Tell whether k = 1, 2, 4, 8, ..."""
    return k > 0 and k & (k - 1) == 0


def is_due(k: int) -> bool:
    """Tell whether the change of z is looked at before sweep k."""
    return k >= FROM and k % EVERY == 0
