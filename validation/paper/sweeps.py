"""The sweep methods of the paper: its tables, checked, and maps of where they fail.

paper-tables
    The 48 printed runs of Tables 1 and 2 (delta = 4), iterations and Res beside the
    printed ones. Times are of whole calls of `solve_lcp` with a sparse matrix. The
    paper does not say what Omega is; with Omega = D/(2 alpha^2) all counts come out.
paper-large
    Sizes that the paper does not have, up to n = 10^6, beside a plain
    transcription of the matrix formula.
stability
    Every method with two parameters on one problem of each class (`sweep_scenes`), over
    c in Omega = c D and alpha.
stability-units
    Every method on Example 1, over delta and the unit of A and q.
plot
    The figures of the last two.

A cell of a map is the number of sweeps to Res < 1e-6 Res(z_0), or what happened instead
within CAP sweeps: "slow" (Res falls steadily), "cycles" (bounded, no measurable
progress: periodic or wandering), "diverges" (Res grows without bound).

mgs, namgs and amgs are msor, namsor and amsor at alpha = 1; namj is namaor at alpha = 1
with beta = 0; psor is amsor at c = 1/alpha and pgs the point (1, 1) of that: one map
shows them all. maor and namaor have beta = 0 here, beta = alpha being msor and namsor.
"""

import itertools
import textwrap
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, LogNorm, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from scipy.sparse.linalg import splu
from scipy.stats import linregress

from namlcp import LCPResult, Status, natural_residual, solve_lcp
from namlcp.lcp.modulus.methods import SWEEPS
from validation.harness import Row, charts, tables, timing
from validation.harness.suite import Parts
from validation.problems import sweep_scenes
from validation.problems.known_scenes import BoxLCP

EPS = 1e-5  # Res at which a run ends
SIZES = (10, 30, 50, 60, 80, 100)
PRINTED = """
1 mgs    -    | 36 40 41 41 42 42 | 97 80 79 89 74 84 | .0039 .0293 .2699 .6400 2.0785 4.5712
1 namgs  -    | 16 17 17 17 18 18 | 63 63 85 95 45 51 | .0024 .0146 .1089 .2688 .8179 2.0175
1 msor   0.85 | 15 17 18 18 18 19 | 95 76 53 65 89 43 | .0034 .0141 .1201 .2903 .7826 2.0791
1 namsor 0.91 | 12 12 13 13 13 13 | 27 76 32 37 48 59 | .0028 .0116 .0905 .2017 .6467 2.1918
2 mgs    -    | 24 26 26 26 27 27 | 90 65 87 96 65 73 | .0034 .0208 .1707 .3961 1.1542 2.9471
2 namgs  -    | 12 12 13 13 13 13 | 38 84 31 35 44 53 | .0026 .0141 .0837 .1998 .2987 1.4461
2 msor   0.88 | 14 14 15 15 15 15 | 38 82 41 46 55 63 | .0029 .0123 .1040 .2505 .6543 1.6363
2 namsor 0.88 |  8  9  9  9  9  9 | 22 15 27 37 46 59 | .0022 .0096 .0655 .1409 .0441 1.7340
"""  # noqa: E501
"""example, method, alpha | IT | Res in units of 1e-7 | CPU [s]; misprints included."""

Key = tuple[int, str, float | None]
TABLES: dict[Key, tuple[tuple[float, ...], ...]] = {}
for line in PRINTED.strip().splitlines():
    run, counts, *columns = line.split("|")
    example, method, alpha = run.split()
    entries = [tuple(map(float, column.split())) for column in columns]
    name = int(example), method, None if alpha == "-" else float(alpha)
    TABLES[name] = (tuple(map(int, counts.split())), *entries)

HELD_OUT = (20, 70, 120, 316, 1000)  # m


