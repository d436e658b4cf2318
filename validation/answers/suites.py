"""The fixed list of the book of answers: problems by suite, and the row of each.

A suite has the names of its problems and a function from a name to its row. Rows:

- status, method: as the result has them; of problems asked in two ways the outcome,
  and why it is not right.
- verdict: what the campaign's judge says where it knows the truth, else "".
- objective: 1/2 x'Px + q'x, or +-inf for a proof; empty for an LCP.
- slack: how far from the optimum the residuals allow it to be, gap + r_dual |x|_1 +
  r_primal |(y, z)|_1.
- residual: the worst residual over its tolerance.
- size, mark: |x|_2 and a weighted sum of x, by which points are told apart.
- iterations; seconds to one digit, which only say what --quick leaves out.
"""

import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.io
import scipy.sparse as sp
from qpsolvers import Problem

import namlcp
from validation.general.benchmark import make
from validation.harness import Row
from validation.paper import sweeps
from validation.peers import benchmark
from validation.problems import data_sets, infeasible_cases, osqp_classes, sweep_scenes
from validation.problems.fuzzed import cases
from validation.problems.general.families import FRICTION, game_lcp
from validation.stress import campaign, campaign_relations
from validation.stress.campaign_answers import ask_nam

SEED = 31
LIMIT = 60.0  # [s] a problem
CAMPAIGN = {  # how many of each kind
    "every": 10_000, "general": 3_000, "sequences": 1_000, "batches": 500,
    "derivatives": 500, "closest": 500,
}  # fmt: skip
OTHERS = ("copositive", "singular copositive", "copositive-plus", "P0", "games")
FAMILIES = (  # names, sizes, and how many of each
    (FRICTION, (80, 200, 500), 6),
    (FRICTION, (1000, 2000), 2),
    (OTHERS, (10, 20, 50, 100, 200), 5),
)
ALPHA, BETA = {"alpha": 0.9}, {"beta": 0.8}
SWEEPS: dict[str, dict[str, float]] = {
    "mgs": {}, "msor": ALPHA, "maor": ALPHA | BETA, "namj": {}, "namgs": {},
    "namsor": ALPHA, "namaor": ALPHA | BETA, "amgs": {}, "amsor": ALPHA, "pgs": {},
    "psor": ALPHA, "modulus": {}, "nam": {}, "modified-nam": ALPHA,
}  # fmt: skip
BENCHMARK = (  # a title, the set of problems and the tolerance
    ("maros-1e-06", "all", 1e-6), ("maros-1e-09", "all", 1e-9),
    ("maros-noise", "noise", 1e-6), ("maros-rows", "rows", 1e-6),
    ("maros-columns", "columns", 1e-6), ("mpc", "mpc", 1e-6),
    ("contact-qp", "contact", 1e-6),
)  # fmt: skip


class Suite(NamedTuple):
    """The names of its problems, and what makes the row of one."""

    names: list[str]
    solve: Callable[[str], Row]


def point_of(x: np.ndarray) -> Row:
    if not np.isfinite(x).all():
        return {}
    size, mark = np.linalg.norm(x), np.cos(1.0 + np.arange(x.size)) @ x
    return {"size": f"{size:.8g}", "mark": f"{mark:.8g}"}


def row_of_qp(result: Any, eps_abs: float = 1e-9, eps_rel: float = 1e-10) -> Row:
    row: Row = {"status": result.status.value, "method": result.form}
    row["iterations"] = result.iterations
    if not np.isnan(result.obj):
        row["objective"] = f"{result.obj:.12g}"
    if np.isfinite(result.obj):
        r = result.residuals
        multipliers = np.abs(result.y).sum() + np.abs(result.z).sum()
        slack = r.gap + r.dual * np.abs(result.x).sum() + r.primal * multipliers
        row["slack"] = f"{slack:.2g}"
        row["residual"] = f"{r.worst(eps_abs, eps_rel):.2g}"
    return row | point_of(result.x)


def row_of_lcp(result: Any, accuracy: float = np.nan) -> Row:
    """Return the row of an LCPResult; `accuracy`: the Res that was asked for."""
    row: Row = {"status": result.status.value, "method": result.method}
    row["iterations"] = result.iterations
    if np.isfinite(accuracy) and accuracy > 0.0:
        row["residual"] = f"{result.residual / accuracy:.2g}"
    return row | point_of(result.z)


def qp_row(problem: Problem, eps: float) -> Row:
    given = {"eps_abs": eps, "eps_rel": 0.0, "time_limit": LIMIT}
    return row_of_qp(namlcp.solve_qp(*problem.unpack(), **given), eps, 0.0)


def lcp_row(A: Any, q: np.ndarray, **given: Any) -> Row:
    accuracy = 1e-9 * float(np.abs(q).max(initial=0.0)) or 1e-9
    given |= {"eps_abs": accuracy, "time_limit": LIMIT}
    return row_of_lcp(namlcp.solve_lcp(A, q, **given), accuracy)


def fuzzed_row(kind: str, name: str) -> Row:
    case = cases.make(SEED, int(name), kind)
    answer, result = ask_nam(case)
    _, verdict, _ = campaign.judged(case, answer, True)
    if isinstance(result, Exception):
        row = {"status": type(result).__name__}
    else:
        row = row_of_qp(result) if "P" in case.arguments else row_of_lcp(result)
    return row | {"verdict": verdict}


