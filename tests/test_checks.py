"""The gate: clean arrays pass as they are, everything else is mended or named."""

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import checks
from namlcp.linalg import symmetry
from namlcp.qp import qp_data
from namlcp.qp.problem import QP, dense_faults, sparse_faults


def test_clean_arrays_are_not_copied():
    P, q = np.eye(3), np.ones(3)
    qp = qp_data(P, q, None, None, None, None, None, None)
    assert qp.P is P
    assert qp.q is q
    assert qp.G.shape == (0, 3)
    assert qp.lb.tolist() == [-np.inf] * 3


def test_clean_sparse_matrices_are_not_copied():
    P = sp.csc_array(np.eye(3))
    qp = qp_data(P, np.ones(3), np.ones((1, 3)), [1.0], None, None, None, None)
    assert qp.P is P
    assert qp.G.format == "csc"
    assert qp.A.shape == (0, 3)


@pytest.mark.parametrize("seed", range(20))
def test_sparse_asymmetry_against_the_transpose(seed):
    rng = np.random.default_rng(seed)
    C = sp.random_array((9, 9), density=0.2, rng=rng, format="csr")
    if seed % 2:
        C = sp.csr_array(C + C.T)
    C.sort_indices()
    gap, size = symmetry.sparse_asymmetry(C.indptr, C.indices, C.data)
    assert gap == pytest.approx(abs(C - C.T).max(), abs=0.0)
    assert size == abs(C).max()
    assert symmetry.dense_asymmetry(C.toarray()) == (gap, size)


@pytest.mark.parametrize("name", ["", *"PqGhAb", "lb", "ub"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e25])
def test_faults_of_sparse_data_are_those_of_dense(name, value):
    rng = np.random.default_rng(0)
    dense = {key: rng.standard_normal((2, 3)) for key in "GA"}
    dense |= {key: rng.standard_normal(3) for key in ("q", "lb", "ub")}
    dense |= {key: rng.standard_normal(2) for key in "hb"} | {"P": np.eye(3)}
    dense["P"][0, 1] = 0.5
    if name:
        dense[name].flat[0] = value
    P, q, G, h, A, b, lb, ub = (dense[key] for key in QP._fields)
    bad, gap, size, huge = dense_faults(P, q, G, h, A, b, lb, ub)
    S = sp.csc_array(P)
    finite = sp.csc_array(G).data, sp.csc_array(A).data, q, b
    found = sparse_faults((S.indptr, S.indices, S.data), finite, (h, lb, ub))
    assert found[0] == bad
    assert bad or found == (bad, gap, size, huge)


def test_huge_bounds_become_infinite():
    qp = qp_data(
        np.eye(2), np.ones(2), np.eye(2), [1e20, 3.0], None, None, [-1e30, 0], None
    )
    assert qp.h.tolist() == [np.inf, 3.0]
    assert qp.lb.tolist() == [-np.inf, 0.0]


@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array, sp.coo_array])
def test_corrupt_indices_are_refused(kind):
    C = kind(np.eye(3))
    (C.coords[0] if C.format == "coo" else C.indices)[1] = 7
    with pytest.raises(ValueError, match="indices within its shape"):
        checks.sparse_matrix("A", C, "csr" if C.format == "coo" else C.format)


def test_wide_indices_are_narrowed():
    C = sp.csr_array(np.eye(3))
    C.indices, C.indptr = C.indices.astype(np.int64), C.indptr.astype(np.int64)
    clean = checks.sparse_matrix("A", C, "csr")
    assert clean.indices.dtype == clean.indptr.dtype == np.int32


def test_only_the_open_side_becomes_infinite():
    """x <= -1e21 is a constraint, however far away."""
    qp = qp_data(np.eye(1), [0.0], [[1.0]], [-1e21], None, None, [-1e21], [-1e21])
    assert (qp.h[0], qp.lb[0], qp.ub[0]) == (-1e21, -np.inf, -1e21)


@pytest.mark.parametrize("shape", [(0, 3), (1, 1), (4, 7), (9, 2)])
def test_dense_matrices_become_canonical_sparse_ones(shape):
    rng = np.random.default_rng(3)
    C = rng.standard_normal(shape) * (rng.random(shape) < 0.5)
    sparse, known = checks.as_sparse(C), sp.csc_array(C)
    assert sparse.has_canonical_format
    assert sparse.shape == shape
    for name in ("data", "indices", "indptr"):
        np.testing.assert_array_equal(getattr(sparse, name), getattr(known, name))
    assert sparse.indices.dtype == sparse.indptr.dtype == np.int32


def test_matrices_made_without_checks_are_those_of_scipy():
    """`from_arrays` sets an attribute of SciPy that is not public."""
    for kind in (sp.csc_array, sp.csr_array):
        M = kind(np.array([[1.0, 0.0, 2.0], [0.0, 3.0, 0.0]]))
        M.has_canonical_format = True
        ours = checks.from_arrays((M.indptr, M.indices, M.data), M.shape, kind)
        assert type(ours) is kind
        assert ours.__dict__.keys() == M.__dict__.keys()
        assert (ours.shape, ours.nnz, ours.dtype) == (M.shape, M.nnz, M.dtype)
        np.testing.assert_array_equal((ours.T @ ours).toarray(), (M.T @ M).toarray())
        assert (kind((4, 5)).shape, kind((0, 0)).nnz) == ((4, 5), 0)


@pytest.mark.parametrize("layout", ["csr", "csc"])
@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array, sp.csr_matrix])
@pytest.mark.parametrize("case", ["sorted", "unsorted", "doubled", "longer"])
def test_any_order_of_entries_becomes_canonical(case, kind, layout):
    rng = np.random.default_rng(0)
    C = kind(sp.random_array((8, 5), density=0.4, rng=rng))
    exact = C.toarray()
    if case == "unsorted":
        for j in range(C.indptr.size - 1):
            part = slice(C.indptr[j], C.indptr[j + 1])
            C.indices[part] = C.indices[part][::-1].copy()
            C.data[part] = C.data[part][::-1].copy()
        C.has_sorted_indices = True  # even if it says so
    if case == "doubled":
        C = kind((np.repeat(C.data, 2), np.repeat(C.indices, 2), 2 * C.indptr), C.shape)
        exact *= 2.0
    if case == "longer":
        C.data, C.indices = np.append(C.data, 1.0), np.append(C.indices, C.indices[:1])
    before = C.data.copy(), C.indices.copy()
    clean = checks.sparse_matrix("A", C, layout)
    np.testing.assert_array_equal(clean.toarray(), exact)
    np.testing.assert_array_equal(C.data, before[0])
    np.testing.assert_array_equal(C.indices, before[1])
    major, minor = exact.shape if layout == "csr" else exact.shape[::-1]
    order = checks.index_order(clean.indptr, clean.indices, major, minor)
    assert order == checks.CANONICAL
    assert checks.has_clean_arrays(clean)
    assert clean.format == layout
