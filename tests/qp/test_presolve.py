"""Groups that look alike, and numbers that are none."""

import numpy as np
import pytest
from problems_qp import assert_solves_qp, complementary, make_qp, solve_sparse
from scipy.sparse import csc_array

from namlcp.options import Options
from namlcp.qp.path.newton import weighted_norm
from namlcp.qp.transforms.presolve import presolve
from namlcp.qp.transforms.repeated import (
    EMPTY,
    UNWANTED,
    leading_rows,
)


def rows_of(M):
    """Return what `leading_rows` finds for all rows and columns."""
    M = csc_array(M)
    M.has_canonical_format = True
    M.indices, M.indptr = M.indices.astype(np.int32), M.indptr.astype(np.int32)
    return leading_rows(M, np.arange(M.shape[1]), np.ones(M.shape[0], dtype=bool))


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rows_with_another_entry_are_not_equal(order, sign):
    M = np.array([[1.0, 2.0, 0.0], [sign, 2.0 * sign, 1e-9]])[list(order)]
    leaders, rows = rows_of(M)
    assert not rows.repeated
    np.testing.assert_array_equal(leaders.toarray(), M)
    M = np.array([[1.0, 2.0, 0.0], [sign, 2.0 * sign, 0.0]])[list(order)]
    leaders, rows = rows_of(M)
    assert rows.repeated
    np.testing.assert_array_equal(rows.leader, 0)
    np.testing.assert_array_equal(rows.first, [0])
    np.testing.assert_array_equal(leaders.toarray(), M[:1])
    assert rows.sign[1] == sign
    assert not rows_of(np.array([[1.0, 2.0], [2.0, 4.0]]))[1].repeated


def random_sides(seed):
    """Return a QP with repeated, empty and infinite rows and fixed variables."""
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 8), rng.integers(0, 14), rng.integers(0, 8)
    base = rng.integers(-2, 3, (4, n)) * (rng.random((4, n)) < 0.6)
    factors = rng.choice([-1.0, -1.0, 0.5, 1.0, 1.0], m + p)
    C = base[rng.integers(0, 4, m + p)] * factors[:, None]
    side = C @ rng.integers(-1, 2, n) + rng.integers(0, 3, m + p) * 1.0
    side[m:] -= rng.choice([0.0, 0.0, 1e-7], p) + rng.integers(0, 2) * 0.0
    side[:m][rng.random(m) < 0.2] = np.inf
    lb, ub = np.full(n, -5.0), np.full(n, 5.0)
    lb[rng.random(n) < 0.3] = -np.inf
    fixed = rng.random(n) < 0.25
    lb[fixed] = ub[fixed] = 1.0
    P = np.diag(np.ones(n))
    qp = make_qp(P, rng.standard_normal(n), C[:m], side[:m], C[m:], side[m:], lb, ub)
    for M in (qp.G, qp.A):
        if M.nnz > 3:
            M.data[rng.integers(M.nnz)] = 0.0
    return qp


def plain_groups(C, usable):
    """Return {first row of a group: its rows} for the usable rows of a dense matrix."""
    groups = {}
    for i in np.flatnonzero(usable):
        for head in groups:
            if (C[i] == C[head]).all() or (C[i] == -C[head]).all():
                groups[head].append(int(i))
                break
        else:
            groups[int(i)] = [int(i)]
    return groups


@pytest.mark.parametrize("seed", range(60))
def test_groups_and_ranges_are_those_of_the_definition(seed):
    qp = random_sides(seed)
    small = presolve(qp, 1e-6, 0.0)
    free, wanted = qp.lb != qp.ub, qp.h < np.inf
    np.testing.assert_array_equal(small.kept, np.flatnonzero(free))
    np.testing.assert_array_equal(small.x_fixed, qp.lb[~free])
    h = qp.h - qp.G @ np.where(free, 0.0, qp.lb)
    G, rows = qp.G.toarray()[:, free], small.G_groups
    groups = plain_groups(G, G.any(axis=1) & wanted)
    np.testing.assert_array_equal(rows.first, list(groups))
    np.testing.assert_array_equal(small.G.toarray(), G[rows.first])
    np.testing.assert_array_equal(rows.leader == UNWANTED, ~wanted)
    np.testing.assert_array_equal(rows.leader == EMPTY, ~G.any(axis=1) & wanted)
    for k, members in enumerate(groups.values()):
        sign = rows.sign[members]
        np.testing.assert_array_equal(G[members], np.outer(sign, G[members[0]]))
        value = sign * h[members]
        assert small.upper[k] == min(value[sign > 0.0], default=np.inf)
        assert small.lower[k] == max(value[sign < 0.0], default=-np.inf)
    for end, at in (small.upper, small.upper_of), (small.lower, small.lower_of):
        has = at >= 0
        np.testing.assert_array_equal(has, np.isfinite(end))
        np.testing.assert_array_equal((rows.sign * h)[at[has]], end[has])


