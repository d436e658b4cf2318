"""One step of Ruge and Stueben's coarsening: strong couplings, C/F splitting, P.

For nonsymmetric A the splitting uses the strong couplings of A and of A', since both
restriction and interpolation need coarse neighbours. With those of A alone, cycles on a
face of a convective five-point matrix leave 70 % of the error, not 20 %.

pyamg's compiled functions compute splitting and weights; its public functions copy
every matrix.
"""

from typing import Any

import numpy as np
from scipy import sparse

from namlcp.linalg.csc import arrays_of

THETA = 0.25
"""A coupling a_ij < 0 is strong if -a_ij >= THETA max_k -a_ik."""


def interpolation(
    A: Any, symmetric: bool, second_pass: bool
) -> tuple[Any, np.ndarray] | None:
    """Return P (n, m), a sorted csr_array, and the coarse unknowns; None if m = 0 or n.

    A : (n, n) csr_array, int32 indices. second_pass : strongly coupled fine unknowns
    must have a coarse neighbour in common.
    """
    from pyamg import amg_core  # a slow import

    n = A.shape[0]
    S = strong(A)
    graph = S
    if not symmetric:  # a sum of negative entries, which cannot cancel
        graph = sparse.csr_array(S + strong(sparse.csr_array(A.T)))
        graph.sort_indices()
    pattern = graph.indptr, graph.indices
    marks = np.ones(graph.nnz, dtype=np.int8)
    turned = sparse.csr_array(sparse.csc_array((marks, *pattern[::-1]), shape=(n, n)))
    influence, splitting = np.zeros(n, dtype=np.int32), np.empty(n, dtype=np.int32)
    amg_core.rs_cf_splitting(
        n, *pattern, turned.indptr, turned.indices, influence, splitting
    )
    if second_pass:
        amg_core.rs_cf_splitting_pass2(n, *pattern, splitting)
    coarse = np.flatnonzero(splitting).astype(np.int32)
    if not 0 < coarse.size < n:
        return None
    amg_core.remove_strong_FF_connections(n, S.indptr, S.indices, S.data, splitting)
    S.eliminate_zeros()
    indptr = np.empty(n + 1, dtype=np.int32)
    amg_core.rs_classical_interpolation_pass1(n, S.indptr, S.indices, splitting, indptr)
    indices, data = np.empty(indptr[-1], dtype=np.int32), np.empty(indptr[-1])
    both = *arrays_of(A), *arrays_of(S)
    amg_core.rs_classical_interpolation_pass2(
        n, *both, splitting, indptr, indices, data, True
    )
    P = sparse.csr_array((data, indices, indptr), shape=(n, coarse.size))
    P.sort_indices()
    return P, coarse


def strong(A: Any) -> Any:
    """Return the strong couplings of A, with their values, as a csr_array."""
    from pyamg import amg_core

    n, parts = A.shape[0], arrays_of(A)
    indptr, indices, data = (np.empty_like(part) for part in parts)
    amg_core.classical_strength_of_connection_min(
        n, THETA, *parts, indptr, indices, data
    )
    S = sparse.csr_array((data, indices, indptr), shape=(n, n))
    S.data[S.data > 0.0] = 0.0  # the diagonal and positive couplings
    S.eliminate_zeros()
    return S
