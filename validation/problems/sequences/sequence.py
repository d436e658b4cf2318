"""What a sequence is."""

from collections.abc import Callable, Generator
from typing import NamedTuple

import numpy as np
from qpsolvers import Problem

LEVELS = ("stays", "moves a little", "moves a lot")
"""What the active set does between steps."""

Vectors = dict[str, np.ndarray]
"""New values of some of q, h, b, lb and ub."""

Steps = Generator[Vectors, np.ndarray | None, None]
"""Yields what changes; is sent the solution, None where there is none."""


class Sequence(NamedTuple):
    """The first problem, and a loop that changes its vectors.

    A loop that is sent None has asked for what is impossible, and asks for less.
    """

    problem: Problem
    steps: Steps


class Scene(NamedTuple):
    """make(size, level) for each of `sizes`, and what a size counts."""

    make: Callable[[int, str], Sequence]
    sizes: tuple[int, ...]
    unit: str
