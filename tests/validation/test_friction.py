"""Scenes with friction: Coulomb's law by its definition, known answers, steps."""

import numpy as np
import pytest

from examples.falling import FallingDiscs
from namlcp import Status, solve_lcp
from namlcp.scenes.friction import Bodies, friction_lcp
from validation.problems import contact_scenes as piles

SCENES = {
    "pile": piles.pile_of_discs(4, 0.5),
    "wall": piles.wall_of_bricks(3, 0.2, ratio=1e4),
    "chain": piles.pressed_chain(6, 0.9),
    "balls": piles.pile_of_balls(2, 0.5),
    "balls, 8 directions": piles.pile_of_balls(2, 0.5, 8),
    "cubes": piles.column_of_cubes(3, 0.5),
}


def sliding_of(scene, z):
    """Return the velocities (m, 3) of the contacts, without those along normals."""
    contacts, centre = scene.contacts, scene.bodies.centre
    found, velocity = np.zeros((contacts.mu.size, 3)), scene.velocity(z)
    for body, sign in ((contacts.first, -1.0), (contacts.second, 1.0)):
        moving = body >= 0
        k = body[moving]
        turn = np.cross(velocity[k, 3:], contacts.point[moving] - centre[k])
        found[moving] += sign * (velocity[k, :3] + turn)
    n = contacts.normal
    return found - (found * n).sum(axis=1)[:, None] * n


@pytest.mark.parametrize("name", SCENES)
def test_impulses_and_motion_obey_the_law(name):
    """|friction| <= mu l; where it slides, the friction is along -(velocity)."""
    scene = SCENES[name]
    contacts, m = scene.contacts, scene.contacts.mu.size
    A, q = friction_lcp(scene)
    result = solve_lcp(A, q, method="lemke")
    assert result.status is Status.SOLVED
    normal, friction = scene.impulses(result.z)
    sliding = sliding_of(scene, result.z)
    assert (np.linalg.norm(friction, axis=1) <= contacts.mu * normal + 1e-12).all()
    along_normal = np.abs((friction * contacts.normal).sum(axis=1))
    assert (along_normal <= 1e-12 * normal.max()).all()
    power = (friction * sliding).sum(axis=1)
    assert (power <= 1e-12).all()
    # The most that the polyhedron of directions can dissipate.
    along = np.einsum("dmi,mi->dm", scene.tangents(), sliding).max(axis=0)
    np.testing.assert_allclose(-power, contacts.mu * normal * along, atol=1e-12)
    # bodies do not approach
    J = scene.jacobian()
    velocity = scene.velocity(result.z)[:, scene.freedom].ravel()
    assert (J[:m] @ velocity >= -1e-8 * piles.STEP).all()
    # copositive: z'A z = |J'(l, b)|^2 in W = 1 / M, plus mu l'g
    z, rows = np.random.default_rng(0).exponential(size=q.size), J.shape[0]
    push = J.T @ z[:rows]
    expected = push @ (scene.inverse_mass() * push)
    expected += contacts.mu * z[:m] @ z[rows:]
    assert z @ (A @ z) == pytest.approx(expected)


@pytest.mark.parametrize("angle", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5, 0.8])
def test_block_on_a_slope(angle, mu):
    """It sticks where tan(angle) <= mu, else it slides; a brick 2 x 1, two corners."""
    pull = piles.STEP * np.array([[np.sin(angle), -np.cos(angle), 0.0, 0.0, 0.0, 0.0]])
    bodies = Bodies(np.array([[0.0, 0.5, 0.0]]), np.ones(1), np.ones((1, 3)), pull)
    corners = [(-1, 0, (x, 0.0, 0.0), -piles.BELOW) for x in (-1.0, 1.0)]
    scene = piles.scene_of(bodies, zip(*corners, strict=True), mu)
    A, q = friction_lcp(scene)
    z = solve_lcp(A, q).z
    expected = np.zeros(6)
    expected[0] = piles.STEP * max(0.0, np.sin(angle) - mu * np.cos(angle))
    np.testing.assert_allclose(scene.velocity(z)[0], expected, atol=1e-14)
    assert z[:2].sum() == pytest.approx(piles.STEP * np.cos(angle))


def test_discs_lose_energy_and_do_not_overlap():
    discs = FallingDiscs(6)
    energy = discs.energy()
    for _ in range(80):
        record = discs.step()
        assert record.status is Status.SOLVED
        assert record.residual < 1e-9
        assert record.energy <= energy + 1e-9
        assert record.overlap < 1e-9
        energy = record.energy
    assert (discs.centre[:, 1] >= discs.radius - 1e-9).all()


def test_a_warm_start_changes_no_velocity():
    """Impulses may not be unique where more hold a disc than needed; motion is."""
    warm, cold = FallingDiscs(4), FallingDiscs(4, warm=False)
    for _ in range(60):
        warm.step()
        cold.step()
    np.testing.assert_allclose(warm.centre, cold.centre, atol=1e-6)
