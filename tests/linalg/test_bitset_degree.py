"""The minimum-degree order of bitsets, by elimination of sets of neighbours."""

import numpy as np
import pytest
from numba import njit
from scipy.sparse import csc_array, eye_array, kron, random_array

from namlcp.linalg import bitset_minimum_degree


@njit
def ordered(indptr, indices, nodes, local):
    """Return the order of `bitset_minimum_degree`, which compiled code calls."""
    sequence = np.empty(nodes.size, dtype=np.int32)
    bitset_minimum_degree(indptr, indices, nodes, local, sequence)
    return sequence


def pattern(kind, n, rng):
    if kind == "blocks":  # chains of full blocks, as piles of boxes have them
        chain = csc_array(np.eye(n // 8) + np.eye(n // 8, k=1) + np.eye(n // 8, k=-1))
        return csc_array(kron(chain, np.ones((8, 8))))
    entries = random_array((n, n), density=float(kind) / n, rng=rng)
    return csc_array(entries + entries.T + eye_array(n))


def assert_minimum_degree(A, nodes, sequence):
    """Each node has the least degree, or no neighbours beside those of the one before.

    Once what is left is a clique any order will do: all degrees are equal then.
    """
    wanted = set(nodes.tolist())
    graph = {}
    for j in wanted:
        column = A.indices[A.indptr[j] : A.indptr[j + 1]]
        graph[j] = (set(column.tolist()) & wanted) - {j}
    clique = set()
    for v in sequence.tolist():
        least = min(map(len, graph.values()))
        near = graph.pop(v)
        assert len(near) == least or {v, *near} == clique
        clique = near
        for u in near:
            graph[u] = (graph[u] | near) - {u, v}
    assert not graph


@pytest.mark.parametrize("kind", ["0.5", "1.5", "4", "blocks"])
@pytest.mark.parametrize("n", [8, 64, 120, 200])
def test_every_node_has_the_least_degree_when_its_turn_comes(kind, n):
    rng = np.random.default_rng(n)
    A = pattern(kind, n, rng)
    indptr, indices = A.indptr.astype(np.int32), A.indices.astype(np.int32)
    some = np.flatnonzero(rng.random(n) < 0.7).astype(np.int32)
    for nodes in (np.arange(n, dtype=np.int32), some):
        local = np.full(n, -1, dtype=np.int32)
        sequence = ordered(indptr, indices, nodes, local)
        assert (local == -1).all()
        assert_minimum_degree(A, nodes, sequence)
