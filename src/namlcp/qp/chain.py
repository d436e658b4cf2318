"""Transforms one after another, from the user's QP to the problem an engine solves.

A transform has the methods `point`, which maps a point back to the problem before it,
and `guess`, which maps a guess forward. A `Chain` has the same methods, for all its
transforms. With data = 0.0, `point` maps what is scaled at will: a ray, or multipliers
that prove infeasibility; q, b and the bounds count as 0 then.
"""

from namlcp.qp.problem import Point


class Chain:
    """The transforms, the user's end first; `back`: the engine's end first."""

    def __init__(self, *transforms):
        self.transforms, self.back = transforms, transforms[::-1]

    def then(self, *transforms):
        """Return the chain with more transforms at the engine's end."""
        return Chain(*self.transforms, *transforms)

    def point(self, *parts, data=1.0):
        """Return the user's point; `parts` as the last transform takes them."""
        for transform in self.back:
            parts = transform.point(*parts, data)
        return Point(*parts)

    def guess(self, guess):
        for transform in self.transforms:
            guess = transform.guess(guess)
        return guess


NO_TRANSFORMS = Chain()
"""For a QP that is solved as it came."""
