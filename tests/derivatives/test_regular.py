"""Derivatives where there are some: differences, the adjoint, the KKT system.

One table of problems by the ways they are solved: what a way keeps for the derivative
must not change it.
"""

import pickle
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import QP

import namlcp
from namlcp import Relaxation, Solver, solve_batch, solve_lcp, solve_qp
from validation.derivatives.cases import (
    contradictory,
    direction,
    regular_lcp,
    regular_qp,
)

EXACT = {"eps_abs": 1e-13, "eps_rel": 1e-13}
CLOSE = {"eps_abs": 1e-12, "eps_rel": 1e-13}
PARTS = ("x", "y", "z", "z_box")
VECTORS = ("q", "h", "b", "lb", "ub")
SOFT = Relaxation(h=2.0, lb=1.0, ub=3.0)


def stored(kind, data):
    return {k: kind(v) if v.ndim == 2 else v for k, v in data.items()}


def by_solver(**data):
    """The second solve, whose factors are lent to the result."""
    solver = Solver(**data, **EXACT)
    solver.solve()
    return solver.solve(derivative=True)


def by_quick_solver(**data):
    solver = Solver(**data, **EXACT)
    solver.solve()
    return solver.solve()


def by_start(**data):
    return solve_qp(**data, **EXACT, x0=0.0 * data["q"], derivative=True)


def by_batch(**data):
    stacked = {k: np.array([v, v]) for k, v in data.items()}
    stacked["q"][0] += 0.1
    return solve_batch(**stacked, **EXACT)[1]


def lcp(kind):
    def solve(A, q, lower, upper):
        exact = {"eps_abs": 1e-13, "eps_rel": 1e-15}
        return solve_lcp(kind(A), q, lower, upper, **exact)

    return solve


def closest(choice, kind=np.array):
    def solve(**data):
        found = solve_qp(**stored(kind, data), infeasible=choice, **CLOSE)
        return found.closest

    return solve


class Way(NamedTuple):
    """How problems of a kind are solved, and the parts of the result."""

    solve: Callable[..., Any]
    parts: tuple[str, ...] = PARTS


QP_WAYS = {
    "dense": Way(lambda **d: solve_qp(**d, **EXACT)),
    "sparse": Way(lambda **d: solve_qp(**stored(sp.csc_array, d), **EXACT)),
    "with factors": Way(lambda **d: solve_qp(**d, **EXACT, derivative=True)),
    "from a start": Way(by_start),
    "Solver": Way(by_solver),
    "quick Solver": Way(by_quick_solver),
    "sparse Solver": Way(lambda **d: by_solver(**stored(sp.csc_array, d))),
    "batch": Way(by_batch),
}
LCP_WAYS = {
    name: Way(lcp(kind), ("z", "w"))
    for name, kind in (
        ("array", np.array), ("csr", sp.csr_array), ("csc", sp.csc_array),
        ("prepared", lambda A: namlcp.Prepared(sp.csr_array(A))),
    )
}  # fmt: skip
CLOSEST = "x", "shift_h", "shift_b"
HARD_WAYS = {
    "hard": Way(closest("closest"), CLOSEST),
    "sparse": Way(closest("closest", sp.csr_array), CLOSEST),
}
SOFT_WAYS = HARD_WAYS | {"soft": Way(closest(SOFT), CLOSEST)}


def qps(seed):
    qp = regular_qp(seed, scale=10.0 ** (2 * (seed % 3)))
    return qp._asdict(), direction(qp, seed)


def large_qps(seed):
    """Matrices of more than 2000 entries are made later than the rest."""
    qp = regular_qp(seed, 60)
    return qp._asdict(), direction(qp, seed)


def lcps(seed):
    A, q, lower, upper = regular_lcp(seed, symmetric=seed % 3 == 0)
    rng = np.random.default_rng([seed, 2])
    dA, (dq, dl, du) = rng.standard_normal(A.shape), rng.standard_normal((3, q.size))
    du[lower == upper] = dl[lower == upper]
    data = {"A": A, "q": q, "lower": lower, "upper": upper}
    return data, {"A": dA, "q": dq, "lower": dl, "upper": du}