def solve(scene: BoxLCP, m: int, method: str, max_iter: int, **given: Any) -> LCPResult:
    given |= {"s0": sweep_scenes.paper_start(m), "eps_abs": EPS, "max_iter": max_iter}
    return solve_lcp(scene.A, scene.q, method=method, **given)


def printed_run(key: Key, m: int) -> Callable[[], LCPResult]:
    example, method, alpha = key
    given: Row = {} if alpha is None else {"alpha": alpha}
    if method.startswith("nam"):
        given["shift"] = 1.0
    scene = sweep_scenes.paper_example(example, m)
    return partial(solve, scene, m, method, 100, **given)


def table_rows() -> Iterator[Row]:
    for key, printed in TABLES.items():
        example, method, alpha = key
        for m, count, digits, cpu in zip(SIZES, *printed, strict=True):
            result, _, seconds = timing.median_time(printed_run(key, m))
            close = f"{result.residual:.1e}" == f"{digits / 1e7:.1e}"
            row: Row = {"example": example, "method": method, "alpha": alpha or 1.0}
            row |= {"n": m * m, "iterations": result.iterations}
            row |= {"residual": result.residual, "time": seconds}
            row |= {"printed_iterations": count, "printed_residual": digits / 1e7}
            row |= {"printed_time": cpu, "count_agrees": result.iterations == count}
            yield row | {"residual_agrees": close}


def large_rows() -> Iterator[Row]:
    cases = itertools.product((1, 2), ((4.0, 0.5), (1.0, 0.8)), HELD_OUT)
    for example, (delta, c), m in cases:
        scene = sweep_scenes.paper_example(example, m, delta)
        omega = c * scene.A.diagonal()
        start = time.perf_counter()
        result = solve(scene, m, "namgs", 1000, omega=omega, shift=1.0)
        seconds = time.perf_counter() - start
        count, residual = transcription(scene, m, omega)
        error = np.max(np.abs(result.z - sweep_scenes.paper_solution(m)))
        row: Row = {"example": example, "delta": delta, "Omega": f"{c:g} D"}
        row |= {"n": m * m, "iterations": result.iterations, "transcription": count}
        row |= {"residual": result.residual, "transcription_residual": residual}
        yield row | {"error": float(error), "time": seconds}


def transcription(scene: BoxLCP, m: int, omega: np.ndarray) -> tuple[int, float]:
    """Return count and Res of NAMGS written down as the paper does, r = 2.

    (D - 2L + Omega + I) s+ = (U + I - L) s + (Omega - A)|s| - 2 q
    """
    A, q, s = scene.A, scene.q, sweep_scenes.paper_start(m)
    D = sp.csr_array(sp.diags_array(A.diagonal()))
    L, U = sp.csr_array(-sp.tril(A, -1)), sp.csr_array(-sp.triu(A, 1))
    Omega, eye = sp.diags_array(omega), sp.eye_array(q.size)
    left = splu(sp.csc_array(D - 2 * L + eye + Omega), permc_spec="NATURAL")
    N, B = sp.csr_array(U + eye - L), sp.csr_array(Omega - A)
    for count in itertools.count():
        z = 0.5 * (np.abs(s) + s)
        residual = float(np.linalg.norm(np.minimum(z, A @ z + q)))
        if residual < EPS or count == 1000:
            break
        s = left.solve(N @ s + B @ np.abs(s) - 2.0 * q)
    return count, residual


# ---- maps

FALL = 1e-6  # of Res, from Res(z_0)
CAP = 2000  # sweeps at most
GROWN = 1e3  # Res / Res(z_0) that is divergence and no cycle
STEADY = 20.0  # | slope of log Res | / its standard error, over the second half


class Map(NamedTuple):
    """A method whose alpha and c are varied; shift: I, D (None: it has none)."""

    method: str
    shift: str | None = None
    beta: float | None = None


MAPS = (
    Map("msor"), Map("maor", beta=0.0), Map("namsor", "I"), Map("namsor", "D"),
    Map("namaor", "I", beta=0.0), Map("namaor", "D", beta=0.0), Map("amsor"),
)  # fmt: skip
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


