"""Gradients of batches: those of the items, stacked or added."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

import namlcp

ITEMS = 5


def batch_data(seed=0, n=4, m=3):
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((ITEMS, 2 * n, n))
    P = B.transpose(0, 2, 1) @ B
    q, h = 5.0 * rng.standard_normal((ITEMS, n)), rng.random((ITEMS, m))
    q[2, 0] = np.nan
    return P, q, rng.standard_normal((m, n)), h, -np.ones(n)


@pytest.mark.parametrize("threads", [1, 3])
def test_gradients_are_those_of_the_items(threads):
    P, q, G, h, lb = batch_data()
    batch = namlcp.solve_batch(P, q, G, h, lb=lb)
    dx, dz = np.ones_like(batch.x), np.ones_like(batch.z)
    found = batch.backward(dx=dx, dz=dz, threads=threads)
    assert found.used.tolist() == [True, True, False, True, True]
    assert not found.weak.any()
    assert not found.singular.any()
    total = {"G": 0.0, "lb": 0.0}
    for i in range(ITEMS):
        if not found.used[i]:
            assert not found.P[i].any()
            assert not found.q[i].any()
            continue
        alone = namlcp.solve_qp(P[i], q[i], G, h[i], lb=lb)
        own = alone.backward(dx=dx[i], dz=dz[i])
        for name in ("P", "q", "h"):
            assert np.allclose(getattr(found, name)[i], getattr(own, name), atol=1e-12)
        total = {name: part + getattr(own, name) for name, part in total.items()}
    assert np.allclose(found.G, total["G"], atol=1e-12)
    assert np.allclose(found.lb, total["lb"], atol=1e-12)
    assert (found.A.shape, found.b.shape) == ((0, 4), (0,))


def test_a_shared_sparse_matrix_keeps_its_pattern():
    _, q, _, h, lb = batch_data()
    G = sp.csr_array(np.eye(3, 4))
    batch = namlcp.solve_batch(sp.eye_array(4, format="csc"), q, G, h, lb=lb)
    found = batch.backward(dx=np.ones_like(batch.x))
    assert (found.G.format, found.G.nnz, found.P.nnz) == ("csr", 3, 4)


def test_errors_name_what_is_wrong():
    P, q, G, h, lb = batch_data()
    batch = namlcp.solve_batch(P, q, G, h, lb=lb)
    with pytest.raises(ValueError, match=r"dx must have shape \(5, 4\) to match x"):
        batch.backward(dx=np.ones(4))
    with pytest.raises(ValueError, match="a pickled or copied one has lost"):
        pickle.loads(pickle.dumps(batch)).backward(dx=np.ones((5, 4)))