def impossible(*sizes, **others):
    """Without a feasible point. Where the cost alone determines x on the rows that
    hold, x jumps if the rank of these rows rises: no change of G and A then."""

    def make(seed):
        data, rng = contradictory(seed, *sizes, **others), np.random.default_rng(seed)
        d = {k: rng.standard_normal(v.shape) for k, v in data.items()}
        d["P"] += d["P"].T
        if sizes[0] > 3:
            d["G"], d["A"] = 0.0 * d["G"], 0.0 * d["A"]
        return data, d

    return make


class Kind(NamedTuple):
    """Problems and directions by their seeds, the ways, and the tolerances."""

    make: Callable[[int], Any]
    seeds: int
    ways: dict[str, Way]
    step: float = 1e-3
    tol: float = 1e-6


KINDS = {
    "QP": Kind(qps, 6, QP_WAYS),
    "large QP": Kind(large_qps, 1, QP_WAYS),
    "LCP": Kind(lcps, 9, LCP_WAYS, 1e-4),
    "closest, rows alone": Kind(impossible(3, 14, 1), 4, HARD_WAYS, 1e-5, 1e-5),
    "closest, by the cost": Kind(impossible(9, 5), 4, HARD_WAYS, 1e-5, 1e-5),
    "closest, bounds": Kind(impossible(6, 9, bounds=True), 3, SOFT_WAYS, 1e-5, 1e-5),
}
CASES = [(kind, way) for kind, entry in KINDS.items() for way in entry.ways]


def parts_of(result, way):
    return [getattr(result, part) for part in way.parts]


def pairing(gradients, d):
    """Return the sum of gradient times change, and that of the moduli."""
    terms = []
    for name, change in d.items():
        g = getattr(gradients, name)
        terms.append(((g.toarray() if sp.issparse(g) else g) * change).ravel())
    terms = np.concatenate(terms)
    return terms.sum(), np.abs(terms).sum()


@pytest.mark.parametrize(("kind", "way"), CASES)
def test_derivatives_are_those_of_differences_and_adjoint(kind, way):
    """Central differences, extrapolated from two steps (Richardson)."""
    make, seeds, ways, step, tol = KINDS[kind]
    way = ways[way]
    for seed in range(seeds):
        data, d = make(seed)
        result = way.solve(**data)
        points = parts_of(result, way)

        def moved(t, data=data, d=d):
            found = way.solve(**{k: data[k] + t * d[k] for k in data})
            return np.concatenate(parts_of(found, way))

        def central(t, moved=moved):
            return (moved(t) - moved(-t)) / (2 * t)

        expected = (4.0 * central(step / 2) - central(step)) / 3.0
        rng = np.random.default_rng([seed, 3])
        cotangents = [rng.standard_normal(v.size) / (np.abs(v) + 1e-3) for v in points]
        gradients = result.backward(*cotangents)
        assert gradients.weak == 0
        paired, size = pairing(gradients, d)
        terms = np.concatenate(cotangents) * expected
        assert abs(paired - terms.sum()) <= tol * (np.abs(terms).sum() + size)
        if way.parts != CLOSEST:
            found = result.forward(**{f"d{k}": v for k, v in d.items()})
            assert (found.weak, found.singular) == (0, False)
            own = np.concatenate(parts_of(found, way))
            scale = np.abs(np.concatenate(points)) + np.abs(expected)
            assert np.all(np.abs(own - expected) <= tol * scale + 1e-3 * tol)
            terms = np.concatenate(cotangents) * own
            assert abs(terms.sum() - paired) <= 1e-9 * np.abs(terms).sum()


