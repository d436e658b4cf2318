"""Transforms one after another, from the user's QP to the problem an engine solves.

A transform has the methods `point`, `primal` (x alone), `ray` (a direction of x) and
`certificate` (the multipliers that prove infeasibility), which map back to the problem
before it, and `guess`, which maps a guess forward. A `Chain` has the same methods, for
all its transforms.
"""

from namlcp.qp.problem import Point


class Chain:
    """The transforms, the user's end first; `back`: the engine's end first."""

    def __init__(self, *transforms):
        self.transforms, self.back = transforms, transforms[::-1]

    def then(self, *transforms):
        """Return the chain with more transforms at the engine's end."""
        return Chain(*self.transforms, *transforms)

    def point(self, *parts):
        """Return the user's point; `parts` as the last transform takes them."""
        for transform in self.back:
            parts = transform.point(*parts)
        return Point(*parts)

    def primal(self, x):
        for transform in self.back:
            x = transform.primal(x)
        return x

    def ray(self, d):
        for transform in self.back:
            d = transform.ray(d)
        return d

    def certificate(self, *parts):
        for transform in self.back:
            parts = transform.certificate(*parts)
        y, z = parts
        return y, z

    def guess(self, guess):
        for transform in self.transforms:
            guess = transform.guess(guess)
        return guess


NO_TRANSFORMS = Chain()
"""For a QP that is solved as it came."""
