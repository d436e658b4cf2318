"""Order, tree and supernodes against elimination of dense patterns."""

import sys

import numpy as np
import pytest
from problems_elimination import fill, laplacian, natural, parts, upper
from scipy.sparse import csc_array

from namlcp.linalg.ordering import (
    elimination_tree,
    minimum_degree,
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


def test_members_alone_are_ordered(K):
    """Of a full symmetric matrix, as of its upper triangle."""
    member = np.random.default_rng(5).random(K.shape[0]) < 0.6
    member[0] = True
    F = np.flatnonzero(member)
    alone = minimum_degree(*parts(upper(K[np.ix_(F, F)])))
    for U in (upper(K), csc_array(K)):
        order = minimum_degree(*parts(U), member)
        np.testing.assert_array_equal(order.place[F], alone.place)
        np.testing.assert_array_equal(order.counts, alone.counts)
        assert (order.place[~member] == -1).all()
    none = minimum_degree(*parts(U), np.zeros(K.shape[0], dtype=bool))
    assert none.parent.size == 0


def test_hubs_are_eliminated_last():
    K = laplacian(20, 20).toarray()
    K[7] = K[:, 7] = 1.0
    order = minimum_degree(*parts(upper(K)))
    assert order.place[7] == 399
    without = np.arange(400) != 7
    rest = minimum_degree(*parts(upper(K)), without)
    assert order.counts.sum() == rest.counts.sum() + 399
    assert minimum_degree(*parts(upper(np.ones((150, 150))))).counts[0] == 149


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


def test_minimum_degree_saves_fill():
    U = upper(laplacian(30, 30))
    assert minimum_degree(*parts(U)).work < 0.4 * natural(U).work


def test_of_nothing_there_is_no_nested_dissection():
    assert nested_dissection(np.zeros(1, np.int32), np.empty(0, np.int32)) is None


def test_without_metis_there_is_no_nested_dissection(monkeypatch):
    monkeypatch.setitem(sys.modules, "pymetis", None)
    assert nested_dissection(*parts(upper(CASES["grid"]))) is None
