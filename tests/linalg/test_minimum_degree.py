"""Approximate minimum degree against elimination on dense patterns."""

import numpy as np
import pytest
from numba import njit
from problems_elimination import fill, laplacian, natural, parts, upper
from scipy.sparse import csc_array

from namlcp.linalg.minimum_degree import (
    BESIDE,
    VARIABLE,
    mark_hubs,
    minimum_degree,
)


def scattered(size, entries, seed):
    """Return a random symmetric pattern with about so many entries a row, dense."""
    rng = np.random.default_rng(seed)
    K = rng.random((size, size)) < 0.5 * entries / size
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


def arrow(size):
    """Return the pattern of a star: row 0 is beside all others."""
    K = np.eye(size)
    K[0] = K[:, 0] = 1.0
    return K


CASES = {
    "one": np.array([[-2.0]]),
    "diagonal": np.eye(5),
    "dense": np.ones((40, 40)),
    "star": arrow(30),
    "path": laplacian(1, 50).toarray(),
    "tree": tree(200, 1),
    "grid": laplacian(15, 13).toarray(),
    "apart": np.kron(np.eye(3), scattered(20, 4, 2)),
    "alike": np.kron(scattered(25, 3, 3), np.ones((4, 4))),
    "sparse": scattered(150, 3, 4),
    "denser": scattered(150, 30, 5),
    "saddle": saddle(80, 60, 3, 6),
    "long rows": saddle(120, 8, 60, 7),
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


def test_the_order_is_a_permutation_with_its_counts(K):
    order = minimum_degree(*parts(upper(K)))
    by_place = np.argsort(order.place)
    np.testing.assert_array_equal(order.place[by_place], np.arange(K.shape[0]))
    L = fill(K[np.ix_(by_place, by_place)])
    np.testing.assert_array_equal(order.counts, L.sum(axis=0) - 1)


def test_fill_is_nearly_that_of_exact_degrees(K):
    total = minimum_degree(*parts(upper(K))).counts.sum()
    assert total <= 1.12 * least_fill(K)


def test_indices_of_64_bits_are_read_as_such(K):
    indptr, indices = parts(upper(K))[:2]
    order = minimum_degree(indptr.astype(np.int64), indices.astype(np.int64))
    np.testing.assert_array_equal(order.place, minimum_degree(indptr, indices).place)


@pytest.mark.parametrize("name", ["diagonal", "star", "path", "tree"])
def test_a_forest_has_no_fill(name):
    U = upper(CASES[name])
    assert minimum_degree(*parts(U)).counts.sum() == U.nnz - U.shape[0]


def test_nothing_is_ordered():
    order = minimum_degree(np.zeros(1, np.int32), np.empty(0, np.int32))
    assert [part.size for part in order] == [0, 0, 0]
    assert order.work == 0.0


def test_entries_given_twice_do_not_matter():
    """A pattern with duplicates has the counts of the same pattern without."""
    U = upper(CASES["saddle"])
    indptr = (2 * U.indptr).astype(np.int32)
    twice = minimum_degree(indptr, np.repeat(U.indices, 2))
    L = fill(CASES["saddle"][np.ix_(*2 * (np.argsort(twice.place),))])
    np.testing.assert_array_equal(twice.counts, L.sum(axis=0) - 1)


def test_orders_repeat(K):
    one, two = (minimum_degree(*parts(upper(K))) for _ in range(2))
    np.testing.assert_array_equal(one.place, two.place)


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


@njit
def marked(indptr, indices, kind, degree, inside, large):
    mark_hubs(indptr, indices, kind, kind.size, degree, inside, large)


def hubs_of(K):
    U = upper(K)
    kind = np.full(U.shape[0], VARIABLE)
    marked(*parts(U), kind, *np.empty((3, kind.size), dtype=np.int64))
    return np.flatnonzero(kind == BESIDE)


def test_hubs_have_many_neighbours_that_are_none():
    assert list(hubs_of(arrow(400))) == [0]
    few = np.eye(400)
    few[0, :40] = few[:40, 0] = 1.0
    assert hubs_of(few).size == 0  # 39 neighbours are fewer than 2 * sqrt(400)
    assert hubs_of(np.ones((300, 300))).size == 0
    block = laplacian(60, 60).tolil()
    block[:400, :400] = 1.0
    assert hubs_of(block).size == 0
    block[1000, :] = block[:, 1000] = 1.0
    assert list(hubs_of(block)) == [1000]


def test_hubs_cost_no_fill():
    """Long rows over a sparse part: as if their order had been sought, too."""
    K = laplacian(50, 50).tolil()
    rng = np.random.default_rng(9)
    hubs = rng.choice(2500, 20, replace=False)
    for h in hubs:
        beside = rng.choice(2500, 400, replace=False)
        K[h, beside] = K[beside, h] = 1.0
    order = minimum_degree(*parts(upper(K)))
    assert sorted(order.place[hubs_of(K)]) == list(range(2480, 2500))
    rest = np.delete(np.arange(2500), hubs)
    inner = minimum_degree(*parts(upper(K.toarray()[np.ix_(rest, rest)])))
    assert order.counts.sum() <= inner.counts.sum() + 2500 * 20


def test_minimum_degree_saves_fill():
    U = upper(laplacian(30, 30))
    assert minimum_degree(*parts(U)).work < 0.4 * natural(U).work
