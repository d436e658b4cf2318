"""The gate: clean arrays pass as they are, everything else is mended or named."""

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import checks, solve_qp
from namlcp.arrays import dense_asymmetry, sparse_asymmetry
from namlcp.qp.intake import qp_data

INF = np.inf


@pytest.mark.parametrize("kind", [np.asarray, sp.csc_array])
def test_clean_arrays_are_not_copied(kind):
    P, q, none = kind(np.eye(3)), np.ones(3), [None] * 4
    qp = qp_data(P, q, np.ones((1, 3)), [1.0], *none)
    assert (qp.P is P, qp.q is q) == (True, True)
    assert sp.issparse(qp.G) == sp.issparse(P)
    assert qp.A.shape == (0, 3)
    assert (qp.lb == -INF).all()


@pytest.mark.parametrize("seed", range(20))
def test_sparse_asymmetry_against_the_transpose(seed):
    rng = np.random.default_rng(seed)
    C = sp.random_array((9, 9), density=0.2, rng=rng, format="csr")
    if seed % 2:
        C = sp.csr_array(C + C.T)
    C.sort_indices()
    gap, size = sparse_asymmetry(C.indptr, C.indices, C.data)
    assert gap == pytest.approx(abs(C - C.T).max(), abs=0.0)
    assert size == abs(C).max()
    assert dense_asymmetry(C.toarray()) == (gap, size)


def complaint(data):
    """Return what is wrong with the data of a QP, without the place, or its sizes."""
    try:
        return [float(abs(v).max()) for v in qp_data(**data) if v.size]
    except ValueError as error:
        return str(error).split(" at ")[0]


@pytest.mark.parametrize("name", ["", *"PqGhAb", "lb", "ub"])
@pytest.mark.parametrize("value", [np.nan, INF, 1e25])
def test_faults_of_sparse_data_are_those_of_dense(name, value):
    rng = np.random.default_rng(0)
    dense = {key: rng.standard_normal((2, 3)) for key in "GA"}
    dense |= {key: rng.standard_normal(3) for key in ("q", "lb", "ub")}
    dense |= {key: rng.standard_normal(2) for key in "hb"} | {"P": np.eye(3)}
    dense["P"][0, 1] = 0.5  # else most of these would pass
    if name:
        dense[name].flat[0] = value
    sparse = dense | {key: sp.csc_array(dense[key]) for key in "PGA"}
    assert complaint(dense) == complaint(sparse)


def test_only_the_open_side_of_huge_bounds_becomes_infinite():
    """x <= 1e20 is none, x <= -1e21 is a constraint, however far away."""
    G, one, two = np.eye(1), np.ones(1), np.eye(2)
    qp = qp_data(two, np.ones(2), two, [1e20, 3.0], None, None, [-1e30, 0], None)
    assert qp.h.tolist() == [INF, 3.0]
    assert qp.lb.tolist() == [-INF, 0.0]
    qp = qp_data(G, one, G, -1e21 * one, None, None, -1e21 * one, -1e21 * one)
    assert (qp.h[0], qp.lb[0], qp.ub[0]) == (-1e21, -INF, -1e21)


@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array, sp.coo_array])
def test_corrupt_indices_are_refused(kind):
    C = kind(np.eye(3))
    (C.coords[0] if C.format == "coo" else C.indices)[1] = 7
    with pytest.raises(ValueError, match="P must have indices within its shape"):
        solve_qp(C, np.ones(3))


@pytest.mark.parametrize("layout", ["csr", "csc"])
@pytest.mark.parametrize("kind", [sp.csr_array, sp.csc_array, sp.csr_matrix])
@pytest.mark.parametrize("case", ["sorted", "unsorted", "doubled", "longer", "wide"])
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
    if case == "wide":
        C.indices, C.indptr = C.indices.astype(np.int64), C.indptr.astype(np.int64)
    before = C.data.copy(), C.indices.copy()
    clean = checks.sparse_matrix("A", C, layout)
    np.testing.assert_array_equal(clean.toarray(), exact)
    assert clean.nnz == np.count_nonzero(exact)
    np.testing.assert_array_equal(C.data, before[0])
    np.testing.assert_array_equal(C.indices, before[1])
    major, minor = exact.shape if layout == "csr" else exact.shape[::-1]
    order = checks.index_order(clean.indptr, clean.indices, major, minor)
    assert order == checks.Order.CANONICAL
    assert clean.data.dtype == float
    assert clean.data.flags.carray
    assert clean.indices.dtype == clean.indptr.dtype == np.int32
    assert clean.format == layout
