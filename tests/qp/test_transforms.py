"""Substitution, presolve and scaling: the same QP before and after, by one property."""

from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest
from problems_qp import (
    QP,
    assert_certificate,
    assert_solves_qp,
    complementary,
    dense_scaled,
    make_qp,
    residual_form,
    solve_sparse,
    upper_triangle_of,
)

from namlcp import Status, solve_qp
from namlcp.options import Options
from namlcp.qp.kkt import ScaledQP
from namlcp.qp.problem import make_guess
from namlcp.qp.reductions import Substitution, presolve, substitute

INF = np.inf


def with_structure(seed):
    """Proportional, empty, single and infinite rows, fixed and free variables."""
    rng = np.random.default_rng(seed)
    n, m, p, k = rng.integers(1, 8), rng.integers(0, 14), rng.integers(0, 8), 2
    base = rng.integers(-2, 3, (4, n)) * (rng.random((4, n)) < 0.6)
    factors = rng.choice([-3.0, -1.0, 0.5, 1.0, 2.0], m + p)
    C = base[rng.integers(0, 4, m + p)] * factors[:, None]
    side = C @ rng.integers(-1, 2, n) + rng.integers(0, 3, m + p) * 1.0
    side[m:] -= rng.choice([0.0, 0.0, 1e-7], p)
    side[:m][rng.random(m) < 0.2] = INF
    lb, ub = np.full(n + k, -5.0), np.full(n + k, 5.0)
    lb[rng.random(n + k) < 0.3] = -INF
    fixed = rng.random(n + k) < 0.25
    lb[fixed] = ub[fixed] = 1.0
    for i in np.flatnonzero(np.count_nonzero(C[:m], axis=1) == 1):  # beside a bound
        j = C[i].nonzero()[0][0]
        value, bound = side[i] / C[i, j], lb if C[i, j] > 0.0 else ub
        if lb[j] < value < ub[j]:
            bound[j] = value
    lb[n:], ub[n:] = -INF, INF
    E = np.hstack((rng.integers(-1, 2, (k, n)), np.diag(rng.uniform(0.5, 2.0, k))))
    wide = np.zeros((m + p, k))
    C, P = np.hstack((C, wide)), np.diag(np.ones(n + k))
    P[-1, -1] = 0.0
    A, b = np.vstack((C[m:], E)), np.append(side[m:], rng.standard_normal(k))
    qp = make_qp(P, rng.standard_normal(n + k), C[:m], side[:m], A, b, lb, ub)
    for M in (qp.G, qp.A):
        if M.nnz > 3:
            M.data[rng.integers(M.nnz)] = 0.0
    return qp


class Transform(NamedTuple):
    """The inner QP, the map of a point out, and that of a guess in.

    `gone` are the variables without a counterpart.
    """

    inner: QP
    point: Any
    guess: Any
    gone: Any


def by_substitution(qp):
    found = substitute(qp)
    if found is None:
        return None

    def guess(point):
        near = found.guess(make_guess(qp, None, point))
        return near.x, near.y, near.z, near.z_box

    def point(p, data=1.0):
        return found.point(p.x, p.y, p.z, p.z_box, data)

    return Transform(found.problem, point, guess, found.columns)


def by_presolve(qp):
    small = presolve(qp, 1e-6, 0.0)
    if small.contradictions or not small.q.size:
        return None
    s = ScaledQP(small)
    P, A, S = dense_scaled(s)
    free = np.full(s.n, INF)
    inner = QP(P, s.q, S, s.c, A, s.b, -free, free)

    def guess(p):
        x, y, Z, _ = s.guess(make_guess(qp, None, p))
        return x, y, Z[s.place >= s.n], 0.0 * x

    def point(p, data=1.0):
        return s.point(p.x, p.y, p.z, data)

    return Transform(inner, point, guess, small.fixed)


TRANSFORMS = {"substitution": by_substitution, "presolve and scaling": by_presolve}


def gradient(qp, p):
    """Of the Lagrangian in x."""
    return qp.P @ p.x + qp.q + qp.A.T @ p.y + qp.G.T @ p.z + p.z_box


def violation(qp, x):
    finite = np.where(np.isfinite(qp.h), qp.G @ x - qp.h, -1.0)
    parts = finite, abs(qp.A @ x - qp.b), qp.lb - x, x - qp.ub
    return max(np.max(part, initial=0.0) for part in parts)


