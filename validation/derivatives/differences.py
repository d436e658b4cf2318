"""Derivatives of QPs and LCPs against differences, and at kinks.

Regular problems: dense and sparse in turns, in units that differ by up to 10^4; two
thirds of the LCPs are not symmetric. `error` is the largest relative difference, entry
by entry, between `forward` along a random direction of all data and a central
difference, extrapolated from two steps, of points from the equations of the active
constraints in extended precision. `adjoint` is the largest difference between the two
sides of <g, forward(d)> = <backward(g), d>, over the sum of the moduli of the terms.

Closest points of infeasible QPs: the gradient of a random scalar in x and the shifts,
along a random change of all data, or, where the rank of the shifted rows may rise, of
all but G and A, beside an extrapolated central difference of the solver, over 1 + its
modulus.

Kinks: `error` is that of `directional` beside a one-sided difference of the solver,
over 1 + its largest entry.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp

import namlcp
from namlcp.derivatives.dense import sides_of
from namlcp.qp.problem import QP
from validation.derivatives import cases
from validation.harness import Job, Row
from validation.harness.suite import Args, Suite

Array = np.ndarray
Solution = Callable[[float], Array]

COUNTS, QUICK_COUNTS = (2000, 40), (100, 5)  # regular problems, and kinks
EXACT = {"eps_abs": 1e-13, "eps_rel": 1e-13}
STEP = 1e-4  # of the central difference; half of it is the second one
ONE_SIDED = 1e-4  # step at kinks, doubled once to extrapolate
RIGHT, ADJOINT = 1e-4, 1e-10  # errors at kinks, and gaps of the adjoint
CLOSEST_STEP = 1e-5
CLOSEST_KINDS = (  # variables, rows, equations, whether there are bounds
    (3, 14, 1, False),  # the shifted rows determine x
    (9, 5, 2, False),  # the cost does
    (6, 9, 2, True),
)


def extended_solve(K: Array, rhs: Array) -> Array:
    """Return K^-1 rhs in extended precision, by elimination with row pivoting."""
    M = np.column_stack((K, rhs)).astype(np.longdouble)
    n = len(M)
    for k in range(n):
        pivot = k + int(np.argmax(np.abs(M[k:, k])))
        M[[k, pivot]] = M[[pivot, k]]
        M[k + 1 :] -= np.outer(M[k + 1 :, k] / M[k, k], M[k])
    x = np.zeros(n, np.longdouble)
    for k in range(n - 1, -1, -1):
        x[k] = (M[k, n] - M[k, k + 1 : n] @ x[k + 1 :]) / M[k, k]
    return x


def qp_solution(qp: QP, rows: Array, side: Array) -> Array:
    """Return (x, y, z, z_box) with these rows and bounds held, as one vector."""
    P, q, G, h, A, b, lb, ub = (v.astype(np.longdouble) for v in qp)
    n, fixed = q.size, np.flatnonzero(side)
    C = np.concatenate((A, G[rows], np.eye(n)[fixed]))
    bound = np.where(side < 0, lb, ub)[fixed]
    K = np.block([[P, C.T], [C, np.zeros((len(C), len(C)))]])
    found = extended_solve(K, np.concatenate((-q, b, h[rows], bound)))
    x, y, v = np.split(found, (n, n + b.size))
    z, z_box = np.zeros(h.size, np.longdouble), np.zeros(n, np.longdouble)
    z[rows], z_box[fixed] = v[: rows.size], v[rows.size :]
    return np.concatenate((x, y, z, z_box))


def lcp_solution(lcp: Any, side: Array) -> Array:
    """Return (z, w) with these unknowns at their bounds, as one vector."""
    A, q, lower, upper = (v.astype(np.longdouble) for v in lcp)
    free = np.flatnonzero(side == 0)
    z = np.where(side < 0, lower, np.where(side > 0, upper, 0.0))
    z[free] = extended_solve(A[np.ix_(free, free)], -(q + A @ z)[free])
    return np.concatenate((z, np.where(side == 0, 0.0, A @ z + q)))


def difference(solution: Solution) -> Array:
    coarse, fine = (
        (solution(t) - solution(-t)) / (2 * np.longdouble(t)) for t in (STEP, STEP / 2)
    )
    return (4 * fine - coarse) / 3


def relative(found: Array, expected: Array, value: Array) -> float:
    size = np.abs(expected) + np.abs(value)
    return float(np.max(np.abs(found - expected) / np.where(size > 0.0, size, 1.0)))


def paired(gradients: Any, d: cases.Kept) -> list[float]:
    terms = []
    for name, change in d.items():
        g = getattr(gradients, name)
        terms.append(float(np.sum((g.toarray() if sp.issparse(g) else g) * change)))
    return terms


def errors(
    result: Any, problem: Any, d: cases.Kept, solution: Any, rng: np.random.Generator
) -> tuple[float, float]:
    """Return the error of `forward` along d, and the gap of the adjoint."""
    is_qp = isinstance(problem, QP)
    parts = ("x", "y", "z", "z_box") if is_qp else ("z", "w")
    both = result, result.forward(**{f"d{k}": v for k, v in d.items()})
    own, found = (np.concatenate([getattr(v, k) for k in parts]) for v in both)
    value = solution(problem)
    assert relative(own, value, value) <= 1e-6
    expected = difference(lambda t: solution(cases.moved(problem, d, t)))
    g = rng.standard_normal(own.size) / (np.abs(own) + 1e-3 if is_qp else 1.0)
    ends = np.cumsum([getattr(result, part).size for part in parts])
    left, right = g * found, paired(result.backward(*np.split(g, ends[:-1])), d)
    size = np.abs(left).sum() + np.abs(right).sum()
    gap = abs(float(left.sum()) - sum(right)) / float(size)
    return relative(found, expected, value), gap


def regular_qp(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng([seed, 2])
    n, m, p = rng.integers(10, 20), rng.integers(0, 12), rng.integers(0, 3)
    qp = cases.regular_qp(seed, n, m, p, scale=(1.0, 1e4)[seed // 2 % 2])
    given = QP(*(sp.csc_array(v) if v.ndim == 2 else v for v in qp)) if seed % 2 else qp
    result = namlcp.solve_qp(*given)
    held, _, _ = sides_of(result.derivative.qp, result.derivative.solution)
    _, rows, side = np.split(held, [p, p + m])
    solution = partial(qp_solution, rows=np.flatnonzero(rows), side=side)
    return errors(result, qp, cases.direction(qp, seed), solution, rng)


def regular_lcp(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng([seed, 3])
    lcp = cases.regular_lcp(seed, int(rng.integers(6, 30)), symmetric=seed % 3 == 0)
    A = sp.csr_array(lcp.A) if seed % 2 else lcp.A
    result = namlcp.solve_lcp(*lcp._replace(A=A))
    d = {name: rng.standard_normal(v.shape) for name, v in lcp._asdict().items()}
    pinned = lcp.lower == lcp.upper
    d["lower"][pinned] = d["upper"][pinned]
    solution = partial(lcp_solution, side=result.derivative.side)
    return errors(result, lcp, d, solution, rng)


def one_sided_error(found: Array, solution: Solution) -> tuple[float, float]:
    """Return the error of a derivative at 0 beside an extrapolated difference."""
    points = [solution(t) for t in (0.0, ONE_SIDED, 2 * ONE_SIDED)]
    expected = (4 * points[1] - 3 * points[0] - points[2]) / (2 * ONE_SIDED)
    error = np.abs(found - expected).max() / (1.0 + np.abs(expected).max())
    return float(error), 0.0


def kink_error(make: Callable[[int], QP], names: str, seed: int) -> tuple[float, float]:
    qp = make(seed)
    d = cases.direction(qp, seed, names)
    given = QP(*(sp.csc_array(v) if v.ndim == 2 else v for v in qp)) if seed % 2 else qp
    solve = partial(namlcp.solve_qp, **EXACT)
    found = solve(*given).directional(**{f"d{k}": v for k, v in d.items()}).x
    return one_sided_error(found, lambda t: solve(*cases.moved(qp, d, t)).x)


def lcp_kink_error(seed: int) -> tuple[float, float]:
    A, q = cases.weak_lcp(seed)
    rng = np.random.default_rng([seed, 4])
    dA, dq = rng.standard_normal(A.shape), rng.standard_normal(q.size)
    solve = partial(namlcp.solve_lcp, eps_abs=1e-13)
    found = solve(A, q).directional(dA=dA, dq=dq)
    return one_sided_error(found.z, lambda t: solve(A + t * dA, q + t * dq).z)


def closest_error(seed: int) -> tuple[float, float]:
    rng = np.random.default_rng([seed, 5])
    data = cases.contradictory(seed, *CLOSEST_KINDS[seed % len(CLOSEST_KINDS)])

    def parts_at(t: float, d: cases.Kept) -> tuple[Any, Array]:
        moved = {name: own + t * d.get(name, 0.0) for name, own in data.items()}
        found = namlcp.solve_qp(**moved, infeasible="closest", **EXACT).closest
        return found, np.concatenate((found.x, found.shift_h, found.shift_b))

    found, parts = parts_at(0.0, {})
    g = rng.standard_normal(parts.size)
    n, m = data["q"].size, data["h"].size
    gradients = found.backward(*np.split(g, (n, n + m)))
    d = {k: rng.standard_normal(v.shape) for k, v in data.items()}
    d["P"] = d["P"] + d["P"].T
    if gradients.singular:
        d = {name: change for name, change in d.items() if name not in "GA"}
    coarse, fine = (
        float(g @ (parts_at(t, d)[1] - parts_at(-t, d)[1])) / (2 * t)
        for t in (2 * CLOSEST_STEP, CLOSEST_STEP)
    )
    expected = (4 * fine - coarse) / 3
    return abs(sum(paired(gradients, d)) - expected) / (1.0 + abs(expected)), 0.0


FAMILIES: dict[tuple[str, str], tuple[Callable[[int], tuple[float, float]], float]] = {
    ("QP", "all"): (regular_qp, 1e-7),
    ("LCP", "all"): (regular_lcp, 1e-7),
    **{
        (make.__name__, names): (partial(kink_error, make, names), RIGHT)
        for make, every in cases.KINKS.items()
        for names in every
    },
    ("weak_lcp", "A, q"): (lcp_kink_error, RIGHT),
    ("closest", "all"): (closest_error, 1e-7),
}
"""By family and the data that are changed: error and gap of the adjoint of a problem,
and the error that is right."""


def row_of(family: str, data: str, counts: tuple[int, int]) -> Row:
    one, right = FAMILIES[family, data]
    count = counts[0] if family in ("QP", "LCP") else counts[1]
    count *= 3 if family == "closest" else 1
    errors, gaps = np.transpose([one(seed) for seed in range(count)])
    row: Row = {"family": family, "data": data, "problems": count}
    row |= {"error": errors.max(), "adjoint": gaps.max()}
    return row | {"right": int(np.sum((errors <= right) & (gaps <= ADJOINT)))}


def work(job: Job, family: str, data: str, counts: tuple[int, int]) -> Row:
    job.ready()
    return row_of(family, data, counts)


def requests(args: Args) -> Iterator[Row]:
    counts = QUICK_COUNTS if args.quick else COUNTS
    for family, data in FAMILIES:
        yield {"family": family, "data": data, "ask": (family, data, counts)}


SUITE = Suite(
    name="derivatives", requests=requests, work=work,
    columns="family data | problems error adjoint right", limit=600.0,
)  # fmt: skip
