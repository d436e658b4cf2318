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

Without a subcommand: both. --quick takes fewer cells and sweeps.

mgs, namgs and amgs are msor, namsor and amsor at alpha = 1; namj is namaor at alpha = 1
with beta = 0; psor is amsor at c = 1/alpha and pgs the point (1, 1) of that: one map
shows them all. maor and namaor have beta = 0 here, beta = alpha being msor and namsor.
"""

import itertools
import math
import sys
import time
from typing import Any, NamedTuple

import numpy as np

from namlcp import Status, solve_lcp
from namlcp.lcp import SWEEPS
from validation.harness import Row, cli, csv_files
from validation.paper import stability_figures
from validation.problems import sweep_scenes

EPS = 1e-6  # of Res(z_0)
CAP = {False: 2000, True: 500}  # sweeps at most, by --quick
FACTORED_CAP = {False: 1000, True: 500}  # the same for sweeps with a factorisation
GROWN = 1e3  # Res / Res(z_0) that is divergence and no cycle
STEADY = 20.0  # | slope of log Res | / its standard error, over the second half


class Map(NamedTuple):
    """A method whose alpha and c are varied; shift: I, D (None: it has none)."""

    method: str
    shift: str | None = None
    beta: float | None = None
    axes: str = "alpha c"


MAPS = (
    Map("msor"),
    Map("maor", beta=0.0),
    Map("namsor", "I"),
    Map("namsor", "D"),
    Map("namaor", "I", beta=0.0),
    Map("namaor", "D", beta=0.0),
    Map("amsor"),
)
STRIPS = (
    Map("psor", axes="alpha"),
    Map("modulus", axes="c"),
    Map("nam", "I", axes="c"),
    Map("nam", "D", axes="c"),
    Map("modified-nam", "I", axes="c I"),
    Map("modified-nam", "D", axes="c I"),
)
"""Methods with one parameter; "c I" means Omega = c I."""

BETAS = {"maor": 0.0, "namaor": 0.45}
SHIFTED = "namj namgs namsor namaor nam modified-nam"
UNITS = [
    Map(method, shift, BETAS.get(method))
    for methods, shift in (
        ("mgs msor maor amgs amsor pgs psor", None),
        (SHIFTED, "I"),
        ("modulus", None),
        (SHIFTED, "D"),
    )
    for method in methods.split()
]
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
    start = np.clip(0.0, scene.lower, scene.upper)
    gap = start - np.clip(start - scene.A @ start - scene.q, scene.lower, scene.upper)
    first = float(np.linalg.norm(gap))
    result = solve_lcp(
        scene.A, scene.q, scene.lower, scene.upper, method=method,
        eps_abs=EPS * first, max_iter=cap, history=True, **given,
    )  # fmt: skip
    if result.status is Status.SOLVED:
        return result.iterations
    if result.status is Status.NUMERICAL_ERROR:
        return "diverges"
    residuals = result.history["residual"]
    last = residuals[-1]
    if not math.isfinite(last) or last > GROWN * first:
        return "diverges"
    if result.status is Status.MAX_ITER:
        slope = trend(np.log(residuals[cap // 2 :]))
        if abs(slope) > STEADY:
            return "slow" if slope < 0.0 else "diverges"
    return "cycles"


def trend(y: np.ndarray) -> float:
    """Return the slope of y in units of its standard error (Student's t).

    Far from zero for however slow a fall or growth, near it for wandering and cycles.
    """
    x = np.linspace(-1.0, 1.0, y.size)
    x -= x.mean()
    slope = float(x @ y) / float(x @ x)
    rest = y - y.mean() - slope * x
    variance = float(rest @ rest) / (y.size - 2)
    return slope / math.sqrt(variance / float(x @ x) + 1e-18)


def matrix_shift(scene: sweep_scenes.Scene, shift: str | None) -> Any:
    """Return the diagonal of E."""
    return None if shift is None else 1.0 if shift == "I" else scene.A.diagonal()


def parameters(scene: sweep_scenes.Scene, chart: Map, alpha: float, c: float) -> Row:
    """Return the keyword arguments of one cell."""
    given: Row = {"shift": matrix_shift(scene, chart.shift), "beta": chart.beta}
    if "alpha" in chart.axes:
        given["alpha"] = alpha
    if chart.axes == "c I":
        given["alpha"] = c
    elif "c" in chart.axes:
        given["omega"] = c * scene.A.diagonal()
    return given


def class_rows(quick: bool) -> list[Row]:
    """Return a row for each class, method and c with a column for each alpha."""
    alphas = np.linspace(0.1, 1.9, 7 if quick else 19)
    powers = np.linspace(-5.0, 4.0, 7 if quick else 19)
    strip = np.linspace(-8.0, 8.0, 9 if quick else 33)
    line = np.linspace(0.05, 1.95, 9 if quick else 33)
    rows = []
    for scene in sweep_scenes.problem_classes():
        start = time.perf_counter()
        for chart in MAPS:
            for power in powers[::-1]:
                row = key(scene.name, chart) | {"c": 2.0**power}
                for alpha in alphas:
                    given = parameters(scene, chart, alpha, 2.0**power)
                    cell = outcome(scene, chart.method, CAP[quick], **given)
                    row[f"{alpha:.2f}"] = cell
                rows.append(row)
        for chart in STRIPS:
            cap = CAP[quick] if chart.axes == "alpha" else FACTORED_CAP[quick]
            for x in line if chart.axes == "alpha" else 2.0**strip:
                given = parameters(scene, chart, x, x)
                cell = outcome(scene, chart.method, cap, **given)
                rows.append(key(scene.name, chart) | {"c": x, "only": cell})
        print(f"{scene.name}: {time.perf_counter() - start:.0f} s", flush=True)
    names = list(dict.fromkeys(itertools.chain.from_iterable(rows)))
    return [{name: row.get(name, "") for name in names} for row in rows]


def key(name: str, chart: Map) -> Row:
    """Return the first columns of a row."""
    return {
        "class": name,
        "method": chart.method,
        "shift": chart.shift or "",
        "axes": chart.axes,
    }


def unit_rows(quick: bool) -> list[Row]:
    """Return a row for each method and delta with a column for each unit.

    A and q are multiplied by the unit; the tolerance is relative, so that nothing
    should change.
    """
    exponents = np.arange(-6, 7, 2 if quick else 1)
    rows = []
    for chart in UNITS:
        for delta in DELTAS:
            base = sweep_scenes.paper_example(1, 20, delta)
            row = key("Example 1", chart) | {"delta": delta}
            for exponent in exponents:
                unit = 10.0 ** float(exponent)
                scene = base._replace(A=unit * base.A, q=unit * base.q)
                given: Row = {"shift": matrix_shift(scene, chart.shift)}
                given["beta"] = chart.beta
                if "alpha" in SWEEPS[chart.method].takes:
                    given["alpha"] = ALPHAS.get(chart.method, ALPHA)
                cell = outcome(scene, chart.method, CAP[quick], **given)
                row[f"{exponent:d}"] = cell
            rows.append(row)
    return rows


def print_summary(rows: list[Row]) -> None:
    """Print for each class and method: cells solved, and the fewest sweeps."""
    cells: dict[tuple[str, str], list[Any]] = {}
    for row in rows:
        name = f"{row['method']} {row['shift']}".strip()
        values = [v for k, v in row.items() if k == "only" or k[:2] in ("0.", "1.")]
        cells.setdefault((row["class"], name), []).extend(v for v in values if v != "")
    classes = list(dict.fromkeys(pair[0] for pair in cells))
    methods = list(dict.fromkeys(pair[1] for pair in cells))
    print("\ncells that converge / all, fewest sweeps")
    for k, name in enumerate(classes):
        print(f"  {chr(65 + k)}: {name}")
    print(f"{'':<16}" + "".join(f"{chr(65 + k):>13}" for k in range(len(classes))))
    for method in methods:
        line = f"{method:<16}"
        for name in classes:
            values = cells[name, method]
            counts = [v for v in values if isinstance(v, int)]
            text = f"{len(counts)}/{len(values)}"
            line += f"{text:>8}{min(counts, default='-'):>5}"
        print(line)


def main(arguments: list[str] | None = None) -> int:
    """Do what the subcommand says."""
    parser = cli.parser(__doc__, "quick", "results", "figures")
    parser.add_argument("part", nargs="?", choices=("run", "plot"))
    args = parser.parse_args(arguments)
    if args.part in (None, "run"):
        start = time.perf_counter()
        header = cli.begin([], f"cells: {CAP[args.quick]} sweeps at most")
        rows = class_rows(args.quick)
        print_summary(rows)
        csv_files.write(args.results / "stability.csv", header, rows)
        csv_files.write(
            args.results / "stability-units.csv", header, unit_rows(args.quick)
        )
        print(f"{time.perf_counter() - start:.0f} s")
    if args.part in (None, "plot"):
        stability_figures.plot(args.results, args.figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
