"""How good omega="auto" and alpha="auto" are beside the best point of a grid.

Usage::

    python validation/parameters.py --data DATA [--held-out] [--quick]
        [--results DIR]

For every scene and every sweep method: the fewest sweeps to Res(z) < 1e-6 Res(0) over
alpha and c, Omega = c D, within CAP sweeps (grid_alpha, grid_c, grid_sweeps), and what
the choice of the package needs (auto_sweeps, with its last alpha and c). `products`
are the products with A of its estimates, about half a sweep each, which `ratio` =
auto_sweeps / grid_sweeps leaves out and `ratio_with_products` counts. The wanted ratio
is 1.3 at most; "none" in grid_sweeps: no point of the grid converges.

parameters.csv has the scenes of the issue, fixed on 2026-11-21 at 10:50, before any
choice was tuned. With --held-out, parameters-held-out.csv has scenes that tuned no
constant. They were not left without effect: the first set showed that c was far too
large for a dominant diagonal with many active bounds (two formulas changed), the second
("later") that iterates may wander without growth (the rule STANDING was added).
--quick takes smaller scenes and a coarse grid.

maor and namaor have beta = 1 (without a beta they are msor and namsor), "nam" and
"modified-nam" E = D, and "modified-nam" alpha = c times the geometric mean of D.
"""

import argparse
import math
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmark import machine_lines, use_one_thread
from lcp import write_csv
from namlcp import Prepared, Status
from namlcp.lcp.data import LCP
from namlcp.lcp.modulus.adaptive import adaptive_step
from namlcp.lcp.modulus.methods import METHODS, Parameters
from namlcp.lcp.modulus.sweeps import iterate, step_of
from namlcp.lcp.modulus.triangular import Step
from namlcp.limits import Limits
from namlcp.residuals import natural_residual
from problems import MissingDataError
from sweep_scenes import (
    Scene,
    contact,
    hertz,
    nonsymmetric_h_plus,
    obstacle,
    paper_example,
    problem_classes,
    random_spd,
    spd_not_h,
    svm_generated,
    svm_heart,
    with_contact,
)

Row = dict[str, Any]
HERE = Path(__file__).parent
EPS_REL = 1e-6
WANTED = 1.3
BETA = 1.0
DELTAS = (4.0, 1.0, 0.0)


class Effort(NamedTuple):
    """Size of the scenes, the grid, and the sweeps (factored: steps) of a run."""

    m: int
    alphas: tuple[float, ...]
    cs: tuple[float, ...]
    cap: int
    factored_cap: int


FULL = Effort(
    40,
    (*(0.1 * k for k in range(2, 20)), 1.95),
    (0.001, 0.003, *np.geomspace(0.01, 10.0, 25)),
    5000,
    1000,
)
QUICK = Effort(
    20, (0.4, 0.7, 1.0, 1.3, 1.6, 1.9), (*np.geomspace(0.01, 10.0, 10),), 1000, 300
)


def scenes(data: Path, m: int) -> list[Scene]:
    """Return the list of the issue."""
    found = [paper_example(number, m, delta) for number in (1, 2) for delta in DELTAS]
    found.append(obstacle(m))
    names = ("fcp2d_367", "capsules_286", "granular2d_2020", "kaplas_570")
    found += [contact(data, name) for name in names]
    return [*found, random_spd(200), svm_heart(data)]


def held_out(data: Path, m: int) -> list[Scene]:
    """Return scenes that tuned no constant."""
    found = []
    for number in (1, 2):
        for delta in DELTAS:
            scene = with_contact(paper_example(number, m, delta), 7)
            found.append(scene._replace(name=f"{scene.name}, contact"))
    names = ("confeti_54", "granular2d_g230", "boxstacks_g82", "mj_stack10")
    found += [contact(data, name) for name in (*names, "mj_pile40")]
    found += problem_classes()
    last = random_spd(150, 1e3, 5)._replace(name="random SPD, condition 1000")
    return [*found, last, svm_generated(300)]


def held_out_later(data: Path, m: int) -> list[Scene]:
    """Return scenes that were run after what the first set showed was corrected."""
    few = with_contact(paper_example(1, m, 0.25), 11)
    found = [
        few._replace(name="Example 1, delta = 0.25, contact"),
        random_spd(120, 30.0, 9),
        spd_not_h(200, 3, 4),
        nonsymmetric_h_plus(300, 0.7, 3),
        svm_generated(200, 5),
        hertz(12),
    ]
    found += [contact(data, name) for name in ("nespheres_44", "oneobject_25")]
    return [scene._replace(name=f"later: {scene.name}") for scene in found]


