"""Transforms one after another, from the user's QP to the problem an engine solves.

A transform has the methods `point`, `primal` (x alone), `ray` (a direction of x) and
`certificate` (the multipliers that prove infeasibility), which map back to the problem
before it, and `guess`, which maps a guess forward. A `Chain` has the same methods, for
all its transforms.
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.qp.guess import Guess
from namlcp.qp.problem import Point


class Chain(NamedTuple):
    """The transforms, the user's end first."""

    transforms: tuple[Any, ...] = ()

    def then(self, *transforms: Any) -> "Chain":
        """Return the chain with more transforms at the engine's end."""
        return Chain(self.transforms + transforms)

    def point(self, *parts: np.ndarray) -> Point:
        """Return the user's point; `parts` as the last transform takes them."""
        for transform in reversed(self.transforms):
            parts = transform.point(*parts)
        return Point(*parts)

    def primal(self, x: np.ndarray) -> np.ndarray:
        """Return the user's x."""
        for transform in reversed(self.transforms):
            x = transform.primal(x)
        return x

    def ray(self, d: np.ndarray) -> np.ndarray:
        """Return the direction of the user's x."""
        for transform in reversed(self.transforms):
            d = transform.ray(d)
        return d

    def certificate(self, *parts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the user's (y, z)."""
        for transform in reversed(self.transforms):
            parts = transform.certificate(*parts)
        y, z = parts
        return y, z

    def guess(self, guess: Guess) -> Any:
        """Return the guess for the engine."""
        for transform in self.transforms:
            guess = transform.guess(guess)
        return guess


OWN = Chain()
"""The way of a QP that is solved as it came."""