@pytest.mark.parametrize("name", TRANSFORMS)
def test_the_qp_before_and_after_is_one(name):
    """Cost, feasibility, stationarity and multipliers, there and back."""
    seen = 0
    for seed in range(250):
        qp = with_structure(seed)
        found = TRANSFORMS[name](qp)
        if found is None:
            continue
        seen += 1
        rng = np.random.default_rng(seed)
        inner, point, guess, gone = found
        n, m, p = inner.q.size, inner.h.size, inner.b.size
        costs, out = [], []
        for x in (rng.integers(-2, 3, n) * 1.0, rng.standard_normal(n)):
            z, z_box = rng.random(m), rng.standard_normal(n) * (name == "substitution")
            z_box[np.isinf(inner.ub)] = -abs(z_box[np.isinf(inner.ub)])
            z_box[np.isinf(inner.lb)] = abs(z_box[np.isinf(inner.lb)])
            z_box[np.isinf(inner.lb) & np.isinf(inner.ub)] = 0.0
            z[np.isinf(inner.h)] = 0.0
            own = SimpleNamespace(x=x, y=rng.standard_normal(p), z=z, z_box=z_box)
            far = point(own)
            out.append(far.x)
            assert (far.z >= 0.0).all()
            assert not far.z_box[np.isinf(qp.lb) & np.isinf(qp.ub)].any()
            d = SimpleNamespace(**vars(own) | {"x": rng.standard_normal(n)})
            outer, mine = gradient(qp, far), gradient(inner, own)
            np.testing.assert_allclose(outer @ point(d, 0.0).x, mine @ d.x, 1e-9, 1e-9)
            np.testing.assert_allclose(outer[gone], 0.0, atol=1e-9)
            assert (violation(qp, far.x) <= 1e-6) == (violation(inner, x) <= 1e-6)
            back = guess(far)
            np.testing.assert_allclose(back[0], x, atol=1e-9)
            np.testing.assert_allclose(back[1], own.y, atol=1e-9)
            np.testing.assert_allclose(back[2], z[: back[2].size], atol=1e-9)
            costs.append([
                0.5 * x @ (inner.P @ x) + inner.q @ x,
                0.5 * far.x @ (qp.P @ far.x) + qp.q @ far.x,
            ])  # fmt: skip
        ours, theirs = np.subtract(*costs)
        np.testing.assert_allclose(ours, theirs, 1e-9, 1e-9)
    assert seen > 50


def test_contradictions_of_presolve_are_proofs():
    """b'y + h'z < 0 with A'y + G'z = 0 in the free columns, z >= 0."""
    seen = 0
    for seed in range(120):
        qp = with_structure(seed)
        small, held = presolve(qp, 1e-6, 0.0), np.zeros(qp.q.size)
        held[small.fixed], free = small.x_fixed, small.kept
        for _, y, z in small.contradictions:
            finite = np.where(z > 0.0, qp.h, 0.0)
            assert (qp.b - qp.A @ held) @ y + (finite - qp.G @ held) @ z < 0.0
            np.testing.assert_allclose((qp.A.T @ y + qp.G.T @ z)[free], 0, atol=1e-12)
            assert (z >= 0.0).all()
            seen += 1
    assert seen > 10


def test_presolve_drops_what_is_redundant():
    """Multiples of rows, an empty and an infinite one, two fixed variables."""
    known = complementary(0, 12, 10, 3, 12)
    P, q, G, h, A, b, lb, ub = known.qp
    G = np.vstack((G.toarray(), -2.0 * G.toarray()[:4], np.zeros(12), np.ones(12)))
    h = np.concatenate((h, -2.0 * (h[:4] - 3.0), [1.0, INF]))
    A = np.vstack((A.toarray(), 3.0 * A.toarray()[1]))
    lb, ub = lb.copy(), ub.copy()
    lb[:2] = ub[:2] = known.x[:2]
    qp = make_qp(P, q, G, h, A, np.append(b, 3.0 * b[1]), lb, ub)
    small = presolve(qp, 1e-9, 0.0)
    sizes = small.q.size, small.b.size, np.isfinite(small.sides[1]).sum()
    assert (*sizes, small.sides[1].size) == (10, 3, 4, 10)
    assert_solves_qp(qp, solve_sparse(qp))