class Bench:
    """A scene with its start and its stop."""

    def __init__(self, scene: Scene):
        self.scene = scene
        self.lcp = LCP(Prepared(scene.A), scene.q, scene.lower, scene.upper)
        self.D = np.array(scene.A.diagonal())
        self.zero = np.clip(np.zeros_like(scene.q), scene.lower, scene.upper)
        w = scene.A @ self.zero + scene.q
        size = natural_residual(self.zero, w, scene.lower, scene.upper)
        self.eps = EPS_REL * size

    def sweeps(self, step: Step | None, cap: int) -> int | None:
        """Return the sweeps to the tolerance, None if there are more than `cap`."""
        scene = self.scene
        if step is None:
            return None
        s = self.zero if scene.s0 is None else scene.s0
        status, _, k = iterate(self.lcp, step, s, Limits(self.eps, max_iter=cap))
        return k if status is Status.SOLVED else None

    def step(self, method: str, alpha: float | None, c: float) -> Step | None:
        """Return a step at a point of the grid."""
        chosen = METHODS[method]
        if chosen.factored:
            size = self.D if alpha is None else math.exp(np.mean(np.log(self.D)))
            omega = np.full_like(self.D, c * size)
            given = Parameters(omega=omega, shift=self.D if chosen.own else None)
            return step_of(self.lcp, method, given)
        omega = c * self.D if "omega" in chosen.takes else None
        return step_of(self.lcp, method, Parameters(alpha, beta_of(method), omega))


def beta_of(method: str) -> float | None:
    """Return beta for the methods that have one."""
    return BETA if "beta" in METHODS[method].takes else None


def points(method: str, effort: Effort) -> Iterator[tuple[float | None, float]]:
    """Yield (alpha, c), from the middle of the grid outwards."""
    takes = METHODS[method].takes
    alphas: tuple[float | None, ...] = effort.alphas if "alpha" in takes else (None,)
    cs = effort.cs if "omega" in takes else (math.nan,)
    if method == "modified-nam":
        alphas = (1.0,)  # only the product of the two counts
    for c in sorted(cs, key=lambda c: abs(math.log(c)) if c == c else 0.0):
        for alpha in sorted(alphas, key=lambda alpha: abs((alpha or 1.0) - 1.0)):
            yield alpha, c


def compare(bench: Bench, method: str, effort: Effort) -> Row:
    """Return the best point of the grid and the choice of the package."""
    scene, chosen = bench.scene, METHODS[method]
    cap = effort.factored_cap if chosen.factored else effort.cap
    best: int | None = None
    where: tuple[float | None, float] = (None, math.nan)
    for point in points(method, effort):
        limit = cap if best is None else best - 1
        count = bench.sweeps(bench.step(method, *point), limit)
        if count is not None:
            best, where = count, point
    auto_alpha = "auto" if "alpha" in chosen.takes else None
    auto_omega = "auto" if "omega" in chosen.takes else None
    if method == "modified-nam":
        auto_omega = None
    given = Parameters(auto_alpha, beta_of(method), auto_omega)
    step = adaptive_step(bench.lcp, method, given)
    auto = bench.sweeps(step, cap)
    products = step.choice.spectrum.products
    row: Row = {
        "scene": scene.name,
        "n": scene.q.size,
        "method": method,
        "grid_alpha": where[0],
        "grid_c": where[1],
        "grid_sweeps": "none" if best is None else best,
        "auto_alpha": step.alpha if auto_alpha else None,
        "auto_c": float(np.mean(step.omega / bench.D)),
        "auto_sweeps": "none" if auto is None else auto,
        "products": products,
    }
    row["ratio"] = row["ratio_with_products"] = math.nan
    if best is not None:
        row["ratio"] = math.inf if auto is None else auto / best
        total = math.inf if auto is None else auto + 0.5 * products
        row["ratio_with_products"] = total / best
    row["within"] = best is None or row["ratio"] <= WANTED
    return row


def show(row: Row) -> str:
    """Return a line of the table."""

    def number(value: float | None) -> str:
        return "-" if value is None or value != value else f"{value:.3g}"

    return (
        f"{row['scene'][:32]:32s} {row['method']:12s} "
        f"{row['grid_sweeps']:>5} ({number(row['grid_alpha'])}, "
        f"{number(row['grid_c'])})".ljust(70)
        + f"{row['auto_sweeps']:>5} ({number(row['auto_alpha'])}, "
        f"{number(row['auto_c'])})".ljust(24)
        + f"{row['ratio']:6.2f}{' ' if row['within'] else ' *'}"
    )


def main(arguments: list[str] | None = None) -> int:
    """Print the table and write it; return 2 if the data folder lacks something."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True, help="the data folder")
    parser.add_argument("--held-out", action="store_true")
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--results", type=Path, help="folder for the CSV file")
    args = parser.parse_args(arguments)
    use_one_thread()
    effort = QUICK if args.quick else FULL
    try:
        found = scenes(args.data, effort.m)
        if args.held_out:
            found = held_out(args.data, effort.m)
            found += held_out_later(args.data, effort.m)
    except MissingDataError as error:
        print(error, file=sys.stderr)
        return 2
    header = machine_lines([])
    print("\n".join(header))
    begin = time.perf_counter()
    rows = []
    for scene in found:
        bench = Bench(scene)
        for method in METHODS:
            if not METHODS[method].takes:
                continue
            rows.append(compare(bench, method, effort))
            print(show(rows[-1]), flush=True)
    cells = [row for row in rows if row["grid_sweeps"] != "none"]
    within = sum(row["within"] for row in cells)
    print(
        f"{within} of {len(cells)} cells within {WANTED} of the best point; no point "
        f"converges in {len(rows) - len(cells)}; {time.perf_counter() - begin:.0f} s"
    )
    folder = args.results or (None if args.quick else HERE / "results")
    if folder is not None:
        name = "parameters-held-out.csv" if args.held_out else "parameters.csv"
        write_csv(folder / name, header, rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
