"""Where the sweep methods fail: maps over their parameters, classes and conditioning.

run
    stability.csv: every method on one problem of each class (`sweep_scenes`), over c
    in Omega = c D and alpha. stability-units.csv: every method on Example 1, over
    delta and the unit of A and q.
    A cell is the number of sweeps to Res < 1e-6 Res(z_0), or what happened instead
    within CAP sweeps: "slow" (Res falls steadily), "cycles" (bounded, no
    measurable progress: periodic or wandering), "diverges" (Res grows without bound).
plot
    The figures of both.

Without a subcommand: both.

mgs, namgs and amgs are msor, namsor and amsor at alpha = 1; namj is namaor at alpha = 1
with beta = 0; psor is amsor at c = 1/alpha and pgs the point (1, 1) of that: one map
shows them all. maor and namaor have beta = 0 here, beta = alpha being msor and namsor.
"""

import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import linregress

from namlcp import Status, natural_residual, solve_lcp
from namlcp.lcp import SWEEPS
from validation.harness import Row, cli, csv_files
from validation.paper import stability_figures
from validation.problems import sweep_scenes

EPS = 1e-6  # of Res(z_0)
CAP, FACTORED_CAP = 2000, 1000  # sweeps at most, and those with a factorisation
GROWN = 1e3  # Res / Res(z_0) that is divergence and no cycle
STEADY = 20.0  # | slope of log Res | / its standard error, over the second half


class Map(NamedTuple):
    """A method whose alpha and c are varied; shift: I, D (None: it has none)."""

    method: str
    shift: str | None = None
    beta: float | None = None
    axes: str = "alpha c"


MAPS = (
    Map("msor"), Map("maor", beta=0.0), Map("namsor", "I"), Map("namsor", "D"),
    Map("namaor", "I", beta=0.0), Map("namaor", "D", beta=0.0), Map("amsor"),
)  # fmt: skip
STRIPS = (
    Map("psor", axes="alpha"), Map("modulus", axes="c"), Map("nam", "I", axes="c"),
    Map("nam", "D", axes="c"), Map("modified-nam", "I", axes="c I"),
    Map("modified-nam", "D", axes="c I"),
)  # fmt: skip
"""Methods with one parameter; "c I" means Omega = c I."""

BETAS = {"maor": 0.0, "namaor": 0.45}
SHIFTED = "namj namgs namsor namaor nam modified-nam"
UNITS = [
    Map(method, shift, BETAS.get(method))
    for methods, shift in (
        ("mgs msor maor amgs amsor pgs psor", None), (SHIFTED, "I"),
        ("modulus", None), (SHIFTED, "D"),
    )
    for method in methods.split()
]  # fmt: skip
ALPHA, ALPHAS = 0.9, {"modified-nam": 5.0}
"""alpha of UNITS, where Omega has its default: the paper's, or D/alpha for am*."""
DELTAS = (4.0, 2.0, 1.0, 0.5, 0.25, 0.1, 0.03, 0.01, 0.0)


def outcome(
    scene: sweep_scenes.Scene, method: str, cap: int, **given: Any
) -> int | str:
    """Return the number of sweeps, or what happened instead.

    The library's own verdict ends a run early; here growth is told from a cycle, and
    what is still falling from what is not.
    """
    box = scene.lower, scene.upper
    start = np.clip(0.0, *box)
    first = natural_residual(start, scene.A @ start + scene.q, *box)
    result = solve_lcp(
        scene.A, scene.q, *box, method=method,
        eps_abs=EPS * first, max_iter=cap, history=True, **given,
    )  # fmt: skip
    if result.status is Status.SOLVED:
        return result.iterations
    if result.status is Status.NUMERICAL_ERROR:
        return "diverges"
    residuals = result.history["residual"]
    if not residuals[-1] <= GROWN * first:
        return "diverges"
    if result.status is Status.MAX_ITER:
        y = np.log(residuals[cap // 2 :])
        line = linregress(np.arange(y.size), y)
        if abs(line.slope) > STEADY * line.stderr:
            return "slow" if line.slope < 0.0 else "diverges"
    return "cycles"


def parameters(scene: sweep_scenes.Scene, chart: Map, alpha: float, c: float) -> Row:
    """Return the keyword arguments of one cell."""
    D = scene.A.diagonal()
    given: Row = {"shift": {"I": 1.0, "D": D}.get(chart.shift), "beta": chart.beta}
    if "alpha" in chart.axes:
        given["alpha"] = alpha
    if chart.axes == "c I":
        given["alpha"] = c
    elif "c" in chart.axes:
        given["omega"] = c * D
    return given


def key(name: str, chart: Map) -> Row:
    shift = chart.shift or ""
    return {"class": name, "method": chart.method, "shift": shift, "axes": chart.axes}


def class_rows() -> Iterator[Row]:
    """Yield a row for each class, method and c with a column for each alpha."""
    alphas = np.linspace(0.1, 1.9, 19)
    powers = np.linspace(-5.0, 4.0, 19)
    strip = np.linspace(-8.0, 8.0, 33)
    line = np.linspace(0.05, 1.95, 33)
    for scene in sweep_scenes.problem_classes():
        for chart in MAPS:
            for c in 2.0 ** powers[::-1]:
                row = key(scene.name, chart) | {"c": c}
                for alpha in alphas:
                    given = parameters(scene, chart, alpha, c)
                    cell = outcome(scene, chart.method, CAP, **given)
                    row[f"{alpha:.2f}"] = cell
                yield row
        for chart in STRIPS:
            cap = CAP if chart.axes == "alpha" else FACTORED_CAP
            for x in line if chart.axes == "alpha" else 2.0**strip:
                given = parameters(scene, chart, x, x)
                cell = outcome(scene, chart.method, cap, **given)
                yield key(scene.name, chart) | {"c": x, "only": cell}
        print(scene.name, flush=True)


def unit_rows() -> Iterator[Row]:
    """Yield a row for each method and delta with a column for each unit.

    A and q are multiplied by the unit; the tolerance is relative, so that nothing
    should change.
    """
    for chart, delta in itertools.product(UNITS, DELTAS):
        base = sweep_scenes.paper_example(1, 20, delta)
        row = key("Example 1", chart) | {"delta": delta}
        for exponent in np.arange(-6, 7):
            unit = 10.0 ** float(exponent)
            scene = base._replace(A=unit * base.A, q=unit * base.q)
            given = parameters(scene, chart._replace(axes=""), 0.0, 0.0)
            if "alpha" in SWEEPS[chart.method].takes:
                given["alpha"] = ALPHAS.get(chart.method, ALPHA)
            row[f"{exponent:d}"] = outcome(scene, chart.method, CAP, **given)
        yield row


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__, "results", "figures")
    parser.add_argument("part", nargs="?", choices=("run", "plot"))
    args = parser.parse_args(arguments)
    if args.part in (None, "run"):
        header = cli.begin([], f"cells: {CAP} sweeps at most")
        rows = list(class_rows())
        names = dict.fromkeys(itertools.chain.from_iterable(rows), "")
        rows = [names | row for row in rows]
        csv_files.write(args.results / "stability.csv", header, rows)
        rows = list(unit_rows())
        csv_files.write(args.results / "stability-units.csv", header, rows)
    if args.part in (None, "plot"):
        stability_figures.plot(args.results, args.figures)
    return 0
