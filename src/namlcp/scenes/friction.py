"""Rigid bodies in contact with Coulomb friction: one time step as an LCP.

Stewart and Trinkle's time step, with the velocities of Anitescu and Potra: contact c
has the normal n_c, and directions d_cj in its tangent plane instead of the circle of
friction. With v = M^-1 p the change of velocity by impulses p = N' l + D' b,

    u = N (v_free + v) + gap / h >= 0         normal velocity    | l >= 0   impulse
    s = D (v_free + v) + E g     >= 0         sliding            | b >= 0   friction
    r = mu l - E' b              >= 0         room in the cone   | g >= 0   speed

and a product of 0 in each row: an LCP with z = (l, b, g) and

        [N W N'  N W D'  0]       [N v_free + gap / h]
    A = [D W N'  D W D'  E],  q = [D v_free          ],   W = M^-1.
        [mu      -E'     0]       [0                 ]

For z >= 0, z'A z = |J' (l, b)|^2_W + mu l'g >= 0: A is copositive. It is neither a
P-matrix nor semidefinite, and singular on most faces. Where no gap is negative and the
bodies can stand still, q'z >= 0 wherever z >= 0, A z >= 0 and z'A z = 0, so that there
is a solution, which Lemke's method finds (Cottle, Pang and Stone 1992, 4.4.12). A
contact with mu = 0 has its row of l alone: if all have, A is N W N'.

References
----------
Stewart and Trinkle, Int. J. Numer. Methods Eng. 39 (1996) 2673-2691.
Anitescu and Potra, Nonlinear Dynamics 14 (1997) 231-247.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

PLANE, SPACE = (0, 1, 5), (0, 1, 2, 3, 4, 5)
"""Degrees of freedom of a body: of velocity (3) and angular velocity (3)."""


class Bodies(NamedTuple):
    """Rigid bodies: centres (k, 3), masses (k,), moments of inertia (k, 3).

    The moments are those about the world's axes through the centre (a body that is
    turned in space needs axes of its own: see `docs/contact.md`); velocity (k, 6),
    linear [m/s] and angular [rad/s], is that at the end of the time step without
    contact forces. In the plane z = 0.
    """

    centre: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray
    velocity: np.ndarray


class Contacts(NamedTuple):
    """Contacts: two bodies each, negative: the ground; points and unit normals (m, 3).

    The normal points from the first body to the second. mu (m,): coefficients of
    friction. gap (m,): distance divided by the length of the time step [m/s].
    """

    first: np.ndarray
    second: np.ndarray
    point: np.ndarray
    normal: np.ndarray
    mu: np.ndarray
    gap: np.ndarray


class Scene(NamedTuple):
    """Bodies and contacts; directions of friction: 2 in the plane z = 0, else 4, 6, ...

    In the plane, gravity is along x or y, and bodies turn about z.
    """

    bodies: Bodies
    contacts: Contacts
    directions: int = 2

    @property
    def freedom(self) -> list[int]:
        """The degrees of freedom of a body, as columns of `Bodies.velocity`."""
        return list(PLANE if self.directions == 2 else SPACE)

    def tangents(self) -> np.ndarray:
        """Return the directions of friction, (directions, k, 3): evenly round.

        k counts the contacts that have any.
        """
        n = self.contacts.normal[self.rough]
        if self.directions == 2:
            t = np.column_stack((n[:, 1], -n[:, 0], n[:, 2]))
            return np.array([t, -t])
        least = np.eye(3)[np.abs(n).argmin(axis=1)]
        one = np.cross(n, least)
        one /= np.linalg.norm(one, axis=1)[:, None]
        two = np.cross(n, one)
        angle = 2.0 * np.pi * np.arange(self.directions) / self.directions
        turn = np.array([np.cos(angle), np.sin(angle)])
        turn[np.abs(turn) < 1e-15] = 0.0  # at right angles
        return np.einsum("ad,ami->dmi", turn, np.array([one, two]))

    @property
    def rough(self) -> np.ndarray:
        return np.flatnonzero(self.contacts.mu > 0.0)

    def jacobian(self) -> sp.csr_array:
        """Return [N; D]: from velocities to those along normals, then directions.

        A contact's velocity is that of the second body minus that of the first.
        """
        bodies, contacts, freedom = self.bodies, self.contacts, self.freedom
        along = np.vstack([contacts.normal, *self.tangents()])
        contact = np.arange(contacts.mu.size)
        contact = np.concatenate((contact, np.tile(self.rough, self.directions)))
        shape = contact.size, len(freedom) * bodies.mass.size
        total = sp.csr_array(shape)
        for body, sign in ((contacts.first, -1.0), (contacts.second, 1.0)):
            rows = np.flatnonzero(body[contact] >= 0)
            moved = body[contact[rows]]
            arm = contacts.point[contact[rows]] - bodies.centre[moved]
            turn = np.cross(arm, along[rows])
            entries = sign * np.column_stack((along[rows], turn))[:, freedom]
            columns = len(freedom) * moved[:, None] + np.arange(len(freedom))
            place = np.repeat(rows, len(freedom)), columns.ravel()
            total = total + sp.csr_array((entries.ravel(), place), shape=shape)
        return sp.csr_array(total)

    def inverse_mass(self) -> np.ndarray:
        mass, inertia = self.bodies.mass, self.bodies.inertia
        M = np.column_stack((mass, mass, mass, inertia))
        return 1.0 / M[:, self.freedom].ravel()

    def impulses(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return normal impulses (m,) and friction (m, 3) of a solution z, in N s.

        Both act on the second body of the contact, and the opposite on the first.
        """
        m, k = self.contacts.mu.size, self.rough.size
        b = z[m : m + self.directions * k].reshape(self.directions, k, 1)
        friction = np.zeros((m, 3))
        friction[self.rough] = (b * self.tangents()).sum(axis=0)
        return z[:m], friction

    def velocity(self, z: np.ndarray) -> np.ndarray:
        """Return the velocities (k, 6) at the end of the step for a solution z."""
        J = self.jacobian()
        change = self.inverse_mass() * (J.T @ z[: J.shape[0]])
        velocity = self.bodies.velocity.copy()
        velocity[:, self.freedom] += change.reshape(len(velocity), -1)
        return velocity


