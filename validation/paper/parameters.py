"""How good omega="auto" and alpha="auto" are beside the best point of a grid.

For every scene and every sweep method: the fewest sweeps to Res(z) < 1e-6 Res(0) over
alpha and c, Omega = c D, within CAP sweeps (grid_*), and what the choice of the package
needs (auto_*). `products` are the products with A of its estimates, about half a sweep
each, which `ratio` = auto_sweeps / grid_sweeps leaves out. "none" in grid_sweeps: no
point of the grid converges.

The scenes were fixed on 2026-11-21, before any choice was tuned. maor and namaor have
beta = 1 (without a beta they are msor and namsor), "nam" and "modified-nam" E = D, and
"modified-nam" alpha = c times the geometric mean of D.
"""

import itertools
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from namlcp import Prepared, Status, natural_residual
from namlcp.lcp.data import LCP
from namlcp.lcp.modulus.methods import SWEEPS, Parameters, Step
from namlcp.lcp.modulus.sweeps import AdaptiveStep, iterate, step_of
from namlcp.limits import Limits
from validation.harness import Job, Row
from validation.harness.suite import Args, Suite
from validation.problems import data_sets, known_scenes, sweep_scenes

EPS_REL = 1e-6  # of Res(0)
WANTED = 1.3  # sweeps over those of the best point, at most
BETA = 1.0  # of maor and namaor
DELTAS = (4.0, 1.0, 0.0)
M = 40  # nodes on a side of the scenes
ALPHAS = (*(0.1 * k for k in range(2, 20)), 1.95)
CS = (0.001, 0.003, *np.geomspace(0.01, 10.0, 25))
CAP, FACTORED_CAP = 5000, 1000  # sweeps, and steps of a factored method


def scenes(data: Path) -> dict[str, known_scenes.BoxLCP]:
    found = {
        f"Example {k}, delta = {delta:g}": sweep_scenes.paper_example(k, M, delta)
        for k, delta in itertools.product((1, 2), DELTAS)
    }
    found["obstacle"] = known_scenes.obstacle(M)
    for name in ("fcp2d_367", "capsules_286", "granular2d_2020", "kaplas_570"):
        found[name] = sweep_scenes.contact(data, name)
    X, y = data_sets.heart_scale(data)
    found["random SPD"] = sweep_scenes.random_spd(200)
    return found | {"SVM heart": known_scenes.svm_rbf(X, y, 1.0 / 13.0)}


def points(method: str) -> Iterator[tuple[float | None, float]]:
    """Yield (alpha, c), from the middle of the grid outwards."""
    takes = SWEEPS[method].takes
    alphas: tuple[float | None, ...] = ALPHAS if "alpha" in takes else (None,)
    cs = CS if "omega" in takes else (math.nan,)
    if method == "modified-nam":
        alphas = (1.0,)  # only the product of the two counts
    for c in sorted(cs, key=lambda c: abs(math.log(c)) if c == c else 0.0):
        for alpha in sorted(alphas, key=lambda alpha: abs((alpha or 1.0) - 1.0)):
            yield alpha, c


def compare(_: Job, scene: known_scenes.BoxLCP, is_example: bool, method: str) -> Row:
    A, q, lower, upper = scene
    lcp, D, chosen = LCP(Prepared(A), q, lower, upper), A.diagonal(), SWEEPS[method]
    zero = np.clip(np.zeros_like(q), lower, upper)
    start = sweep_scenes.paper_start(M) if is_example else zero
    eps = EPS_REL * natural_residual(zero, A @ zero + q, lower, upper)
    cap = FACTORED_CAP if chosen.factored else CAP
    beta = BETA if "beta" in chosen.takes else None

    def sweeps(step: Step | None, most: int) -> float:
        """Return the sweeps to the tolerance, inf if there are more."""
        if step is None:
            return math.inf
        status, _, k = iterate(lcp, step, start, Limits(eps, max_iter=most))
        return k if status is Status.SOLVED else math.inf

    def step_at(alpha: float | None, c: float) -> Step | None:
        if chosen.factored:
            size = D if alpha is None else math.exp(np.mean(np.log(D)))
            omega = np.full_like(D, c * size)
            given = Parameters(omega=omega, shift=D if chosen.own else None)
        else:
            omega = c * D if "omega" in chosen.takes else None
            given = Parameters(alpha, beta, omega)
        return step_of(lcp, method, given)

    best, where = math.inf, (None, math.nan)
    for point in points(method):
        count = sweeps(step_at(*point), int(min(cap, best - 1)))
        if count < best:
            best, where = count, point
    alpha = "auto" if "alpha" in chosen.takes else None
    fixed = "omega" not in chosen.takes or method == "modified-nam"
    step = AdaptiveStep(lcp, method, Parameters(alpha, beta, None if fixed else "auto"))
    auto, products = sweeps(step, cap), step.products
    counts = ("none" if k == math.inf else k for k in (best, auto))
    row: Row = dict(zip(("grid_sweeps", "auto_sweeps"), counts, strict=True))
    row |= {"n": q.size, "grid_alpha": where[0], "grid_c": where[1]}
    row |= {"auto_alpha": step.alpha if alpha else None, "products": products}
    row |= {"auto_c": float(np.mean(step.omega / D)), "ratio": math.nan}
    row["ratio_with_products"] = math.nan
    if best < math.inf:
        row["ratio"] = auto / best
        row["ratio_with_products"] = (auto + 0.5 * products) / best
    return row | {"within": best == math.inf or row["ratio"] <= WANTED}


def requests(args: Args) -> Iterator[Row]:
    for name, scene in scenes(args.data).items():
        for method in (method for method, sweep in SWEEPS.items() if sweep.takes):
            ask = scene, "Example" in name, method
            yield {"scene": name, "method": method, "ask": ask}


SUITE = Suite(
    name="parameters", requests=requests, work=compare,
    columns=(
        "scene method | n grid_alpha grid_c grid_sweeps auto_alpha auto_c auto_sweeps "
        "products ratio ratio_with_products within"
    ),
    limit=3600.0, needs_data=True,
)  # fmt: skip
