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
from namlcp.lcp import LCP, SWEEPS, Parameters
from namlcp.lcp.modulus.adaptive import AdaptiveStep
from namlcp.lcp.modulus.methods import Step
from namlcp.lcp.modulus.sweeps import iterate, step_of
from namlcp.limits import Limits
from validation.harness import Job, Row
from validation.harness.suite import Args, Suite
from validation.problems import data_sets, known_scenes, sweep_scenes
from validation.problems.classics import forced_obstacle

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
    found["obstacle"] = sweep_scenes.halfline(*forced_obstacle(M))
    for name in ("fcp2d_367", "capsules_286", "granular2d_2020", "kaplas_570"):
        found[name] = sweep_scenes.contact(data, name)
    X, y = data_sets.heart_scale(data)
    found["random SPD"] = sweep_scenes.random_spd(200)
    return found | {"SVM heart": known_scenes.svm_rbf(X, y, 1.0 / 13.0)}


class Run:
    """A scene with its start and its stop."""

    def __init__(self, scene: known_scenes.BoxLCP, is_example: bool) -> None:
        A, q, lower, upper = scene
        self.lcp = LCP(Prepared(A), q, lower, upper)
        self.D = np.array(A.diagonal())
        zero = np.clip(np.zeros_like(q), lower, upper)
        self.start = sweep_scenes.paper_start(M) if is_example else zero
        self.eps = EPS_REL * natural_residual(zero, A @ zero + q, lower, upper)

    def sweeps(self, step: Step | None, cap: int) -> float:
        if step is None:
            return math.inf
        limits = Limits(self.eps, max_iter=cap)
        status, _, k = iterate(self.lcp, step, self.start, limits)
        return k if status is Status.SOLVED else math.inf

    def step(self, method: str, alpha: float | None, c: float) -> Step | None:
        chosen = SWEEPS[method]
        if chosen.factored:
            size = self.D if alpha is None else math.exp(np.mean(np.log(self.D)))
            omega = np.full_like(self.D, c * size)
            given = Parameters(omega=omega, shift=self.D if chosen.own else None)
            return step_of(self.lcp, method, given)
        omega = c * self.D if "omega" in chosen.takes else None
        return step_of(self.lcp, method, Parameters(alpha, beta_of(method), omega))


def beta_of(method: str) -> float | None:
    return BETA if "beta" in SWEEPS[method].takes else None


def points(method: str) -> Iterator[tuple[float | None, float]]:
    takes = SWEEPS[method].takes
    alphas: tuple[float | None, ...] = ALPHAS if "alpha" in takes else (None,)
    cs = CS if "omega" in takes else (math.nan,)
    if method == "modified-nam":
        alphas = (1.0,)  # only the product of the two counts
    for c in sorted(cs, key=lambda c: abs(math.log(c)) if c == c else 0.0):
        for alpha in sorted(alphas, key=lambda alpha: abs((alpha or 1.0) - 1.0)):
            yield alpha, c


def compare(_: Job, scene: known_scenes.BoxLCP, is_example: bool, method: str) -> Row:
    run, chosen = Run(scene, is_example), SWEEPS[method]
    cap = FACTORED_CAP if chosen.factored else CAP
    best, where = math.inf, (None, math.nan)
    for point in points(method):
        limit = int(min(cap, best - 1))
        count = run.sweeps(run.step(method, *point), limit)
        if count < best:
            best, where = count, point
    alpha = "auto" if "alpha" in chosen.takes else None
    fixed = "omega" not in chosen.takes or method == "modified-nam"
    given = Parameters(alpha, beta_of(method), None if fixed else "auto")
    step = AdaptiveStep(run.lcp, method, given)
    auto, products = run.sweeps(step, cap), step.products
    row: Row = {"n": scene.q.size}
    row |= {"grid_alpha": where[0], "grid_c": where[1], "grid_sweeps": shown(best)}
    row |= {"auto_alpha": step.alpha if alpha else None}
    row |= {"auto_c": float(np.mean(step.omega / run.D)), "auto_sweeps": shown(auto)}
    row |= {"products": products, "ratio": math.nan, "ratio_with_products": math.nan}
    if best < math.inf:
        row["ratio"] = auto / best
        row["ratio_with_products"] = (auto + 0.5 * products) / best
    return row | {"within": best == math.inf or row["ratio"] <= WANTED}


def shown(sweeps: float) -> float | str:
    return "none" if sweeps == math.inf else sweeps


def requests(args: Args) -> Iterator[Row]:
    for name, scene in scenes(args.data).items():
        for method in (method for method, sweep in SWEEPS.items() if sweep.takes):
            ask = lambda each=(scene, "Example" in name, method): each  # noqa: E731
            yield {"scene": name, "method": method, "ask": ask}


SUITE = Suite(
    name="parameters",
    requests=requests,
    work=compare,
    columns=(
        "scene method | n grid_alpha grid_c grid_sweeps auto_alpha auto_c auto_sweeps "
        "products ratio ratio_with_products within"
    ),
    limit=3600.0,
    needs_data=True,
)
