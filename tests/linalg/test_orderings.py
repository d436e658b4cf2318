"""Fill-reducing orders, trees and supernodes, by elimination of dense patterns."""

import numpy as np
import pytest
from problems_elimination import fill, laplacian, natural, parts, upper

from namlcp.limits import Deadline, OutOfTime
from namlcp.linalg.ordering import minimum_degree, supernodes


def scattered(size, entries, seed):
    """Return a random symmetric pattern with about so many entries a row, dense."""
    K = np.random.default_rng(seed).random((size, size)) < 0.5 * entries / size
    return 1.0 * (K | K.T | np.eye(size, dtype=bool))


def saddle(n, p, entries, seed):
    """Return the pattern of [I A'; A I] with so many entries in a row of A, dense."""
    A = np.random.default_rng(seed).random((p, n)) < entries / n
    return np.block([[np.eye(n), A.T], [A, np.eye(p)]])


def tree(size, seed):
    """Return the pattern of a random tree, in random order, dense."""
    rng = np.random.default_rng(seed)
    K = np.eye(size)
    for i in range(1, size):
        j = rng.integers(max(0, i - 5), i)
        K[i, j] = K[j, i] = 1.0
    order = rng.permutation(size)
    return K[np.ix_(order, order)]


def with_rows(K, *rows):
    """Return the pattern with rows and columns that are beside all others."""
    K = K.copy()
    K[list(rows)] = K[:, list(rows)] = 1.0
    return K


FORESTS = {
    "one": np.array([[-2.0]]),
    "diagonal": np.eye(5),
    "star": with_rows(np.eye(30), 0),
    "path": laplacian(1, 50).toarray(),
    "tree": tree(200, 1),
}
CASES = FORESTS | {
    "none": np.empty((0, 0)),
    "dense": np.ones((40, 40)),
    "grid": laplacian(15, 13).toarray(),
    "hub in a grid": with_rows(laplacian(20, 20).toarray(), 7),
    "apart": np.kron(np.eye(3), scattered(20, 4, 2)),
    "alike": np.kron(scattered(25, 3, 3), np.ones((4, 4))),
    "sparse": scattered(150, 3, 4),
    "denser": scattered(150, 30, 5),
    "saddle": saddle(80, 60, 3, 6),
    "long rows": saddle(120, 8, 60, 7),
    "full rows": np.kron(saddle(60, 8, 60, 9), [[1.0, 1.0], [1.0, 1.0]]),
    "hubs alone": scattered(700, 400, 8),
}


@pytest.fixture(params=CASES)
def K(request):
    return CASES[request.param]


def least_fill(K):
    """Return the entries of L below the diagonal in exact minimum degree order."""
    graph = (K != 0) & ~np.eye(K.shape[0], dtype=bool)
    left = np.ones(K.shape[0], dtype=bool)
    total = 0
    while left.any():
        degree = np.where(left, graph.sum(axis=0), K.shape[0])
        v = int(np.argmin(degree))
        beside = np.flatnonzero(graph[v])
        total += beside.size
        graph[np.ix_(beside, beside)] = True
        graph[beside, beside] = False
        graph[v] = graph[:, v] = left[v] = False
    return total


def factor_pattern(K, order):
    """Return the pattern of L, with its diagonal, in an order."""
    by_place = np.argsort(order.place)
    return fill(K[np.ix_(by_place, by_place)])


def assert_is_an_order(K, order):
    """A permutation with the tree and the counts of L, children before parents."""
    size = K.shape[0]
    np.testing.assert_array_equal(np.sort(order.place), np.arange(size))
    below = factor_pattern(K, order) & ~np.eye(size, dtype=bool)
    counts = below.sum(axis=0)
    np.testing.assert_array_equal(order.counts, counts)
    assert order.work == counts @ counts
    first = [np.flatnonzero(below[:, j])[0] if counts[j] else -1 for j in range(size)]
    np.testing.assert_array_equal(order.parent, first)
    # the descendants of a node stand directly before it
    descendants = np.ones(size, dtype=int)
    for j in range(size):
        if order.parent[j] >= 0:
            descendants[order.parent[j]] += descendants[j]
    for j in range(size):
        if order.parent[j] >= 0:
            assert order.parent[j] - descendants[order.parent[j]] < j


def test_orders_have_little_fill_and_repeat(K):
    U = upper(K)
    order = minimum_degree(*parts(U))
    assert_is_an_order(K, order)
    assert_is_an_order(K, natural(U))
    assert order.counts.sum() <= 1.12 * least_fill(K)
    indptr, indices = parts(U)
    again = minimum_degree(indptr, indices)
    np.testing.assert_array_equal(order.place, again.place)
    # entries given twice leave it an order
    twice = minimum_degree((2 * indptr).astype(np.int32), np.repeat(indices, 2))
    assert_is_an_order(K, twice)


@pytest.mark.parametrize("name", FORESTS)
def test_a_forest_has_no_fill(name):
    U = upper(CASES[name])
    assert minimum_degree(*parts(U)).counts.sum() == U.nnz - U.shape[0]


def test_an_order_looks_at_the_clock():
    indptr, indices = parts(upper(laplacian(150, 150)))
    with pytest.raises(OutOfTime):
        minimum_degree(indptr, indices, Deadline(0.0))


def test_hubs_are_eliminated_last_and_cost_no_fill():
    """Long rows over a sparse part: as if their order had been sought, too."""
    K = laplacian(50, 50).tolil()
    rng = np.random.default_rng(9)
    hubs = rng.choice(2500, 20, replace=False)
    for h in hubs:
        beside = rng.choice(2500, 400, replace=False)
        K[h, beside] = K[beside, h] = 1.0
    order = minimum_degree(*parts(upper(K)))
    assert sorted(order.place[hubs]) == list(range(2480, 2500))
    rest = np.delete(np.arange(2500), hubs)
    inner = minimum_degree(*parts(upper(K.toarray()[np.ix_(rest, rest)])))
    assert order.counts.sum() <= inner.counts.sum() + 2500 * 20


def test_supernodes_hold_the_pattern_of_their_columns(K):
    if not K.size:
        return
    U = upper(K)
    order = minimum_degree(*parts(U))
    nodes = supernodes(*parts(U), order)
    L = factor_pattern(K, order)
    node = np.repeat(np.arange(nodes.parent.size), np.diff(nodes.first))
    assert node.size == K.shape[0]
    for s in range(nodes.parent.size):
        begin, end = nodes.first[s : s + 2]
        rows = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        np.testing.assert_array_equal(rows[: end - begin], np.arange(begin, end))
        assert (np.diff(rows) > 0).all()
        assert np.isin(np.flatnonzero(L[:, begin:end].any(axis=1)), rows).all()
        below, above = rows[end - begin :], nodes.parent[s]
        if below.size:
            assert above > s
            beyond = nodes.rows[nodes.starts[above] : nodes.starts[above + 1]]
            assert np.isin(below, beyond).all()
            assert node[below[0]] == above
        else:
            assert above == -1
        size = nodes.panels[s + 1] - nodes.panels[s]
        assert size == rows.size * (end - begin)
    assert L.sum() <= nodes.panels[-1] <= max(4 * L.sum(), 100)