def assert_equal_gradients(own, other, names, rtol=1e-10, atol=1e-11):
    for name in names:
        mine, expected = (getattr(g, name) for g in (own, other))
        if sp.issparse(mine):
            mine = mine.toarray()
        np.testing.assert_allclose(mine, expected, rtol, atol)


def face_gradients(result, given):
    """Those by LU factors of the whole KKT matrix."""
    result.derivative.item = None
    result.derivative.hold()
    return result.backward(*given)


@pytest.mark.parametrize("way", QP_WAYS)
@pytest.mark.parametrize("seed", range(10))
def test_each_way_has_the_gradients_of_the_face(seed, way):
    """And the same bits when they are asked for again; `forward` in between."""
    qp = regular_qp(seed)
    result, rng = QP_WAYS[way].solve(**qp._asdict()), np.random.default_rng(seed)
    given = [rng.standard_normal(getattr(result, part).shape) for part in PARTS]
    plain = solve_qp(*qp, **EXACT)
    expected = face_gradients(plain, given)
    first = result.backward(*given)
    tangent, fresh = (r.forward(dq=qp.q) for r in (result, plain))
    np.testing.assert_allclose(tangent.x, fresh.x, 1e-9, 1e-11)
    assert_equal_gradients(first, expected, (*VECTORS, *"PGA"), 1e-9)
    again = result.backward(*given)
    for name in VECTORS:
        assert np.array_equal(getattr(first, name), getattr(again, name))


@pytest.mark.parametrize("way", QP_WAYS)
def test_gradients_are_those_of_the_transcribed_kkt_system(way):
    """One dense solve with all conditions (Amos and Kolter 2017, eq. 6), no blocks."""
    qp = regular_qp(0)
    P, q, G, h, A, b = qp[:6]
    result = QP_WAYS[way].solve(**qp._asdict())
    n, m, p = q.size, h.size, b.size
    x, y, z, z_box = (getattr(result, part) for part in PARTS)
    bounds = np.diag((z_box != 0.0).astype(float))
    K = np.block([
        [P, A.T, G.T, np.eye(n)],
        [A, np.zeros((p, p + m + n))],
        [z[:, None] * G, np.zeros((m, p)), np.diag(G @ x - h), np.zeros((m, n))],
        [bounds, np.zeros((n, p + m)), np.eye(n) - bounds],
    ])  # fmt: skip
    gx = np.arange(1.0, n + 1.0)
    solution = np.linalg.solve(K.T, np.concatenate((gx, np.zeros(p + m + n))))
    u, nu, lam, mu = np.split(solution, np.cumsum((n, p, m)))
    lam = z * lam
    found = result.backward(dx=gx)
    expected = {
        "q": -u, "b": nu, "h": lam, "P": -0.5 * (np.outer(u, x) + np.outer(x, u)),
        "G": -np.outer(z, u) - np.outer(lam, x),
        "A": -np.outer(y, u) - np.outer(nu, x),
    }  # fmt: skip
    assert_equal_gradients(found, QP(**expected, lb=0, ub=0), expected, 1e-9, 1e-10)
    np.testing.assert_allclose(found.lb + found.ub, np.diag(bounds) * mu, atol=1e-10)
    P = found.P.toarray() if sp.issparse(found.P) else found.P
    assert np.array_equal(P, P.T)