def friction_lcp(scene: Scene) -> tuple[sp.csr_array, np.ndarray]:
    """Return A and q of the LCP of a time step; z = (l, b, g), b by directions.

    `Scene.impulses` and `Scene.velocity` read its solution.

    Raises
    ------
    TypeError, ValueError
        An array of the scene has a wrong shape or values without a meaning.

    Examples
    --------
    A block of 1 kg on the ground, pushed with 6 N for 10 ms:

    >>> import numpy as np
    >>> from namlcp import solve_lcp
    >>> from namlcp.scenes.friction import Bodies, Contacts, Scene, friction_lcp
    >>> free = np.array([[0.06, -0.0981, 0.0, 0.0, 0.0, 0.0]])
    >>> block = Bodies(np.zeros((1, 3)), np.ones(1), np.ones((1, 3)), free)
    >>> below = Contacts(np.array([-1]), np.array([0]), np.zeros((1, 3)),
    ...                  np.array([[0.0, 1.0, 0.0]]), np.array([0.5]), np.zeros(1))
    >>> scene = Scene(block, below)
    >>> z = solve_lcp(*friction_lcp(scene)).z
    >>> normal, friction = scene.impulses(z)
    >>> normal.round(5), friction[0].round(5), scene.velocity(z)[0, :1].round(5)
    (array([0.0981]), array([-0.04905,  0.     ,  0.     ]), array([0.01095]))
    """
    check_scene(scene)
    mu, rough, count = scene.contacts.mu, scene.rough, scene.directions
    m, k = mu.size, rough.size
    J = scene.jacobian()
    W = J @ sp.diags_array(scene.inverse_mass()) @ J.T
    E = sp.vstack([sp.csr_array((m, k)), *[sp.eye_array(k)] * count])
    cone = sp.diags_array(mu, shape=(m, m)).tocsr()[rough]
    room = sp.hstack([cone, *[-sp.eye_array(k)] * count])
    A = sp.csr_array(sp.block_array([[W, E], [room, None]]))
    A.eliminate_zeros()
    A.sort_indices()
    q = np.zeros(A.shape[0])
    q[: J.shape[0]] = J @ scene.bodies.velocity[:, scene.freedom].ravel()
    q[:m] += scene.contacts.gap
    return A, q


def check_scene(scene: Scene) -> None:
    k, m, count = len(scene.bodies.mass), len(scene.contacts.mu), scene.directions
    shapes = {"Bodies": [(k, 3), (k,), (k, 3), (k, 6)]}
    shapes["Contacts"] = [(m,), (m,), (m, 3), (m, 3), (m,), (m,)]
    for part in scene[:2]:
        kind = type(part).__name__
        for name, value, shape in zip(part._fields, part, shapes[kind], strict=True):
            if not isinstance(value, np.ndarray):
                raise TypeError(f"{kind}.{name} must be an array, got {value!r}")
            if value.shape != shape:
                got = f"{shape}, got {value.shape}"
                raise ValueError(f"{kind}.{name} must have shape {got}")
    bodies, contacts = scene.bodies, scene.contacts
    if count != 2 and (count < 4 or count % 2):
        raise ValueError(f"directions must be 2, in the plane, 4, 6, ..., got {count}")
    length = np.linalg.norm(contacts.normal, axis=1)
    refuse("Contacts.normal must hold unit vectors", abs(length - 1.0) > 1e-6, length)
    if count == 2:
        depth = contacts.normal[:, 2]
        words = "Contacts.normal must lie in the plane z = 0 where directions = 2"
        refuse(words, depth != 0.0, depth)
    refuse("Contacts.mu must not be negative", ~(contacts.mu >= 0.0), contacts.mu)
    refuse("Bodies.mass must be positive", ~(bodies.mass > 0.0), bodies.mass)
    for name in ("first", "second"):
        body = getattr(contacts, name)
        if body.dtype.kind not in "iu":
            raise TypeError(f"Contacts.{name} must hold integers, got {body.dtype}")
        words = f"Contacts.{name} must be negative, the ground, or less than {k}"
        refuse(words, body >= k, body)


def refuse(words: str, wrong: np.ndarray, values: np.ndarray) -> None:
    if wrong.any():
        i = int(np.argmax(wrong))
        raise ValueError(f"{words}, got {values[i]:g} at ({i})")