def related_row(kind: str, name: str) -> Row:
    outcome, why = campaign_relations.examine(SEED, int(name), kind)
    return {"status": outcome, "method": why[:60], "verdict": outcome}


def loaded_row(load: Callable[[str], Problem], eps: float, name: str) -> Row:
    return qp_row(load(name), eps)


def infeasible_row(data: Path, name: str) -> Row:
    case = infeasible_cases.all_cases(data, 3)[name]()
    if case is None:
        return {"status": "no such problem"}
    try:
        row = qp_row(case.problem, case.eps)
    except ValueError as error:
        row = {"status": "refused", "method": str(error)[:60]}
    return row | {"method": f"{row.get('method', '')} ({case.truth})"}


def linear_program(folder: Path, name: str) -> Problem:
    """Read min c'x, A x = b, h_l <= G x <= h_u, x_l <= x <= x_u."""
    mat = scipy.io.loadmat(folder / f"{name}.mat", spmatrix=True)
    c, b, low, high, lb, ub = (
        mat[k].ravel().astype(float) for k in ("c", "b", "h_l", "h_u", "x_l", "x_u")
    )
    G = sp.csr_array(mat["G"])
    below, above = low > -data_sets.INFINITY, high < data_sets.INFINITY
    G = sp.csc_array(sp.vstack([G[above], -G[below]]))
    h = np.concatenate([high[above], -low[below]])
    P, A = sp.csc_array((c.size, c.size)), sp.csc_array(mat["A"])
    return Problem(P, c, G, h, A, b, lb, ub)


def family_row(name: str) -> Row:
    family, n, seed = name.rsplit(maxsplit=2)
    return lcp_row(*make(family, int(n), int(seed)))


def collected_row(data: Path, name: str) -> Row:
    stored = np.load(data / "general" / f"{name}.npz")
    if name.startswith("game"):
        return lcp_row(*game_lcp(stored["R"], stored["C"]))
    return lcp_row(stored["A"], stored["q"].ravel())


def printed_row(name: str) -> Row:
    example, method, alpha, m = name.split()
    known = None if alpha == "None" else float(alpha)
    run = sweeps.printed_run((int(example), method, known), int(m))
    return row_of_lcp(run(), sweeps.EPS)


def sweep_row(name: str) -> Row:
    example, delta, method = name.split()
    scene = sweep_scenes.paper_example(int(example), 20, float(delta))
    given = {"method": method, "eps_abs": 1e-8, "max_iter": 2000} | SWEEPS[method]
    return row_of_lcp(namlcp.solve_lcp(scene.A, scene.q, **given), 1e-8)


def generated() -> Iterator[tuple[str, Suite]]:
    for kind, count in CAMPAIGN.items():
        names = [str(i) for i in range(count)]
        row = related_row if kind in campaign_relations.RELATIONS else fuzzed_row
        yield f"campaign-{kind}", Suite(names, partial(row, kind))
    classes = osqp_classes.CLASSES.items()
    names = [f"{kind} {size}" for kind, found in classes for size in found.sizes]
    load = lambda name: osqp_classes.generate(*name.rsplit(maxsplit=1))  # noqa: E731
    yield "classes", Suite(names, partial(loaded_row, load, 1e-6))
    names = [
        f"{family} {n} {seed}"
        for families, sizes, seeds in FAMILIES
        for family, n, seed in product(families, sizes, range(seeds))
    ]
    yield "families", Suite(names, family_row)
    printed = product(sweeps.TABLES, sweeps.SIZES)
    names = [
        f"{example} {method} {alpha} {m}" for (example, method, alpha), m in printed
    ]
    yield "paper", Suite(names, printed_row)
    names = [f"{e} {d} {method}" for e in (1, 2) for d in (4, 1) for method in SWEEPS]
    yield "sweeps", Suite(names, sweep_row)


def collected(data: Path) -> Iterator[tuple[str, Suite]]:
    for title, problem_set, eps in BENCHMARK:
        names = benchmark.names_of(data, problem_set)
        load = partial(benchmark.load, data, problem_set)
        yield title, Suite(names, partial(loaded_row, load, eps))
    names = benchmark.names_of(data, "contact")
    scene = partial(data_sets.contact_lcp, data)
    yield "contact-lcp", Suite(names, lambda name: lcp_row(*scene(name)))
    names = list(infeasible_cases.all_cases(data, 3))
    yield "infeasible", Suite(names, partial(infeasible_row, data))
    files = sorted((data / "netlib").glob("*/*.mat"))
    names = [f"{file.parent.name}/{file.stem}" for file in files]
    load = partial(linear_program, data / "netlib")
    for eps in (1e-6, 1e-9):
        yield f"netlib-{eps:.0e}", Suite(names, partial(loaded_row, load, eps))
    files = sorted((data / "general").glob("*.npz"))
    names = [file.stem for file in files]
    yield "general", Suite(names, partial(collected_row, data))


def all_suites(data: Path | None) -> dict[str, Suite]:
    return dict(generated()) | (dict(collected(data)) if data is not None else {})


def row_of(suite: Suite, name: str) -> Row:
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            row = suite.solve(name)
        except Exception as error:
            row = {"status": "raised", "method": f"{type(error).__name__}: {error}"}
    seconds = time.perf_counter() - start
    return {"name": name} | row | {"seconds": f"{seconds:.0e}"}