def test_obstacle_by_cycles_equals_factors():
    """From order 10^4 on the hierarchy of the solve serves, symmetric or not."""
    n = 120
    one = np.ones(n)
    T = sp.diags_array([-one[1:], 2 * one, -one[1:]], offsets=[-1, 0, 1])
    L = sp.csr_array(sp.kron(T, sp.eye_array(n)) + sp.kron(sp.eye_array(n), T))
    wind = sp.diags_array([-one[1:], one], offsets=[-1, 0])
    f = np.full(n * n, -4.0 / n**2)
    f[: n * n // 3] *= -1.0
    for A in (L, L + 0.1 * sp.csr_array(sp.kron(wind, sp.eye_array(n)))):
        result = solve_lcp(A, f, eps_rel=1e-12)
        free = np.flatnonzero(result.z > 0.0)
        assert free.size >= 1e4 / 2
        gz = np.random.default_rng(0).standard_normal(n * n)
        found = result.backward(dz=gz)
        expected = np.zeros(n * n)
        expected[free] = sp.linalg.spsolve(sp.csc_array(A[free][:, free].T), -gz[free])
        np.testing.assert_allclose(found.q, expected, 1e-9, 1e-9 * abs(expected).max())
        assert found.A.nnz == A.nnz


# ---- the factors that a result keeps


def large_qp(n=150):
    """A regular QP that LAPACK factors."""
    rng = np.random.default_rng(0)
    M, G = rng.standard_normal((n, n)), rng.standard_normal((n, n))
    q, none = rng.standard_normal(n), np.zeros((0, n))
    bounds = np.full(n, -np.inf), np.full(n, np.inf)
    return QP(M @ M.T + np.eye(n), q, G, 0.1 + rng.random(n), none, q[:0], *bounds)


@pytest.mark.parametrize("qp", [regular_qp(0), large_qp()])
def test_factors_are_kept_of_dense_solves_that_are_asked_to(qp):
    plain = solve_qp(*qp)
    assert plain.factors is None
    assert Solver(*qp).solve().factors is None
    result = solve_qp(*qp, derivative=True)
    assert result.factors is not None
    found, expected = (r.backward(dx=qp.q) for r in (result, plain))
    assert_equal_gradients(found, expected, (*VECTORS, *"PGA"))
    assert pickle.loads(pickle.dumps(result)).factors is None
    sparse = stored(sp.csc_array, qp._asdict())
    assert solve_qp(**sparse, derivative=True).factors is None
    with pytest.raises(TypeError, match="derivative must be True or False, got 1"):
        solve_qp(*qp, derivative=1)


def test_factors_are_not_disturbed_by_later_solves():
    """Those of a Solver serve until it solves again, and are made anew then."""
    qp, other = regular_qp(1), regular_qp(2)
    result = solve_qp(*qp, derivative=True)
    before = result.backward(dx=qp.q).q
    for _ in range(3):
        solve_qp(*other, derivative=True).backward(dx=other.q)
    assert np.array_equal(result.backward(dx=qp.q).q, before)
    solver = Solver(*qp)
    for change in ({"q": qp.q + 1.0}, {"P": other.P}, {"q": qp.q}):
        kept, fresh = solver.solve(derivative=True), solve_qp(*solver.qp)
        solver.update(**change)
        solver.solve()
        expected = fresh.backward(dx=qp.q)
        assert_equal_gradients(kept.backward(dx=qp.q), expected, (*VECTORS, *"PGA"))


def test_factors_are_left_where_they_do_not_serve():
    """At a kink, for a singular P, and for most variables at bounds (n >= 32)."""
    result = solve_qp(np.eye(1), [0.0], lb=[0.0], derivative=True)
    found = result.backward(dx=[1.0])  # x = max(c, 0) with c = 0
    assert (found.weak, found.q.tolist()) == (1, [-1.0])
    twice = solve_qp([[1.0]], [-2.0], [[1.0], [1.0]], [1.0, 1.0], derivative=True)
    assert sorted(twice.backward(dx=[1.0]).h.tolist()) == [0.0, 1.0]
    n = 40
    q = np.where(np.arange(n) < 2, -1.0, 1.0)
    solver = Solver(np.eye(n), q, lb=np.zeros(n))
    own, other = (solver.solve(derivative=True).backward(dx=np.ones(n)) for _ in "ab")
    assert np.array_equal(own.q, other.q)
    flat = Solver(np.zeros((1, 1)), [1.0], lb=[0.0])
    flat.solve(derivative=True)
    assert flat.solve(derivative=True).backward(dx=[1.0]).lb.tolist() == [1.0]
