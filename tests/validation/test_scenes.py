"""The scenes of the validation at small sizes, against the values in their docstrings.

Solved by method="auto"; a value that only an independent solver gives comes from one.
"""

import numpy as np
import problems_lcp
import pytest
from scipy.optimize import lsq_linear, nnls

from namlcp import Status, natural_residual, solve_lcp
from validation.harness.data_folder import MissingDataError
from validation.problems import hertz
from validation.problems import known_scenes as known
from validation.problems import large_scenes as large
from validation.problems.data_sets import heart_scale
from validation.problems.general import games


def solve(scene):
    result = solve_lcp(*scene)
    assert result.status is Status.SOLVED
    return result.z


def objective(scene, z):
    return 0.5 * z @ (scene.A @ z) + scene.q @ z


# ---- published values


@pytest.mark.parametrize(
    ("name", "arguments", "value", "held"),
    [
        ("torsion", (50, 50), -0.4180876320, 752),
        ("torsion", (50, 100), -0.4182392134, None),
        ("journal_bearing", (8, 12, 0.1), -0.1834372196, None),
        ("journal_bearing", (50, 50, 0.1), -0.1804879950, None),
        ("journal_bearing", (50, 50, 0.99), -60.1509273215, None),
        ("svm_rbf", (1.0 / 13.0,), -101.1335996299, 141 + 107),
        ("svm_l2", (), -121.13472444, None),
    ],
)
def test_objectives(name, arguments, value, held):
    if name.startswith("svm"):
        try:
            arguments = *heart_scale(problems_lcp.DATA), *arguments
        except MissingDataError as error:
            pytest.skip(str(error))
    scene = getattr(known, name)(*arguments)
    z = solve(scene)
    digits = 5e-9 if name == "svm_l2" else 5e-11
    assert objective(scene, z) == pytest.approx(value, abs=digits)
    assert held in (None, np.sum((z <= scene.lower) | (z >= scene.upper)))


@pytest.mark.parametrize(
    ("m", "average", "worst"),
    [(17, 2.707e-3, 1.428e-2), (33, 8.182e-4, 5.747e-3), (129, 3.334e-5, 2.154e-4)],
)
def test_ball_obstacle(m, average, worst):
    z = solve(known.ball_obstacle(m)).reshape(m - 2, m - 2)
    error = np.abs(z - known.ball_solution(m)[1:-1, 1:-1])
    assert error.sum() / m**2 == pytest.approx(average, rel=2e-4)
    assert error.max() == pytest.approx(worst, rel=4e-4)


def test_dam():
    z = solve(known.dam()).reshape(3, 5)[:, ::-1].T
    table = [
        [2.53716015237691, 0.0, 0.0],
        [18.148640609503, 6.78414305345868, 0.0],
        [47.2732592321996, 24.9879316043211, 7.91201621181146],
    ]
    np.testing.assert_allclose(z[:3], table, rtol=0, atol=1.5e-11)
    exact = [7.912016211797040, 22.66013324288125, 44.74620883995199]
    np.testing.assert_allclose(z[2:, 2], exact, rtol=1e-14)
    finer = solve(known.dam(4)).reshape(15, 23)
    assert np.abs(finer[3::4, 3::4] - z[::-1].T).max() < 0.01 * z.max()


def test_american_put():
    m, steps = 401, 400
    scene = known.american_put(m, steps)
    z = scene.lower
    for _ in range(steps):
        z = solve(scene._replace(q=scene.q + scene.lower - z))
    assert z[m // 2] == pytest.approx(9.5694453, abs=0.01)  # first order in time


def test_input_bounded_mpc():
    z = solve(known.input_bounded_mpc())
    total, x = 0.0, np.array([10.0, 0.0])
    for u in z:
        total += x @ ([1.0, 0.1] * x) + 0.01 * u * u
        x = np.array([[1.0, 0.1], [0.0, 1.0]]) @ x + [0.005 * u, 0.1 * u]
    total += x @ ([1.0, 0.1] * x)
    assert total == pytest.approx(2490.05936849, abs=5e-9)
    assert np.sum(np.abs(z) > 1.0 - 1e-12) == 69


def test_hertz_contact_without_a_matrix():
    """By the FFT: against Hertz' formulas, and the same problem with its matrix."""
    problem = hertz.hertz(64)
    found = solve_lcp(problem.A, problem.q, diagonal=problem.diagonal)
    assert found.status is Status.SOLVED
    assert found.iterations < 60
    errors = hertz.measured(problem, found.z)
    assert abs(errors["radius_error"]) < 5e-3
    assert abs(errors["force_error"]) < 5e-4
    assert abs(errors["pressure_error"]) < 1e-3
    problem = hertz.hertz(16)
    K = problem.A @ np.eye(256)
    np.testing.assert_allclose(K, K.T, atol=1e-15)
    np.testing.assert_allclose(K.diagonal(), problem.diagonal)
    exact = solve_lcp(K, problem.q)
    found = solve_lcp(problem.A, problem.q, diagonal=problem.diagonal, eps_rel=1e-12)
    np.testing.assert_allclose(found.z, exact.z, atol=1e-10 * exact.z.max())
    np.testing.assert_array_equal(found.z > 0.0, exact.z > 0.0)


@pytest.mark.parametrize("name", games.KNOWN)
def test_known_games(name):
    R, C, expected = games.KNOWN[name]
    x, y = games.strategies(solve(games.lcp(R, C)), len(R))
    np.testing.assert_allclose(np.concatenate((x, y)), expected, atol=1e-9)
    assert games.regret(R, C, x, y) < 1e-9


# ---- independent solvers, optimality by its own definition


def test_svm_without_data(tmp_path):
    X, y = known.svm_data(tmp_path, 60)
    scene = known.svm_l2(X, y)
    root = np.linalg.cholesky(scene.A)
    oracle = nnls(root.T, np.linalg.solve(root, -scene.q))[0]
    np.testing.assert_allclose(solve(scene), oracle, atol=1e-10)
    scene = known.svm_rbf(X, y, 0.2)
    root = np.linalg.cholesky(scene.A + 1e-14 * np.eye(60))
    oracle = lsq_linear(root.T, np.linalg.solve(root, -scene.q), (0.0, 1.0), tol=1e-14)
    expected = objective(scene, oracle.x)
    assert objective(scene, solve(scene)) == pytest.approx(expected, rel=1e-9)


# ---- families


@pytest.mark.parametrize("name", large.FAMILIES)
def test_family(name):
    scene = large.FAMILIES[name](400)
    A = scene.A
    again = large.FAMILIES[name](400)
    assert (A != again.A).nnz == 0
    for one, other in zip(scene[1:], again[1:], strict=True):
        np.testing.assert_array_equal(one, other)
    symmetric = "transport" not in name and "convection" not in name
    gap = abs(A - A.T).max()
    assert gap <= 1e-13 * abs(A).max() if symmetric else gap > 0.1
    z = solve(scene)
    assert natural_residual(z, A @ z + scene.q, scene.lower, scene.upper) < 1e-11
    active = np.mean((z <= scene.lower) | (z >= scene.upper))
    assert 0.02 < active < 0.8


def test_biactive_knows_its_solution():
    scene, z = large.biactive(40)
    w = scene.A @ z + scene.q
    assert 0.45 < ((np.abs(z) <= 1e-14) & (np.abs(w) <= 1e-14)).mean() < 0.55
    np.testing.assert_allclose(solve(scene), z, atol=1e-12)