def outcome(scene: BoxLCP, chart: Map, **given: Any) -> int | str:
    """Return the number of sweeps, or what happened instead, by the history of Res."""
    A, q, *box = scene
    start = np.clip(0.0, *box)
    first = natural_residual(start, A @ start + q, *box)
    given |= {"eps_abs": FALL * first, "max_iter": CAP, "history": True}
    given |= {"shift": {"I": 1.0, "D": A.diagonal()}.get(chart.shift)}
    result = solve_lcp(*scene, method=chart.method, beta=chart.beta, **given)
    if result.status is Status.SOLVED:
        return result.iterations
    if result.status is Status.NUMERICAL_ERROR:
        return "diverges"
    residuals = result.history["residual"]
    if not residuals[-1] <= GROWN * first:
        return "diverges"
    if result.status is Status.MAX_ITER:
        y = np.log(residuals[CAP // 2 :])
        line = linregress(np.arange(y.size), y)
        if abs(line.slope) > STEADY * line.stderr:
            return "slow" if line.slope < 0.0 else "diverges"
    return "cycles"


def about(name: str, chart: Map) -> Row:
    return {"class": name, "method": chart.method, "shift": chart.shift or ""}


def class_rows() -> Iterator[Row]:
    alphas = np.linspace(0.1, 1.9, 19)
    powers = np.linspace(-5.0, 4.0, 19)
    for name, scene in sweep_scenes.problem_classes().items():
        for chart in MAPS:
            for c in 2.0 ** powers[::-1]:
                row = about(name, chart) | {"c": c}
                for alpha in alphas:
                    given = {"alpha": alpha, "omega": c * scene.A.diagonal()}
                    row[f"{alpha:.2f}"] = outcome(scene, chart, **given)
                yield row
        print(name, flush=True)


def unit_rows() -> Iterator[Row]:
    """Yield a row for each method and delta; nothing should change with the unit."""
    for chart, delta in itertools.product(UNITS, DELTAS):
        base = sweep_scenes.paper_example(1, 20, delta)
        row = about("Example 1", chart) | {"delta": delta}
        alpha = {"alpha": ALPHAS.get(chart.method, ALPHA)}
        given = alpha if "alpha" in SWEEPS[chart.method].takes else {}
        for exponent in np.arange(-6, 7):
            unit = 10.0 ** float(exponent)
            scene = base._replace(A=unit * base.A, q=unit * base.q)
            row[f"{exponent:d}"] = outcome(scene, chart, **given)
        yield row


FAILURES = {
    "slow": ("#F2B134", "slow: falls steadily, not there in time"),
    "cycles": ("#D6336C", "cycles or wanders: no measurable progress"),
    "diverges": ("#222222", "diverges"),
}
COUNTS = ListedColormap(plt.get_cmap("YlGnBu")(np.linspace(0.0, 0.87, 256)))
LIMITS = LogNorm(5.0, 2000.0)
CURVES = {"msor": 2.0, "namsor": 2.0, "maor": 2.0, "namaor": 2.0, "amsor": 1.0}
"""k of the white line c = alpha^-k / k: Omega = D/(2 alpha^2) or D/alpha."""


@cache
def colour(cell: str) -> tuple[float, ...]:
    if cell in FAILURES:
        return to_rgb(FAILURES[cell][0])
    return COUNTS(LIMITS(max(float(cell), LIMITS.vmin or 1.0)))[:3]


def title_of(row: Row) -> str:
    zero = ", $\\beta$ = 0" if "aor" in row["method"] else ""
    shift = f", E = {row['shift']}" if row["shift"] else ""
    return row["method"].replace("modified-", "modified ").upper() + zero + shift


def show(axes: Axes, rows: list[Row], down: str, **wanted: str) -> str:
    """Draw the chosen rows, which axes keep in view; return what they are."""
    rows = tables.chosen(rows, **wanted)
    names = [name for name in rows[0] if name.strip("-").replace(".", "").isdigit()]
    cells = np.array([[colour(row[name]) for name in names] for row in rows])
    axes.imshow(cells, aspect="auto", interpolation="nearest")
    axes.grid(False)
    axes.tick_params(length=2, labelsize=7)
    axes.set_xticks(range(0, len(names), 6), names[::6])
    labels = [f"{float(row[down]):.2g}" for row in rows]
    axes.set_yticks(range(0, len(rows), 4), labels[::4])
    axes.autoscale(False)
    return title_of(rows[0])


def finish(figure: Figure, axes: Any, file: Path, across: str, down: str) -> None:
    bar = figure.colorbar(ScalarMappable(LIMITS, COUNTS), ax=axes, shrink=0.5, pad=0.01)
    bar.set_label("sweeps to Res < $10^{-6}$ Res($z_0$)")
    patches = [Patch(color=look, label=text) for look, text in FAILURES.values()]
    figure.legend(handles=patches, loc="outside lower center", ncols=3)
    for panel in axes[-1]:
        panel.set_xlabel(across, fontsize=8.0)
    figure.supylabel(down, fontsize=9.0)
    charts.save(figure, file)


def plot(results: Path, figures: Path) -> None:
    """Draw c against alpha for every class (column) and method (row), then units."""
    rows = tables.read(results / "stability.csv")
    classes = tables.distinct(rows, "class")
    methods = tables.distinct(rows, "method", "shift")
    figure, grid = plt.subplots(
        len(methods), len(classes), figsize=(11.5, 10.2), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    alpha = np.linspace(0.1, 1.9, 50)
    for line, (method, shift) in zip(grid, methods, strict=True):
        k = CURVES[method]
        for axes, name in zip(line, classes, strict=True):
            wanted = {"class": name, "method": method, "shift": shift}
            title = show(axes, rows, "c", **wanted)
            # in places of the cells: alpha = 0.1, 0.2, ...; c = 16, 16/sqrt(2), ...
            power = 1.0 - k - k * np.log2(alpha)
            axes.plot(10.0 * alpha - 1.0, 8.0 - 2.0 * power, "w", linewidth=0.9)
        line[0].set_ylabel(title.replace(", ", ",\n", 1), fontsize=8)
    for axes, name in zip(grid[0], classes, strict=True):
        axes.set_title(textwrap.fill(name, 14, break_on_hyphens=False), fontsize=8.5)
    figure.suptitle(
        "Sweep methods over $\\alpha$ and c in $\\Omega$ = c D.  White line: "
        "$\\Omega = D/(2\\alpha^2)$, the paper's; in AMSOR $\\Omega = D/\\alpha$, "
        "which is projected SOR",
        fontsize=9,
    )
    finish(figure, grid, figures / "stability-maps.png", "$\\alpha$", "c")
    plot_units(tables.read(results / "stability-units.csv"), figures)


def plot_units(rows: list[Row], figures: Path) -> None:
    figure, grid = plt.subplots(
        3, 7, figsize=(11.5, 6.0), sharex=True, sharey=True, layout="constrained"
    )
    methods = tables.distinct(rows, "method", "shift")
    for axes, (method, shift) in zip(grid.flat, methods, strict=False):
        title = show(axes, rows, "delta", method=method, shift=shift)
        axes.set_title(title.replace(", $\\beta$ = 0", ""), fontsize=8.5)
    for axes in grid.flat[len(methods) :]:
        axes.axis("off")
    file = figures / "stability-units.png"
    finish(figure, grid, file, "k, unit $10^k$", "$\\delta$")


ROWS = {
    "paper-tables": table_rows, "paper-large": large_rows,
    "stability": class_rows, "stability-units": unit_rows,
}  # fmt: skip
SUITE = Parts(__doc__, ROWS, plot=plot)
