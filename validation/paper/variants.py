"""Which methods the paper's problems are given to, and their best parameters."""

import itertools
import math
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from namlcp import Status, solve_lcp
from validation.paper.printed import EPS, SIZES
from validation.problems import sweep_scenes

CAP = 5000
"""Sweeps at most; n = 10^4 at delta = 0 needs more of some methods."""
FACTORED_CAP = 500
"""Iterations at most of the methods that factor once: each costs over ten sweeps."""
RELAXATIONS, LOGARITHMS = (0.6, 1.0, 1.4, 1.8), (-4.0, -2.0, -1.0, 0.0, 1.0, 2.0)
"""Where the search starts."""
STEP, SMALLEST = 0.2, 0.003
SWEEPS = 100_000
SKEW = 4  # random directions in a step, along narrow valleys

Point = tuple[float, ...]


class Variant(NamedTuple):
    """A method with the parameters that are `tuned`: alpha, beta, c (Omega = c D).

    The other parameters are the paper's: Omega = D/(2 alpha^2), shift 1.0, and the
    printed alpha where `printed` gives it for Example 1 and 2.
    """

    label: str
    method: str
    tuned: tuple[str, ...] = ()
    printed: tuple[float, float] | None = None
    c: float | None = None

    @property
    def factored(self) -> bool:
        """Whether an iteration is a solve with factors of A + ..., not a sweep."""
        return self.method in ("modulus", "nam", "modified-nam")

    @property
    def cap(self) -> int:
        """Iterations at most."""
        return FACTORED_CAP if self.factored else CAP


VARIANTS = (
    Variant("MGS, paper", "mgs"),
    Variant("NAMGS, paper", "namgs"),
    Variant("MSOR, paper", "msor", printed=(0.85, 0.88)),
    Variant("NAMSOR, paper", "namsor", printed=(0.91, 0.88)),
    Variant("NAM, Omega = I", "nam"),
    Variant("modified NAM, best alpha", "modified-nam", ("alpha",)),
    Variant("NAMJ, Omega = D/2", "namj"),
    Variant("NAMAOR, best alpha, beta", "namaor", ("alpha", "beta")),
    Variant("NAMGS, best Omega", "namgs", ("c",)),
    Variant("NAMSOR, best alpha, Omega", "namsor", ("alpha", "c")),
    Variant("modulus, best Omega", "modulus", ("c",)),
    Variant("MGS, best Omega", "mgs", ("c",)),
    Variant("MSOR, best alpha, Omega", "msor", ("alpha", "c")),
    Variant("MAOR, best alpha, beta, Omega", "maor", ("alpha", "beta", "c")),
    Variant("AMGS, Omega = D/2", "amgs", c=0.5),
    Variant("AMGS, best Omega", "amgs", ("c",)),
    Variant("AMSOR, best alpha, Omega", "amsor", ("alpha", "c")),
    Variant("PGS, no parameter", "pgs"),
    Variant("PSOR, best alpha", "psor", ("alpha",)),
)


def arguments(
    variant: Variant, values: dict[str, float], scene: sweep_scenes.Scene
) -> Any:
    given: dict[str, Any] = {k: v for k, v in values.items() if k != "c"}
    if "c" in values:
        given["omega"] = values["c"] * scene.A.diagonal()
    if variant.method in ("namj", "namgs", "namsor", "namaor"):
        given["shift"] = 1.0
    return given


def is_free(variant: Variant, name: str) -> bool:
    """Tell whether a parameter moves on a logarithmic scale, not on one of (0, 2)."""
    return name == "c" or variant.method == "modified-nam"


def named(variant: Variant, point: Point) -> dict[str, float]:
    """Return the parameter values of a point, the fixed ones included."""
    pairs = zip(variant.tuned, point, strict=True)
    values = {name: 2.0**x if is_free(variant, name) else x for name, x in pairs}
    return {name: float(x) for name, x in values.items()}


def search(
    scene: sweep_scenes.Scene, variant: Variant, fixed: dict[str, float], last: Point
) -> Point:
    """Return the parameters with the fewest sweeps; `last` is a start, if not empty.

    A pattern search from the best point of a grid and of the last size: all neighbours
    at a distance of one step, and a few others; the step is halved if none is better.
    A run ends when it cannot win, the search after SWEEPS sweeps. Equal counts are
    decided by Res. It is a local search: where counts are in the hundreds, some per
    cent may be missing.
    """
    spent = 0

    def cost(point: Point, limit: float) -> tuple[float, float]:
        """Return sweeps and Res, infinite if they would be more than `limit`."""
        nonlocal spent
        values = fixed | named(variant, point)
        alpha, beta = values.get("alpha", 1.0), values.get("beta", 1.0)
        relaxed = variant.method != "modified-nam"
        if relaxed and not (0.0 < alpha < 2.0 and 0.0 <= beta < 2.0):
            return math.inf, math.inf
        result = solve_lcp(
            scene.A, scene.q, scene.lower, scene.upper, method=variant.method,
            s0=scene.s0, eps_abs=EPS, max_iter=int(min(variant.cap, limit)),
            **arguments(variant, values, scene),
        )  # fmt: skip
        spent += result.iterations
        solved = result.status is Status.SOLVED
        return result.iterations if solved else math.inf, result.residual

    def better(points: Iterable[Point], best: tuple[Any, Point]) -> tuple[Any, Point]:
        for point in points:
            best = min(best, (cost(point, best[0][0]), point))
        return best

    starts = [last] if last else []
    if not (last and variant.factored):
        free = (is_free(variant, name) for name in variant.tuned)
        starts += itertools.product(*(LOGARITHMS if f else RELAXATIONS for f in free))
    best = better(starts, ((math.inf, math.inf), starts[0]))
    n, rng, step = len(variant.tuned), np.random.default_rng(0), STEP
    whole = [d for d in itertools.product((-1, 0, 1), repeat=n) if any(d)]
    while step > SMALLEST and spent < SWEEPS:
        skew = rng.standard_normal((SKEW, n))
        around = [
            tuple(x + step * y for x, y in zip(best[1], d, strict=True))
            for d in (*whole, *(skew if n > 1 else ()))
        ]
        before, best = best[0], better(around, best)
        if best[0] == before:
            step /= 2.0
    return best[1]


def best_values(example: int, delta: float, variant: Variant) -> list[dict[str, float]]:
    """Return the parameter values for each of SIZES, found in their order."""
    fixed = {} if variant.c is None else {"c": variant.c}
    if variant.printed is not None:
        fixed["alpha"] = variant.printed[example - 1]
    found, point = [], ()
    for m in SIZES:
        if variant.tuned:
            scene = sweep_scenes.paper_example(example, m, delta)
            point = search(scene, variant, fixed, point)
        found.append(fixed | named(variant, point))
    return found
