"""The derivative of the closest point against differences."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

import namlcp
from namlcp import Relaxation
from validation.derivatives.cases import contradictory

NAMES = "P", "q", "G", "h", "A", "b", "lb", "ub"
SOFT = Relaxation(h=2.0, lb=1.0, ub=3.0)


def closest(data, choice):
    result = namlcp.solve_qp(**data, infeasible=choice, eps_abs=1e-12, eps_rel=1e-13)
    return result.closest


def assert_is_gradient(data, choice, seed):
    rng = np.random.default_rng(seed)
    found = closest(data, choice)
    parts = found.x, found.shift_h, found.shift_b
    weights = [rng.standard_normal(v.size) for v in parts]
    gradients = found.backward(*weights)

    def scalar(name, change):
        moved = closest({**data, name: data[name] + change}, choice)
        parts = moved.x, moved.shift_h, moved.shift_b
        return sum(w @ v for w, v in zip(weights, parts, strict=True))

    for name in data:
        if name in "GA" and gradients.singular:
            continue  # point and shifts jump if the rank of the held rows rises
        change = rng.standard_normal(data[name].shape)
        if name == "P":
            change = change + change.T
        difference = scalar(name, 1e-5 * change) - scalar(name, -1e-5 * change)
        expected = (getattr(gradients, name) * change).sum()
        assert difference / 2e-5 == pytest.approx(expected, rel=1e-5, abs=1e-5), name
    return gradients


@pytest.mark.parametrize("seed", range(4))
def test_the_held_rows_determine_the_point(seed):
    gradients = assert_is_gradient(contradictory(seed, 3, 14, 1), "closest", seed)
    assert not gradients.singular


@pytest.mark.parametrize("seed", range(4))
def test_the_cost_determines_the_point(seed):
    gradients = assert_is_gradient(contradictory(seed, 9, 5), "closest", seed)
    assert gradients.singular


@pytest.mark.parametrize("choice", ["closest", SOFT], ids=["hard", "soft"])
@pytest.mark.parametrize("seed", range(3))
def test_with_bounds(seed, choice):
    assert_is_gradient(contradictory(seed, 6, 9, bounds=True), choice, seed)


def test_gradients_of_sparse_matrices_are_on_their_entries():
    dense = contradictory(0, 5, 14)
    dense["G"][dense["G"] < -1.0] = 0.0
    dense["h"][1] = -dense["h"][0] - 9.0
    sparse = dense | {k: sp.csc_array(dense[k]) for k in "PGA"}
    sparse["G"] = sp.csr_array(sparse["G"])
    full, found = (closest(d, "closest").backward(np.ones(5)) for d in (dense, sparse))
    assert found.G.format == "csr"
    assert found.G.nnz == sparse["G"].nnz
    at = dense["G"] != 0.0
    np.testing.assert_allclose(found.G.toarray()[at], full.G[at], atol=1e-9)
    for name in "P", "A":
        one, other = getattr(found, name).toarray(), getattr(full, name)
        np.testing.assert_allclose(one, other, atol=1e-9)


def test_what_has_no_derivative_says_so():
    data = contradictory(0, 5, 14)
    with pytest.raises(ValueError, match="need shifts of norm 2, got those of norm 1"):
        closest(data, "elastic").backward(np.ones(5))
    with pytest.raises(ValueError, match="has lost the problem"):
        pickle.loads(pickle.dumps(closest(data, "closest"))).backward(np.ones(5))
    with pytest.raises(ValueError, match=r"dshift_h must have shape \(14,\)"):
        closest(data, "closest").backward(None, np.ones(3))
    hard = Relaxation(h=np.inf, b=np.inf)
    with pytest.raises(ValueError, match="status solved, got primal_infeasible"):
        closest(data, hard).backward(np.ones(5))
