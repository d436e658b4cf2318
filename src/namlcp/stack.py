"""Stacks of dense QPs and their derivatives.

An argument of a stack may have leading axes, over which all arguments broadcast as
NumPy's do: P of shape (n, n) belongs to all items, q of shape (10, 1, n) and h of shape
(5, m) make 10 x 5 items. Gradients have the shapes of the arguments.
"""

from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from namlcp.checks import refuse_number
from namlcp.derivatives.gradients import right_sides
from namlcp.derivatives.qp import BatchDerivative
from namlcp.qp.batch import Items
from namlcp.qp.problem import QP, Point
from namlcp.solve.qp import solve_batch, solve_qp

AXES = dict(zip(QP._fields, (2, 1, 2, 1, 2, 1, 1, 1), strict=True))
"""The number of axes of each argument of one QP."""

Arrays = dict[str, np.ndarray]


class Stack:
    """A stack of QPs, solved.

    `solution`, the `Point` of NaN for an item that is not solved, and `solved` have the
    common leading axes `lead`.
    """

    def __init__(self, parts: Sequence[Any], settings: dict[str, Any]) -> None:
        """Solve; `parts` are P, q, G, h, A, b, lb, ub, arrays or None.

        Raises ValueError or TypeError for a malformed argument. One that differs from
        item to item may be malformed (NaN, P not convex) in some: these are not solved.
        """
        named = zip(AXES, parts, strict=True)
        self.parts: Arrays = {name: part for name, part in named if part is not None}
        leads = {name: lead_of(name, part) for name, part in self.parts.items()}
        try:
            self.lead = np.broadcast_shapes(*leads.values())
        except ValueError:
            raise ValueError(
                f"leading axes must broadcast, got those of {leads}"
            ) from None
        self.size = int(np.prod(self.lead))
        self.stacked = {k for k, lead in leads.items() if int(np.prod(lead)) != 1}
        if self.lead and not self.stacked:
            self.stacked = {"q"}  # a stack of one item
        self.flat: dict[str, Any] = dict.fromkeys(AXES) | self.flattened(self.parts)
        solve: Any = solve_batch if self.lead else solve_qp
        found = solve(**self.flat, **settings)
        self.items = found.problem if self.lead else None
        solved = np.atleast_1d(found.solved if self.lead else found.found)
        values = found.x, found.y, found.z, found.z_box
        self.points = Point(
            *(np.where(solved[:, None], np.atleast_2d(v), np.nan) for v in values)
        )
        self.solved = solved.reshape(self.lead)
        self.solution = Point(*self.shaped(self.points))
        self.threads = settings.get("threads")

    def flattened(self, parts: Arrays) -> Arrays:
        """Return arguments with one axis of items, or none where they are shared."""
        flat = {}
        for name, part in parts.items():
            own = part.shape[part.ndim - AXES[name] :]
            if name in self.stacked:
                part = np.broadcast_to(part, self.lead + own)
                own = self.size, *own
            flat[name] = part.reshape(own)
        return flat

    def shaped(self, values: Iterable[np.ndarray]) -> list[np.ndarray]:
        """Return values of all items with the leading axes instead of one."""
        return [v.reshape(*self.lead, v.shape[1]) for v in values]

    def backward(self, cotangents: Sequence[Any], wanted: Sequence[bool]) -> list[Any]:
        """Return the gradients in the wanted arguments, None for the others.

        `cotangents`: the gradients of a scalar in the solution, shaped as that. Items
        not solved have gradients 0.
        """
        flat = tuple(np.reshape(v, (self.size, v.shape[-1])) for v in cotangents)
        found = self.derivative.backward(*flat)
        return [
            self.summed(k, getattr(found, k)) if asked and k in self.parts else None
            for k, asked in zip(AXES, wanted, strict=True)
        ]

    def summed(self, name: str, gradient: np.ndarray) -> np.ndarray:
        """Return a gradient summed over the axes along which its argument is shared."""
        shape = self.parts[name].shape
        if name in self.stacked:
            gradient = gradient.reshape(*self.lead, *gradient.shape[1:])
            padded = (1,) * (gradient.ndim - len(shape)) + shape
            shared = (k for k, size in enumerate(gradient.shape) if size != padded[k])
            gradient = gradient.sum(axis=tuple(shared))
        return gradient.reshape(shape)

    def forward(self, tangents: Sequence[Any]) -> Point:
        """Return the derivatives of x, y, z and z_box along a direction of the data.

        `tangents`: the changes of the arguments, shaped as these, None for no change.
        Items not solved have derivatives 0. K of `namlcp.derivatives.qp` is symmetric,
        so that a backward pass solves the forward one's system.
        """
        named = zip(AXES, tangents, strict=True)
        changes = {name: np.array(v) for name, v in named if v is not None}
        for name, change in changes.items():
            refuse_number(f"d{name}", change, False)
        point, sides = self.held.points, self.held.sides[:, self.points.z.shape[1] :]
        rights = right_sides(self.flattened(changes), point, sides)
        rights = tuple(map(np.broadcast_to, rights, map(np.shape, point)))
        q, h, b, lb, ub = self.derivative.solve(rights).vectors
        return Point(*self.shaped((-q, b, h, lb + ub)))

    @cached_property
    def derivative(self) -> BatchDerivative:
        """That of all items; a single QP is one, too."""
        items, used = self.items or Items(self.flat), self.solved.reshape(-1)
        return BatchDerivative(items, self.points, used, self.threads)

    @cached_property
    def held(self) -> Any:
        """The constraints held of each item, and the solution with multipliers used."""
        return self.derivative.solve((None,) * 4)

    def faces(self) -> list[np.ndarray]:
        """Return which rows of G are held, the side of each x_j, and y and z used.

        A row is 1 where it is held active, else 0; a side -1 at a lower bound, 1 at an
        upper one, else 0.
        """
        sides = np.split(self.held.sides, [self.points.z.shape[1]], axis=1)
        return self.shaped((*sides, self.held.points.y, self.held.points.z))


def lead_of(name: str, part: np.ndarray) -> tuple[int, ...]:
    if part.ndim < AXES[name]:
        raise ValueError(
            f"{name} must have at least {AXES[name]} axes, got shape {part.shape}"
        )
    return part.shape[: part.ndim - AXES[name]]
