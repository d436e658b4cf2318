"""Scenes with friction: Coulomb's law by its definition, known answers, steps."""

from dataclasses import dataclass

import numpy as np
import pytest

from namlcp import Status, solve_lcp
from namlcp.scenes import stepping
from namlcp.scenes.friction import Scene, friction_lcp
from namlcp.scenes.stepping import FallingDiscs
from validation.problems.general import piles

SCENES = {
    "pile": piles.pile_of_discs(4, 0.5),
    "wall": piles.wall_of_bricks(3, 0.2, ratio=1e4),
    "chain": piles.pressed_chain(6, 0.9),
    "balls": piles.pile_of_balls(2, 0.5),
    "balls, 8 directions": piles.pile_of_balls(2, 0.5, 8),
    "cubes": piles.column_of_cubes(3, 0.5),
}


@dataclass
class Solved:
    """A scene and its solution."""

    scene: Scene
    z: np.ndarray

    def sliding(self) -> np.ndarray:
        """Return the velocities (m, 3) of the contacts, without those along normals."""
        found = np.zeros((self.scene.contacts.mu.size, 3))
        velocity = self.scene.velocity(self.z)
        contacts, centre = self.scene.contacts, self.scene.bodies.centre
        for body, sign in ((contacts.first, -1.0), (contacts.second, 1.0)):
            moving = body >= 0
            k = body[moving]
            arm = contacts.point[moving] - centre[k]
            turn = np.cross(velocity[k, 3:], arm)
            found[moving] += sign * (velocity[k, :3] + turn)
        n = contacts.normal
        return found - (found * n).sum(axis=1)[:, None] * n


@pytest.fixture(params=SCENES)
def solved(request):
    scene = SCENES[request.param]
    result = solve_lcp(*friction_lcp(scene), method="lemke")
    assert result.status is Status.SOLVED
    return Solved(scene, result.z)


def test_friction_is_in_its_cone_and_opposes_sliding(solved):
    """|friction| <= mu l; where it slides, the friction is along -(velocity)."""
    scene, contacts = solved.scene, solved.scene.contacts
    normal, friction = scene.impulses(solved.z)
    sliding = solved.sliding()
    size = normal.max()
    assert (np.linalg.norm(friction, axis=1) <= contacts.mu * normal + 1e-12).all()
    assert (np.abs((friction * contacts.normal).sum(axis=1)) <= 1e-12 * size).all()
    power = (friction * sliding).sum(axis=1)
    assert (power <= 1e-12).all()
    # The most that the polyhedron of directions can dissipate.
    along = np.einsum("dmi,mi->dm", scene.tangents(), sliding).max(axis=0)
    np.testing.assert_allclose(-power, contacts.mu * normal * along, atol=1e-12)


def test_bodies_do_not_approach(solved):
    scene = solved.scene
    J = scene.jacobian()[: scene.contacts.mu.size]
    velocity = scene.velocity(solved.z)[:, scene.freedom].ravel()
    assert (J @ velocity >= -1e-8 * piles.STEP).all()


def test_matrix_is_copositive(solved):
    """z'A z = |J'(l, b)|^2 in W = 1 / M, plus mu l'g."""
    scene = solved.scene
    A, q = friction_lcp(scene)
    J = scene.jacobian()
    z = np.random.default_rng(0).exponential(size=q.size)
    m, rows = scene.contacts.mu.size, J.shape[0]
    push = J.T @ z[:rows]
    expected = push @ (scene.inverse_mass() * push)
    expected += scene.contacts.mu * z[:m] @ z[rows:]
    assert z @ (A @ z) == pytest.approx(expected)


@pytest.mark.parametrize("angle", [0.1, 0.3, 0.6])
@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5, 0.8])
def test_block_on_a_slope(angle, mu):
    """It sticks where tan(angle) <= mu, else it slides by the formula."""
    scene = piles.block_on_slope(angle, mu)
    A, q = friction_lcp(scene)
    z = solve_lcp(A, q).z
    expected = np.zeros(6)
    expected[0] = piles.STEP * piles.acceleration(angle, mu)
    np.testing.assert_allclose(scene.velocity(z)[0], expected, atol=1e-14)
    assert z[:2].sum() == pytest.approx(piles.STEP * np.cos(angle))
    assert q.size == (8 if mu else 2)


@pytest.mark.parametrize("directions", [4, 8])
def test_directions_go_evenly_round(directions):
    scene = piles.pile_of_balls(2, 0.5, directions)
    d = scene.tangents()
    np.testing.assert_allclose(np.linalg.norm(d, axis=2), 1.0)
    assert np.abs(np.einsum("dmi,mi->dm", d, scene.contacts.normal)).max() < 1e-15
    np.testing.assert_allclose(d.sum(axis=0), 0.0, atol=1e-14)
    turn = np.cos(2.0 * np.pi / directions)
    np.testing.assert_allclose(
        (d * np.roll(d, 1, axis=0)).sum(axis=2), turn, atol=1e-15
    )


def test_smooth_contacts_are_a_symmetric_box_lcp():
    A, q = friction_lcp(piles.pile_of_discs(3, 0.0))
    assert q.size == piles.pile_of_discs(3, 0.0).contacts.mu.size
    assert abs(A - A.T).max() < 1e-15


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


def test_a_lone_disc_falls_freely():
    discs = FallingDiscs(1)
    discs.centre[0, :2] = discs.width / 2.0, 100.0
    discs.velocity[:] = 0.0
    for _ in range(10):
        assert discs.step().n == 0
    assert discs.velocity[0, 1] == pytest.approx(-10 * stepping.GRAVITY * stepping.STEP)
