"""Factors with friction cones eliminated, beside dense algebra."""

import numpy as np
import pytest
from scipy import sparse

from namlcp import solve_lcp
from namlcp.lcp.distances import Distances
from namlcp.lcp.general.arc import PROMISED_STEPS, STEPS, Arc
from namlcp.lcp.general.cones import Condensed, system_of
from namlcp.lcp.general.cones.condensed import principal
from namlcp.lcp.general.cones.contacts import cones_of
from namlcp.lcp.scaling import unit_diagonal_scale
from namlcp.lcp.shifted import Shifted
from validation.problems.general.families import FAMILIES

SCENES = ("pile", "wall", "chain", "balls", "cubes")


def scaled(family, n=120, seed=0):
    A, q = FAMILIES[family](n, seed)
    free = np.full(q.size, np.inf)
    return Distances(A, q, np.zeros(q.size), free, unit_diagonal_scale)


@pytest.mark.parametrize("family", SCENES)
@pytest.mark.parametrize("digits", [0, 3, 6])
def test_solutions_are_those_of_dense_algebra(family, digits):
    M, rng = scaled(family).M, np.random.default_rng(digits)
    n = M.shape[0]
    system = system_of(M)
    assert isinstance(system, Condensed)
    for _ in range(3):  # the first factors choose an order, later ones keep it
        D = 10.0 ** rng.uniform(-digits, digits, n)
        K = M.toarray() + np.diag(D)
        r = rng.standard_normal((n, 2))
        factors = system.factors(D)
        x = np.linalg.solve(K, r)
        close = 1e-15 * np.linalg.cond(K) * np.abs(x).max()
        assert np.allclose(factors.solve(r), x, rtol=0.0, atol=close)
        assert np.array_equal(factors.solve(r[:, 0]), factors.solve(r)[:, 0])
        assert factors.positive == (np.linalg.slogdet(K)[0] > 0.0)
        assert 0 < factors.entries < n * n


def test_the_sign_of_the_determinant_is_found_on_both_sides():
    # mu = 5, so that sliding makes it negative for some D
    A, _ = FAMILIES["pile"](120, 2)
    k = A.shape[0] // 4
    A = sparse.diags_array(np.repeat([1.0, 1.0, 1.0, 5.0], k)) @ A
    A[3 * k :, k : 3 * k] /= 5.0
    system, rng, signs = system_of(sparse.csc_array(A)), np.random.default_rng(0), set()
    assert isinstance(system, Condensed)
    for _ in range(60):
        D = 10.0 ** rng.choice([-6.0, 6.0], A.shape[0])
        sign = np.linalg.slogdet(A.toarray() + np.diag(D))[0]
        assert system.factors(D).positive == (sign > 0.0)
        signs.add(sign)
    assert signs == {-1.0, 1.0}


@pytest.mark.parametrize("family", ["balls", "cubes"])
@pytest.mark.parametrize("seed", range(6))
def test_small_and_large_entries_of_the_diagonal_lose_no_digits(family, seed):
    # sticking and sliding directions of one contact: d_j from 1e-10 to 1e10
    M, rng = scaled(family, 300).M, np.random.default_rng(seed)
    D = 10.0 ** rng.choice([-10.0, 10.0], M.shape[0])
    K = M + sparse.diags_array(D)
    r = np.sqrt(D) * rng.standard_normal(D.size)
    x = system_of(M).factors(D).solve(r)
    assert np.abs(K @ x - r).max() <= 1e-14 * (abs(K) @ np.abs(x)).max()


@pytest.mark.parametrize("p", [1, 2])
def test_axes_are_principal_however_different_the_weights_are(p):
    rng = np.random.default_rng(p)
    w, a = 10.0 ** rng.uniform(-10.0, 10.0, (100, 9)), rng.standard_normal((100, 9, p))
    values, axes, turned = principal(w, a)
    total = np.einsum("kj,kjp,kjq->kpq", w, a, a)
    found = axes @ (values[:, :, None] * axes.transpose(0, 2, 1))
    size = np.abs(total).max(axis=(1, 2), keepdims=True)
    assert np.abs((found - total) / size).max() <= 1e-14
    assert np.abs(a @ axes - turned).max() <= 1e-14
    root = np.sqrt(values[:, :, None] * values[:, None])
    own = np.einsum("kj,kjp,kjq->kpq", w, turned, turned) / root
    assert np.abs(own - np.eye(p)).max() <= 1e-14


@pytest.mark.parametrize("value", [0.0, np.inf, np.nan, 1e-320])
@pytest.mark.parametrize("family", ["pile", "balls"])
def test_a_path_that_has_diverged_has_no_factors(family, value):
    M = scaled(family).M
    D = np.ones(M.shape[0])
    D[-1] = value
    D[M.shape[0] // 2] = value
    assert system_of(M).factors(D) is None


def test_contacts_are_found_with_their_directions():
    cones = cones_of(scaled("cubes").M)
    assert cones.b.shape[1] == 8
    assert cones.c.shape[2] == 2
    A, _ = FAMILIES["pile"](120, 0)
    cones, k = cones_of(A), A.shape[0] // 4
    assert np.array_equal(cones.normal, np.arange(k))
    assert np.array_equal(cones.b, k + np.arange(2 * k).reshape(2, k).T)
    assert np.array_equal(cones.g, 3 * k + np.arange(k))
    assert np.allclose(cones.kappa, 0.2)
    assert np.allclose(cones.c, [[[1.0], [-1.0]]])


def changed(A, i, j, value):
    A = sparse.lil_array(A)
    A[i, j] = value
    return sparse.csc_array(A)


def without_inertia(A, k):
    D = sparse.diags_array(np.repeat([1.0, 0.0, 1.0], [k, 2 * k, k]))
    return sparse.csc_array(D @ A @ D)


def test_other_matrices_are_left_alone():
    A, _ = FAMILIES["pile"](120, 0)
    k = A.shape[0] // 4
    others = {
        "no speeds": sparse.eye_array(5, format="csc"),
        "one direction": sparse.csc_array(np.array([[1.0, 1.0], [-1.0, 0.0]])),
        "a direction turned": changed(A, k, 0, A[k, 0] + 0.1),
        "speed and another impulse": changed(A, 3 * k, 1, 0.5),
        "a third direction": changed(A, k + 1, 3 * k, 1.0),
        "a weight lost": changed(A, 3 * k, k, -0.5),
        "directions pull": changed(changed(A, k, 3 * k, -1.0), 3 * k, k, 1.0),
        "directions without inertia": without_inertia(A, k),
    }
    for name, M in others.items():
        assert cones_of(M) is None, name
        assert isinstance(system_of(M), Shifted), name
    assert isinstance(system_of(A.toarray()), Shifted)


def test_the_curve_may_be_long_where_it_leads_to_a_solution():
    model = scaled("pile")
    cones, plain = (
        Arc(model, system, 1.0, 1.0)
        for system in (system_of(model.M), Shifted(model.M))
    )
    assert (cones.steps, plain.steps) == (PROMISED_STEPS, STEPS)


@pytest.mark.parametrize(("family", "seed"), [("pile", 2), ("balls", 5)])
def test_piles_are_solved(family, seed):
    A, q = FAMILIES[family](600, seed)
    result = solve_lcp(A, q)
    w = A @ result.z + q
    assert result.status.value == "solved"
    assert np.linalg.norm(np.minimum(result.z, w)) <= 1e-9 * np.abs(q).max()