@pytest.mark.parametrize("seed", range(60))
def test_repeated_equations_are_those_of_the_definition(seed):
    qp = random_sides(seed)
    small = presolve(qp, 1e-6, 0.0)
    free = qp.lb != qp.ub
    b = qp.b - qp.A @ np.where(free, 0.0, qp.lb)
    A, rows = qp.A.toarray()[:, free], small.A_groups
    groups = plain_groups(A, A.any(axis=1))
    np.testing.assert_array_equal(rows.first, list(groups))
    np.testing.assert_array_equal(small.A.toarray(), A[rows.first])
    for k, members in enumerate(groups.values()):
        value = rows.sign[members] * b[members]
        assert small.b[k] == 0.5 * (min(value) + max(value))
        for extreme, at in (max, small.largest_of), (min, small.smallest_of):
            assert rows.sign[at[k]] * b[at[k]] == extreme(value)


@pytest.mark.parametrize("seed", range(60))
def test_contradictions_of_presolve_are_proofs(seed):
    """b'y + h'z < 0 with A'y + G'z = 0 in the free columns, z >= 0."""
    qp = random_sides(seed)
    small = presolve(qp, 1e-6, 0.0)
    held = np.where(qp.lb == qp.ub, qp.lb, 0.0)
    free = qp.lb != qp.ub
    for reason in small.contradictions:
        y = reason.y
        z = np.zeros(qp.h.size) if reason.z is None else reason.z
        finite = np.where(z > 0.0, qp.h, 0.0)
        assert (qp.b - qp.A @ held) @ y + (finite - qp.G @ held) @ z < 0.0
        np.testing.assert_allclose((qp.A.T @ y + qp.G.T @ z)[free], 0.0, atol=1e-12)
        assert (z >= 0.0).all()


@pytest.mark.parametrize("seed", range(30))
def test_multipliers_come_back(seed):
    """The Lagrangian's gradient and the sums b'y and h'z are those of the small QP."""
    rng = np.random.default_rng(seed)
    qp = random_sides(seed)
    small = presolve(qp, 1e-6, 0.0)
    if small.contradictions:
        return
    x, y = rng.standard_normal(small.q.size), rng.standard_normal(small.b.size)
    upper = rng.random(small.upper.size) * np.isfinite(small.upper)
    lower = rng.random(small.lower.size) * np.isfinite(small.lower)
    box = rng.standard_normal(x.size)
    point = small.point(x, y, upper, lower, box)
    gradient = qp.P @ point.x + qp.q + qp.A.T @ point.y + qp.G.T @ point.z + point.z_box
    ours = small.P @ x + small.q + small.A.T @ y + small.G.T @ (upper - lower) + box
    np.testing.assert_allclose(gradient[small.kept], ours, atol=1e-12)
    np.testing.assert_allclose(gradient[small.fixed], 0.0, atol=1e-12)
    np.testing.assert_array_equal(point.x[small.fixed], small.x_fixed)
    assert (point.z >= 0.0).all()
    back = small.guess(point.y, point.z)
    np.testing.assert_allclose(back[1], upper, atol=1e-12)
    np.testing.assert_allclose(back[2], lower, atol=1e-12)


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_norm_of_a_residual_with_nan_is_nan(place):
    r, weight = np.array([1.0, -6.0, 2.0]), np.array([1.0, 2.0, 4.0])
    norm = getattr(weighted_norm, "py_func", weighted_norm)
    assert norm(r, weight, 3) == 3.0
    r[place] = np.nan
    assert np.isnan(norm(r, weight, 3))


def test_presolve_recovers_exactly():
    known = complementary(0, 12, 10, 3, 12)
    P, q, G, h, A, b, lb, ub = known.qp
    G = np.vstack((G.toarray(), -G.toarray()[:4], np.zeros(12), G.toarray()[5]))
    h = np.concatenate((h, -(h[:4] - 3.0), [1.0, np.inf]))
    A = np.vstack((A.toarray(), -A.toarray()[1]))
    lb, ub = lb.copy(), ub.copy()
    lb[:2] = ub[:2] = known.x[:2]
    qp = make_qp(P, q, G, h, A, np.append(b, -b[1]), lb, ub)
    small = presolve(qp, 1e-9, 0.0)
    assert small.q.size == 10
    assert small.lower.size == 10
    assert np.isfinite(small.lower).sum() == 4
    assert small.b.size == 3
    assert_solves_qp(qp, solve_sparse(qp, Options().limits()))
