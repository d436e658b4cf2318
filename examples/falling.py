"""Discs that fall into a box, roll, slide and come to rest: an LCP a time step.

The step is that of `namlcp.scenes.friction`, in velocities: a contact may close within
a step, but no further, and what has crept into another body is pushed out slowly. Each
LCP starts from the impulses that the same contacts had in the step before.
"""

import time
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from namlcp import Status, solve_lcp
from namlcp.scenes.friction import Bodies, Contacts, Scene, friction_lcp

GRAVITY = 9.81
STEP = 0.01  # [s]
REACH = 0.1  # distance up to which a contact is in the LCP [m]
PUSH_OUT = 0.1  # share of what has crept in that one step pushes out
ACCURACY = 1e-11  # Res of an LCP over max |q_i| that counts as solved


class Record(NamedTuple):
    """What one step tells: energy [J] after it, the deepest overlap [m] before it.

    n: unknowns of the LCP; residual: its Res over max |q_i|; seconds: processor time
    of its solution.
    """

    n: int
    status: Status
    method: str
    residual: float
    seconds: float
    energy: float
    overlap: float


class FallingDiscs:
    """Discs of random radii above the floor y = 0, between walls at 0 and `width`."""

    def __init__(
        self, count: int, mu: float = 0.5, warm: bool = True, seed: int = 0
    ) -> None:
        """Set the discs on a loose lattice, with random velocities.

        warm: each LCP starts from the last one.
        """
        rng = np.random.default_rng(seed)
        self.mu, self.warm = mu, warm
        self.radius = rng.uniform(0.3, 0.5, count)
        row = max(2, int(np.sqrt(count)))
        self.width = 1.1 * row + 0.6
        place = np.arange(count)
        self.centre = np.zeros((count, 3))
        self.centre[:, 0] = 0.6 + 1.1 * (place % row) + 0.5 * (place // row % 2)
        self.centre[:, 1] = 0.6 + 1.1 * (place // row)
        self.velocity = np.zeros((count, 6))
        self.velocity[:, :2] = rng.standard_normal((count, 2))
        self.mass = np.pi * self.radius**2
        self.inertia = np.repeat((0.5 * self.mass * self.radius**2)[:, None], 3, axis=1)
        self.last: dict[tuple[int, int], np.ndarray] = {}

    def contacts(self) -> tuple[Contacts, np.ndarray]:
        """Return the contacts within REACH, and their distances."""
        r, x = self.radius, self.centre
        pairs = cKDTree(x).query_pairs(2.0 * r.max() + REACH, output_type="ndarray")
        one, two = pairs[np.lexsort(pairs.T)].T
        line = x[two] - x[one]
        length = np.linalg.norm(line, axis=1)
        normal = [line / length[:, None]]
        bodies = [(one, two)]
        distance = [length - r[one] - r[two]]
        walls = ((-1, 1, 0.0, 1.0), (-2, 0, 0.0, 1.0), (-3, 0, self.width, -1.0))
        for name, axis, at, sign in walls:
            bodies.append((np.full(r.size, name), np.arange(r.size)))
            distance.append(sign * (x[:, axis] - at) - r)
            normal.append(np.tile(sign * np.eye(3)[axis], (r.size, 1)))
        apart = np.concatenate(distance)
        near = apart < REACH
        apart = apart[near]
        first, second = np.concatenate(bodies, axis=1)[:, near]
        along = np.concatenate(normal)[near]
        point = x[second] - r[second, None] * along
        gap = np.where(apart < 0.0, PUSH_OUT, 1.0) * apart / STEP
        mu = np.full(gap.size, self.mu)
        return Contacts(first, second, point, along, mu, gap), apart

    def step(self) -> Record:
        """Advance by one step."""
        contacts, distance = self.contacts()
        free = self.velocity.copy()
        free[:, 1] -= GRAVITY * STEP
        bodies = Bodies(self.centre, self.mass, self.inertia, free)
        scene = Scene(bodies, contacts)
        A, q = friction_lcp(scene)
        m = contacts.mu.size
        names = list(
            zip(contacts.first.tolist(), contacts.second.tolist(), strict=True)
        )
        kinds = q.size // m if m else 1
        none = np.zeros(kinds)
        z0 = np.array([self.last.get(name, none) for name in names]).T.ravel()
        size = float(np.abs(q).max(initial=0.0)) or 1.0
        start = time.thread_time()
        result = solve_lcp(A, q, z0=z0 if self.warm else None, eps_abs=ACCURACY * size)
        seconds = time.thread_time() - start
        z = result.z.reshape(kinds, m).T
        self.last = dict(zip(names, z, strict=True))
        self.velocity = scene.velocity(result.z)
        self.centre = self.centre + STEP * self.velocity[:, :3]
        return Record(
            q.size, result.status, result.method, result.residual / size, seconds,
            self.energy(), float(np.maximum(-distance, 0.0).max(initial=0.0)),
        )  # fmt: skip

    def energy(self) -> float:
        """Return kinetic and potential energy."""
        v, omega = self.velocity[:, :3], self.velocity[:, 3:]
        kinetic = self.mass @ (v**2).sum(axis=1) + (self.inertia * omega**2).sum()
        return float(0.5 * kinetic + GRAVITY * self.mass @ self.centre[:, 1])
