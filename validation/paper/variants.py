"""Which methods the paper's problems are given to, and their best parameters."""

import itertools
import math
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
    """Return the keyword arguments of the method for parameter values."""
    given: dict[str, Any] = {k: v for k, v in values.items() if k != "c"}
    if "c" in values:
        given["omega"] = values["c"] * scene.A.diagonal()
    if variant.method in ("namj", "namgs", "namsor", "namaor"):
        given["shift"] = 1.0
    return given


class Tuner:
    """Find the parameters with the fewest sweeps, at one size after the other.

    A pattern search from the best point of a grid and of the last size: all neighbours
    at a distance of one step, and a few others; the step is halved if none is better.
    A run ends when it cannot win, the search after SWEEPS sweeps. Equal counts are
    decided by Res. alpha and beta move on a scale of (0, 2), c and the alpha of
    "modified-nam" (Omega = alpha I) on a logarithmic one. It is a local search: where
    counts are in the hundreds, some per cent may be missing.
    """

    STEP, SMALLEST = 0.2, 0.003
    SWEEPS = 100_000
    SKEW = 4  # random directions in a step, along narrow valleys

    def __init__(self, variant: Variant, example: int):
        self.variant, self.tuned = variant, variant.tuned
        self.point: Point | None = None
        self.spent = 0
        self.fixed: dict[str, float] = {}
        if variant.printed is not None:
            self.fixed["alpha"] = variant.printed[example - 1]
        if variant.c is not None:
            self.fixed["c"] = variant.c

    def values(self, scene: sweep_scenes.Scene) -> dict[str, float]:
        """Return the best parameter values for a scene, the fixed ones included."""
        if not self.variant.tuned:
            return self.fixed
        self.spent = 0
        starts = [self.point] if self.point else []
        if not (self.point and self.variant.factored):
            grids = [LOGARITHMS if self.free(n) else RELAXATIONS for n in self.tuned]
            starts += itertools.product(*grids)
        best, point = self.better(scene, starts, ((math.inf, math.inf), starts[0]))
        whole = [d for d in itertools.product((-1, 0, 1), repeat=len(point)) if any(d)]
        rng = np.random.default_rng(0)
        step = self.STEP
        while step > self.SMALLEST and self.spent < self.SWEEPS:
            skew = rng.standard_normal((self.SKEW, len(point)))
            around = [
                tuple(x + step * y for x, y in zip(point, d, strict=True))
                for d in (*whole, *(skew if len(point) > 1 else ()))
            ]
            found = best
            best, point = self.better(scene, around, (best, point))
            if best == found:
                step /= 2.0
        self.point = point
        return self.fixed | self.named(point)

    def better(
        self, scene: sweep_scenes.Scene, points: list[Point], best: tuple[Any, Point]
    ) -> tuple[Any, Point]:
        """Return the least (cost, point) among `best` and the points."""
        for point in points:
            best = min(best, (self.cost(scene, point, best[0][0]), point))
        return best

    def free(self, name: str) -> bool:
        """Tell whether a parameter moves on a logarithmic scale."""
        return name == "c" or self.variant.method == "modified-nam"

    def named(self, point: Point) -> dict[str, float]:
        """Return the parameter values of a point."""
        pairs = zip(self.tuned, point, strict=True)
        return {name: float(2.0**x if self.free(name) else x) for name, x in pairs}

    def cost(
        self, scene: sweep_scenes.Scene, point: Point, limit: float
    ) -> tuple[float, float]:
        """Return sweeps and Res, infinite if they would be more than `limit`."""
        values = self.fixed | self.named(point)
        alpha, beta = values.get("alpha", 1.0), values.get("beta", 1.0)
        relaxed = self.variant.method != "modified-nam"
        if relaxed and not (0.0 < alpha < 2.0 and 0.0 <= beta < 2.0):
            return math.inf, math.inf
        result = solve_lcp(
            scene.A, scene.q, scene.lower, scene.upper, method=self.variant.method,
            s0=scene.s0, eps_abs=EPS, max_iter=int(min(self.variant.cap, limit)),
            **arguments(self.variant, values, scene),
        )  # fmt: skip
        self.spent += result.iterations
        if result.status is not Status.SOLVED:
            return math.inf, result.residual
        return result.iterations, result.residual


def best_values(example: int, delta: float, variant: Variant) -> list[dict[str, float]]:
    """Return the parameter values for each of SIZES, found in their order."""
    tuner = Tuner(variant, example)
    return [tuner.values(sweep_scenes.paper_example(example, m, delta)) for m in SIZES]