@pytest.mark.parametrize("cost", [1.0, -3.0])
@pytest.mark.parametrize("g", [2.0, -2.0])
def test_a_row_beside_the_opposite_bound_leaves_no_interior(g, cost):
    """x_0 = 3 by a bound and row 1 of G: the one that holds it has the multiplier."""
    lb, ub = ([3.0, 0.0], None) if g > 0.0 else (None, [3.0, 9.0])
    G = np.array([[1.0, 1.0], [g, 0.0]])
    qp = make_qp(np.eye(2), [cost * 5.0, -9.0], G, [5.0, 3.0 * g], lb=lb, ub=ub)
    result = solve_sparse(qp)
    assert_solves_qp(qp, result)
    np.testing.assert_allclose(result.x, [3.0, 2.0], atol=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_such_a_row_is_in_certificates(sign):
    """x_0 = 3 by a row, and no x_1 >= 0 has x_0 + x_1 = 2, or x_0 = 2."""
    G, h = np.array([[-2.0, 0.0]]), [-6.0]
    for row in ([1.0, 1.0], [1.0, 0.0]):
        A, b = sign * np.array([row]), [sign * 2.0]
        qp = make_qp(np.eye(2), np.ones(2), G, h, A, b, [-9.0, 0.0], [3.0, 9.0])
        assert_certificate(qp, solve_sparse(qp))


@pytest.mark.parametrize("ratio", [1.0, -1.0])
def test_proportional_equations_are_merged_within_the_tolerance(ratio):
    """Both rows are off by as much; beyond the tolerance they are a proof."""
    tol = 1e-6
    P, q, G, h, A, b, lb, ub = complementary(0, 20, 10, 4, 7).qp
    A = np.vstack((A.toarray(), ratio * A.toarray()[2]))
    for off, count in ((0.9, 0), (1.1, 1)):
        off *= 2.0 * tol
        qp = make_qp(P, q, G, h, A, np.append(b, ratio * (b[2] + off)), lb, ub)
        small = presolve(qp, tol, 0.0)
        expected = b + 0.5 * off * np.eye(4)[2]
        np.testing.assert_allclose(small.b, expected, atol=1e-12)
        assert len(small.contradictions) == count
        if count == 0:
            limits = Options(eps_abs=tol, eps_rel=0.0).limits()
            assert_solves_qp(qp, solve_sparse(qp, limits), tol)


def test_an_entry_of_1e_9_is_an_entry():
    """Rows that agree in single precision are not proportional for that."""
    rows = np.array([[1.0, 2.0, 0.0], [-2.0, -4.0, 1e-9]])
    for order in ([0, 1], [1, 0]):
        for entry, left in ((1e-9, 2), (0.0, 1)):
            rows[1, 2] = entry
            qp = make_qp(np.eye(3), np.ones(3), rows[order], [-1.0, 5.0])
            assert presolve(qp, 1e-9, 0.0).sides[0].size == left
            assert_solves_qp(qp, solve_sparse(qp))


def test_scaling_equilibrates():
    """The largest entry of each row of |K| is nearly 1."""
    for seed in range(3):
        s = ScaledQP(presolve(complementary(seed, 10, 12, 2, 10).qp, 1e-9, 0.0))
        K = upper_triangle_of(s.kkt)
        K = abs(K + K.T).toarray()
        np.fill_diagonal(K, abs(s.kkt.base[s.kkt.diagonal]))
        np.testing.assert_allclose(K.max(axis=1), 1.0, atol=0.03)


@pytest.mark.parametrize(("rows", "n"), [(30, 8), (300, 8), (8, 30)])
def test_residuals_of_least_squares_are_substituted(rows, n):
    qp, B, _ = residual_form(0, rows, n)
    inner = substitute(qp).problem
    assert (inner.q.size, inner.b.size) == (n, 0)
    np.testing.assert_allclose(inner.P.toarray(), 2 * B.T @ B, atol=1e-12)


def test_rows_without_a_cost_are_substituted_without_filling_the_cost():
    qp, _, _ = residual_form(0, 2, 40)
    free = qp._replace(P=0.0 * qp.P)
    assert substitute(free).problem.P.nnz == 0


def with_residuals(kind):
    """Least squares whose residuals are variables, made impossible or unbounded."""
    qp, _, _ = residual_form(11, 60, 20, lower=0.0)
    if kind == "certificate":
        row = np.append(np.zeros(60), np.ones(20))
        G = np.vstack((qp.G.toarray(), row))
        return qp._replace(G=make_qp(qp.P, qp.q, G).G, h=np.append(qp.h, -1.0))
    if kind == "ray":  # the last variable is in no residual and costs -1
        P, G, A = (np.pad(M.toarray(), ((0, k), (0, 1))) for M, k in
                   ((qp.P, 1), (qp.G, 0), (qp.A, 0)))  # fmt: skip
        return make_qp(P, np.append(qp.q, -1.0), G, qp.h, A, qp.b)
    return qp


SPOILT = {
    "point": (Status.SOLVED, 1.0, lambda point: point._replace(x=point.x + 1e-3)),
    "certificate": (Status.PRIMAL_INFEASIBLE, 0.0, lambda p: p._replace(z=0.0 * p.z)),
    "ray": (Status.DUAL_INFEASIBLE, 0.0, lambda p: p._replace(x=1.0 + 0.0 * p.x)),
}  # fmt: skip


@pytest.mark.parametrize("what", SPOILT)
def test_what_comes_back_wrong_does_not_come_out(monkeypatch, what):
    """The QP is solved as it came where its own data do not confirm the answer."""
    qp, (status, which, wrong) = with_residuals(what), SPOILT[what]
    right, calls = Substitution.point, []

    def spoilt(*arguments):
        if arguments[-1] != which:
            return right(*arguments)
        calls.append(what)
        return wrong(right(*arguments))

    monkeypatch.setattr(Substitution, "point", spoilt)
    result = solve_qp(*qp)
    assert calls
    assert result.status is status
    if status is Status.SOLVED:
        assert_solves_qp(qp, result, 1e-9)
    else:
        assert_certificate(qp, result)
