"""The scenes of the validation at small sizes, against the values in their docstrings.

Solved by method="auto"; a value that only an independent solver gives comes from one.
"""

import numpy as np
import problems_lcp
import pytest

from namlcp import Status, natural_residual, solve_lcp
from validation.oracles.scenes import scenes
from validation.problems import hertz
from validation.problems import known_scenes as known
from validation.problems.general.families import game_lcp

SCENES = scenes(problems_lcp.DATA)


def solve(scene):
    result = solve_lcp(*scene)
    assert result.status is Status.SOLVED
    return result.z


@pytest.mark.parametrize("name", [name for name, s in SCENES.items() if s.known])
def test_known_values(name):
    lcp = SCENES[name].make()
    z = solve(lcp)
    for entry in SCENES[name].known:
        assert abs(entry.of(lcp, z) - entry.value) <= entry.absolute, entry.quantity


def test_dam():
    z = solve(known.dam()).reshape(3, 5)[:, ::-1].T
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


GAMES = {
    "prisoner's dilemma": ([[3, 0], [5, 1]], [[3, 5], [0, 1]], (0, 1, 0, 1)),
    "matching pennies": ([[1, -1], [-1, 1]], [[-1, 1], [1, -1]], (0.5,) * 4),
    "rock, paper, scissors": (
        [[0, -1, 1], [1, 0, -1], [-1, 1, 0]],
        [[0, 1, -1], [-1, 0, 1], [1, -1, 0]],
        (1 / 3,) * 6,
    ),
}
"""Payoffs of both players, and the only equilibrium."""


@pytest.mark.parametrize("name", GAMES)
def test_known_games(name):
    R, C, expected = GAMES[name]
    z = solve(game_lcp(R, C)).reshape(2, -1)
    found = z / z.sum(axis=1)[:, None]
    np.testing.assert_allclose(found.ravel(), expected, atol=1e-9)


@pytest.mark.parametrize("name", known.FAMILIES)
def test_family(name):
    scene = known.FAMILIES[name](400)
    A = scene.A
    again = known.FAMILIES[name](400)
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
    scene, z = known.biactive(40)
    w = scene.A @ z + scene.q
    assert 0.45 < ((np.abs(z) <= 1e-14) & (np.abs(w) <= 1e-14)).mean() < 0.55
    np.testing.assert_allclose(solve(scene), z, atol=1e-12)
