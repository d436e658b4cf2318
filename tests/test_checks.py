"""The gate: clean arrays pass as they are, everything else is mended or named."""

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import checks, solve_lcp
from namlcp.linalg import symmetry
from namlcp.qp import qp_data


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


def test_huge_bounds_become_infinite():
    qp = qp_data(
        np.eye(2), np.ones(2), np.eye(2), [1e20, 3.0], None, None, [-1e30, 0], None
    )
    assert qp.h.tolist() == [np.inf, 3.0]
    assert qp.lb.tolist() == [-np.inf, 0.0]


@pytest.mark.parametrize("layout", ["csr", "csc"])
def test_corrupt_indices_are_refused(layout):
    kind = sp.csr_array if layout == "csr" else sp.csc_array
    C = kind(np.eye(3))
    C.indices[1] = 7
    with pytest.raises(ValueError, match="indices within its shape"):
        checks.sparse_matrix("A", C, layout)


def test_wide_indices_are_narrowed():
    C = sp.csr_array(np.eye(3))
    C.indices, C.indptr = C.indices.astype(np.int64), C.indptr.astype(np.int64)
    clean = checks.sparse_matrix("A", C, "csr")
    assert clean.indices.dtype == clean.indptr.dtype == np.int32


@pytest.mark.parametrize(
    ("arguments", "error", "text"),
    [
        ((np.ones((2, 3)), np.ones(3), None, None), ValueError, "A must be square"),
        ((np.eye(2), np.ones(3), None, None), ValueError, r"q must have shape \(2,\)"),
        ((np.eye(2), [1, np.inf], None, None), ValueError, r"q must be finite.*\(1\)"),
        ((np.diag([1, np.nan]), [1, 1], None, None), ValueError, r"A must be .*\(1, 1"),
        ((np.eye(2), ["a", "b"], None, None), TypeError, "q must be an array of real"),
        (
            (np.eye(2), [1, 1], [2, 0], 1.0),
            ValueError,
            r"lower\[0\] = 2, upper\[0\] = 1",
        ),
        ((np.eye(2), [1, 1], np.inf, None), ValueError, "lower be < inf"),
        ((np.eye(2), [1, 1], np.nan, None), ValueError, "lower must not hold NaN"),
        (
            (np.eye(2), [[1], [1, 2]], None, None),
            TypeError,
            "q must be an array of real",
        ),
    ],
)
def test_lcp_arguments_are_named(arguments, error, text):
    with pytest.raises(error, match=text):
        solve_lcp(*arguments)


def test_corrupt_coordinates_are_refused():
    C = sp.coo_matrix(np.eye(3))
    C.coords[0][0] = 9000
    with pytest.raises(ValueError, match="indices within its shape"):
        checks.sparse_matrix("A", C, "csr")


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
