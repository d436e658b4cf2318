"""Batches by few compiled calls: item by item what a fresh solve gives."""

import numpy as np
import pytest
from responding import solve

from namlcp.options import Options
from namlcp.qp.problem import QP
from namlcp.qp.responses import DenseResponses, Stack
from namlcp.residuals import qp_residuals

OPTIONS = Options()


def items_of(rng, size, n, m, p):
    """Return stacked feasible QPs."""
    root = rng.standard_normal((size, n, n))
    P = root @ root.transpose(0, 2, 1) + np.eye(n)
    G, A = rng.standard_normal((size, m, n)), rng.standard_normal((size, p, n))
    x = rng.standard_normal((size, n))
    h = np.einsum("kij,kj->ki", G, x) + rng.random((size, m))
    b = np.einsum("kij,kj->ki", A, x)
    lb, ub = x - rng.random((size, n)), x + rng.random((size, n))
    return QP((P + P.transpose(0, 2, 1)) / 2, 3.0 * x[::-1], G, h, A, b, lb, ub)


def item(shared, stacked, i):
    return shared._replace(**{name: array[i] for name, array in stacked.items()})


@pytest.mark.parametrize("names", [QP._fields, ("q",), ("q", "A"), ("lb",)])
def test_items_get_the_answer_of_a_fresh_solve(names):
    size = 20
    arrays = items_of(np.random.default_rng(len(names)), size, 8, 12, 2)
    shared = QP(*(array[3] for array in arrays))
    stacked = {name: np.ascontiguousarray(getattr(arrays, name)) for name in names}
    if names in (("q", "A"), ("lb",)):  # feasible whatever the rest
        wide = np.full(12, 50.0)
        shared = shared._replace(h=wide, lb=shared.lb - 50.0, ub=shared.ub + 50.0)
    stack = Stack(shared, stacked)
    found = stack.solve(0, size, OPTIONS)
    assert found.solved.sum() >= size // 2
    for start, end in ((0, 11), (11, size), *((i, i + 1) for i in range(size))):
        for part, whole in zip(stack.solve(start, end, OPTIONS), found, strict=True):
            rows = found.solved[start:end]
            np.testing.assert_array_equal(part[rows], whole[start:end][rows])
    for i in np.flatnonzero(found.solved):
        qp = item(shared, stacked, i)
        kept = DenseResponses.of(qp)
        answer = solve(kept, qp, OPTIONS.limits())
        point = found.x[i], found.y[i], found.z[i], found.z_box[i]
        for mine, fresh in zip(point, answer.point, strict=True):
            np.testing.assert_allclose(mine, fresh, atol=1e-11)
        assert answer.iterations == found.pivots[i]
        residuals = qp_residuals(*qp, *point)
        np.testing.assert_allclose(found.numbers[i], residuals, atol=1e-9)


def test_a_bad_item_harms_no_other():
    size = 9
    arrays = items_of(np.random.default_rng(1), size, 5, 7, 1)
    first = QP(*(a[0] for a in arrays))
    good = Stack(first, arrays._asdict()).solve(0, size, OPTIONS)
    assert good.solved.all()
    spoiled = arrays._replace(**{k: v.copy() for k, v in arrays._asdict().items()})
    spoiled.P[1] = np.nan
    spoiled.q[2, 0] = np.inf
    spoiled.P[3] = -np.eye(5)
    spoiled.P[4, 0, 1] += 1.0
    spoiled.lb[5] = spoiled.ub[5] + 1.0
    spoiled.G[6] = np.inf
    bad = Stack(first, spoiled._asdict()).solve(0, size, OPTIONS)
    np.testing.assert_array_equal(np.flatnonzero(bad.solved), [0, 7, 8])
    for i in (0, 7, 8):
        np.testing.assert_array_equal(bad.x[i], good.x[i])


def test_sparse_and_large_problems_are_not_stacked():
    rows = np.ones((2000, 2)), np.ones(2000), np.empty((0, 2)), np.empty(0)
    large = QP(np.eye(2), np.ones(2), *rows, np.zeros(2), np.ones(2))
    assert not Stack.takes(large)
    assert Stack.takes(large._replace(G=np.ones((3, 2)), h=np.ones(3)))
