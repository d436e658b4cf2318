"""Order, tree and supernodes against elimination of dense patterns."""

import sys

import numpy as np
import pytest
from problems_elimination import fill, laplacian, parts, upper

from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.ordering import (
    elimination_tree,
    nested_dissection,
    supernodes,
)


def scattered(size, density, seed):
    """Return a random symmetric pattern with a full diagonal, dense."""
    K = np.random.default_rng(seed).random((size, size)) < density
    return 1.0 * (K | K.T | np.eye(size, dtype=bool))


CASES = {
    "one": np.array([[-2.0]]),
    "diagonal": np.diag([1.0, -2.0, 3.0]),
    "dense": scattered(90, 1.0, 1),
    "sparse": scattered(150, 0.015, 2),
    "two parts": np.kron(np.eye(2), scattered(18, 0.15, 3)),
    "grid": laplacian(17, 13).toarray(),
}


@pytest.fixture(params=CASES)
def K(request):
    return CASES[request.param]


def test_tree_and_counts_are_those_of_the_elimination(K):
    U = upper(K)
    parent, count = elimination_tree(*parts(U))
    L = fill(K)
    np.fill_diagonal(L, False)
    np.testing.assert_array_equal(count, L.sum(axis=0))
    first = np.where(L.any(axis=0), L.argmax(axis=0), -1)
    np.testing.assert_array_equal(parent, first)


@pytest.mark.parametrize("find", [minimum_degree, nested_dissection])
def test_an_order_is_a_postordered_permutation(K, find):
    if find is nested_dissection:
        pytest.importorskip("pymetis")
    U = upper(K)
    order = find(*parts(U))
    size = U.shape[0]
    np.testing.assert_array_equal(np.sort(order.place), np.arange(size))
    by_place = np.argsort(order.place)
    L = fill(K[np.ix_(by_place, by_place)])
    np.testing.assert_array_equal(order.counts, L.sum(axis=0) - 1)
    # the descendants of a node stand directly before it
    descendants = np.ones(size, dtype=int)
    for j in range(size):
        if order.parent[j] >= 0:
            assert order.parent[j] > j
            descendants[order.parent[j]] += descendants[j]
    for j in range(size):
        if order.parent[j] >= 0:
            assert order.parent[j] - descendants[order.parent[j]] < j


def test_supernodes_hold_the_pattern_of_their_columns(K):
    order = minimum_degree(*parts(upper(K)))
    nodes = supernodes(*parts(upper(K)), order)
    by_place = np.argsort(order.place)
    L = fill(K[np.ix_(by_place, by_place)])
    for s in range(nodes.parent.size):
        begin, end = nodes.first[s : s + 2]
        rows = nodes.rows[nodes.starts[s] : nodes.starts[s + 1]]
        np.testing.assert_array_equal(rows[: end - begin], np.arange(begin, end))
        assert (np.diff(rows) > 0).all()
        assert np.isin(np.flatnonzero(L[:, begin:end].any(axis=1)), rows).all()
        assert (nodes.node[begin:end] == s).all()
        above = nodes.node[rows[end - begin]] if rows.size > end - begin else -1
        assert nodes.parent[s] == above
        size = nodes.panels[s + 1] - nodes.panels[s]
        assert size == rows.size * (end - begin)


def test_leaves_with_the_same_rows_share_a_supernode():
    leaves, others, rows = 9, 90, 40
    K = np.eye(leaves + others)
    K[leaves:, leaves:] = 1.0
    K[leaves : leaves + rows, :leaves] = K[:leaves, leaves : leaves + rows] = 1.0
    K[0, leaves:] = K[leaves:, 0] = np.arange(others) < 20
    order = minimum_degree(*parts(upper(K)))
    nodes = supernodes(*parts(upper(K)), order)
    alone, *twins = nodes.node[order.place[:leaves]]
    assert len(set(twins)) == 1
    assert alone != twins[0]


def test_of_nothing_there_is_no_nested_dissection():
    assert nested_dissection(np.zeros(1, np.int32), np.empty(0, np.int32)) is None


def test_without_metis_there_is_no_nested_dissection(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymetis", None)
    assert nested_dissection(*parts(upper(CASES["grid"]))) is None
