"""Sequences of QPs with the same matrices, as a loop meets them.

SCENES has a maker of each by name: make(size, level) with one of its `sizes` and of
LEVELS, which says how far the active set moves from a step to the next.

Model-predictive control of a quadcopter, with the stages as unknowns or without,

    minimise  sum_k (x_k - r)'Q(x_k - r) / 2 + u_k'R u_k / 2
    subject to  x_{k+1} = F x_k + B u_k,  lower <= x_k <= upper,  least <= u_k <= most

from the measured state x_0, in a closed loop: the first input is applied, the state is
disturbed, and the height that is wanted changes. The model is that of the example
"Model predictive control (MPC)" in OSQP's documentation: 12 states (three angles, three
positions, and the rates of both), 4 rotors, steps of 0.1 s.

Contact: time steps of discs in a box that is shaken (Moreau's scheme, no friction),

    minimise  v'M v / 2 - v'M(v_old + dt g + kicks)   subject to  N'v >= -gap / dt

for the velocities v; then positions += dt v. The normals N stay those of the heap at
rest, so that only q and h change. The gaps are open at first; then the discs rattle.
Units: dt = g = 1.

Portfolio: long-only, its expected returns estimated anew every day,

    minimise  w'(RISK C)w / 2 - r'w   subject to  sum(w) = 1,  0 <= w <= most

with the covariance C of a factor model as a dense matrix.

Lasso path: the penalty falls from where nothing is chosen to a thousandth of it,

    minimise  |X w - y|^2 / 2 + penalty |w|_1,   w = u - v,  u, v >= 0

as QP in (u, v), whose P is singular. One feature in five has an influence.
"""

import itertools
from collections.abc import Callable, Generator
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from validation.harness import qps
from validation.problems.contact_scenes import heap_of_discs

LEVELS = ("stays", "moves a little", "moves a lot")

Vectors = dict[str, np.ndarray]  # new values of some of q, h, b, lb and ub

Steps = Generator[Vectors, np.ndarray | None, None]
"""Yields what changes; is sent the solution, None where there is none."""


Sequence = tuple[Problem, Steps]
"""The first problem, and a loop of changes, which asks for less if sent None."""


class Scene(NamedTuple):
    """make(size, level) for each of `sizes`: stages, assets, features, contacts."""

    make: Callable[[int, str], Sequence]
    sizes: tuple[int, ...]


STATES, INPUTS = 12, 4
NOISE = dict(zip(LEVELS, (0.01, 0.25, 0.6), strict=True))
"""Standard deviation of the disturbance of the rates."""
JUMP = dict(zip(LEVELS, (0.0, 0.5, 2.0), strict=True))
"""Difference of the two heights that are wanted in turn."""
PERIOD = 20  # steps for which one of them is wanted
HOVER = 10.5916  # the thrust of a rotor that carries the weight
LEAST, MOST = 9.6 - HOVER, 13.0 - HOVER
TILT, FALL = np.pi / 6, -1.0  # largest angle, least height
WEIGHTS = np.array([0.0, 0.0, 10.0, 10.0, 10.0, 10.0, 0.0, 0.0, 0.0, 5.0, 5.0, 5.0])
EFFORT = 0.1  # weight of an input
EVERY = 0.1  # what `stagewise_definite` adds to all weights
TILTED, HEIGHT, RATES = slice(0, 2), 5, slice(6, 12)  # of the states


def plant() -> tuple[np.ndarray, np.ndarray]:
    F = np.eye(STATES)
    F[0:3, 6:9] = 0.1 * np.eye(3)
    F[3:6, 9:12] = 0.0992 * np.eye(3)
    F[9:12, 9:12] = 0.9846 * np.eye(3)
    for sign, angle, along in ((1.0, 0, 3), (-1.0, 1, 4)):
        F[along, angle], F[along, angle + 6] = sign * 0.0488, sign * 0.0016
        F[along + 6, angle], F[along + 6, angle + 6] = sign * 0.9734, sign * 0.0488
    roll, pitch = np.array([0.0, -1.0, 0.0, 1.0]), np.array([-1.0, 0.0, 1.0, 0.0])
    yaw, lift = np.array([-1.0, 1.0, -1.0, 1.0]), np.ones(4)
    B = np.outer([0.0726, 0, 0, 0.0006, 0, 0, 1.4512, 0, 0, 0.0236, 0, 0], roll)
    B += np.outer([0, 0.0726, 0, 0, -0.0006, 0, 0, 1.4512, 0, 0, -0.0236, 0], pitch)
    B += np.outer([0, 0, 0.0152, 0, 0, 0, 0, 0, 0.3049, 0, 0, 0], yaw)
    B += np.outer([0, 0, 0, 0, 0, 0.0106, 0, 0, 0, 0, 0, 0.2107], lift)
    return F, B


def limits() -> tuple[np.ndarray, np.ndarray]:
    lower, upper = np.full(STATES, -np.inf), np.full(STATES, np.inf)
    lower[TILTED], upper[TILTED], lower[HEIGHT] = -TILT, TILT, FALL
    return lower, upper


class Controller(NamedTuple):
    """A QP at rest, its vectors at a measured and a wanted state, its first inputs."""

    problem: Problem
    vectors: Callable[[np.ndarray, np.ndarray], Vectors]
    inputs_at: slice


Build = Callable[[int], Controller]


def closed_loop(build: Build, stages: int, level: str) -> Sequence:
    """Return the loop of a controller; without a solution, it starts from half."""
    problem, vectors, inputs_at = build(stages)
    F, B = plant()

    def steps() -> Steps:
        rng = np.random.default_rng(stages)
        state, wanted = np.zeros(STATES), np.zeros(STATES)
        for step in itertools.count():
            wanted[HEIGHT] = JUMP[level] * (step // PERIOD % 2)
            while (x := (yield vectors(state, wanted))) is None:
                state = 0.5 * state
            state = F @ state + B @ x[inputs_at]
            state[RATES] += NOISE[level] * rng.standard_normal(6)

    return problem, steps()


def single(build: Build, stages: int, state: np.ndarray) -> Problem:
    """Return the QP of a controller that is to rest at 0."""
    problem, vectors, _ = build(stages)
    return Problem(**qps.by_name(problem) | vectors(state, np.zeros(STATES)))


def stagewise(stages: int, weights: np.ndarray = WEIGHTS) -> Controller:
    """Return the QP in x_0, ..., x_N, u_0, ..., u_{N-1}, sparse.

    P is singular where a weight is zero, but not on the states that inputs can reach.
    """
    F, B = plant()
    every = sp.eye_array(stages + 1)
    past = sp.eye_array(stages + 1, k=-1)
    costs = sp.kron(every, sp.diags_array(weights))
    P = sp.block_diag((costs, EFFORT * sp.eye_array(INPUTS * stages)))
    dynamics = sp.kron(past, F) - sp.eye_array(STATES * (stages + 1))
    inputs = sp.kron(sp.eye_array(stages + 1, stages, k=-1), B)
    A = sp.csc_matrix(sp.hstack((dynamics, inputs)))
    lower, upper = limits()
    free = np.full(STATES, np.inf)  # x_0 is measured
    lb = np.concatenate((-free, *[lower] * stages, np.full(INPUTS * stages, LEAST)))
    ub = np.concatenate((free, *[upper] * stages, np.full(INPUTS * stages, MOST)))

    def vectors(state: np.ndarray, wanted: np.ndarray) -> Vectors:
        b = np.zeros(A.shape[0])
        b[:STATES] = -state
        cost = np.tile(-weights * wanted, stages + 1)
        return {"q": np.append(cost, np.zeros(INPUTS * stages)), "b": b}

    q, b = vectors(np.zeros(STATES), np.zeros(STATES)).values()
    problem = Problem(sp.csc_matrix(P), q, None, None, A, b, lb, ub)
    first = STATES * (stages + 1)
    return Controller(problem, vectors, slice(first, first + INPUTS))


def stagewise_definite(stages: int) -> Controller:
    """Return `stagewise` with weights on all states, so that P is definite."""
    return stagewise(stages, WEIGHTS + EVERY)


def condensed(stages: int) -> Controller:
    """Return it in u_0, ..., u_{N-1} alone, dense; (x_1, ..., x_N) is T x_0 + S u."""
    F, B = plant()
    powers = [np.eye(STATES)]
    for _ in range(stages):
        powers.append(F @ powers[-1])
    T = np.vstack(powers[1:])
    zero = np.zeros((STATES, INPUTS))
    every = range(stages)
    blocks = [[powers[k - j] @ B if j <= k else zero for j in every] for k in every]
    S = np.block(blocks)
    Q = np.tile(WEIGHTS, stages)
    P = S.T @ (Q[:, None] * S) + EFFORT * np.eye(INPUTS * stages)
    P = 0.5 * (P + P.T)
    lower, upper = (np.tile(side, stages) for side in limits())
    above, below = (np.flatnonzero(np.isfinite(v)) for v in (upper, lower))
    G = np.vstack((S[above], -S[below]))

    def vectors(state: np.ndarray, wanted: np.ndarray) -> Vectors:
        alone = T @ state
        q = S.T @ (Q * (alone - np.tile(wanted, stages)))
        h = np.concatenate((upper[above] - alone[above], alone[below] - lower[below]))
        return {"q": q, "h": h}

    q, h = vectors(np.zeros(STATES), np.zeros(STATES)).values()
    bounds = np.full(q.size, LEAST), np.full(q.size, MOST)
    problem = Problem(P, q, G, h, None, None, *bounds)
    return Controller(problem, vectors, slice(0, INPUTS))


KICK = dict(zip(LEVELS, (0.01, 0.1, 1.0), strict=True))
"""Standard deviation of random changes of the velocities, over dt g."""
GAP = 1.0  # the gaps of the heap at rest: what a disc falls in the first step
MASSES = 10.0  # the largest mass over the least


def shaken_heap(contacts: int, level: str) -> Sequence:
    heap = heap_of_discs(contacts, True, MASSES, seed=contacts)
    mass = np.repeat(heap.bodies.mass, 2)
    n, moving = mass.size, np.arange(3 * heap.bodies.mass.size) % 3 < 2  # none turns
    G = sp.csc_matrix(-heap.jacobian()[:, moving])
    G.eliminate_zeros()
    P, h = sp.csc_matrix(sp.diags_array(mass)), np.full(G.shape[0], GAP)
    problem = Problem(P, np.zeros(n), G, h)

    def steps() -> Steps:
        rng = np.random.default_rng(contacts)
        v, moved = np.zeros(n), np.zeros(n)
        for _ in itertools.count():
            free = v + KICK[level] * rng.standard_normal(n)
            free[1::2] -= 1.0
            h = GAP - G @ moved
            found = yield {"q": -mass * free, "h": h}
            v = np.zeros(n) if found is None else found
            moved = moved + v

    return problem, steps()


NEWS = dict(zip(LEVELS, (1e-3, 1e-2, 1e-1), strict=True))
"""Change of the expected returns, over their own spread, from one day to the next."""
RISK = 5.0  # aversion
SHARE, FEWEST = 0.1, 4.0  # largest share; at least this many can fill the budget
POOR = 0.9  # part of the expected returns that is not forgotten


def rebalancing(assets: int, level: str) -> Sequence:
    rng = np.random.default_rng(assets)
    loadings = 0.3 * rng.standard_normal((assets, assets // 10))
    specific = 0.05 + 0.1 * rng.random(assets)
    P = RISK * (loadings @ loadings.T + np.diag(specific))
    first = rng.standard_normal(assets)
    bounds = np.zeros(assets), np.full(assets, max(SHARE, FEWEST / assets))
    problem = Problem(P, -first, None, None, np.ones((1, assets)), np.ones(1), *bounds)

    def days() -> Steps:
        # returns wander about the first, so that their spread stays
        wander = np.zeros(assets)
        for _ in itertools.count():
            yield {"q": -(first + wander)}
            wander = POOR * wander + NEWS[level] * rng.standard_normal(assets)

    return problem, days()


VALUES = dict(zip(LEVELS, (1000, 100, 20), strict=True))
"""Values of the penalty on the whole path."""
LAST = 1e-3  # the last penalty over the first
ERROR = 0.5  # of y


def penalty_path(features: int, level: str) -> Sequence:
    rng = np.random.default_rng(features)
    X = rng.standard_normal((2 * features, features)) / np.sqrt(2 * features)
    w = rng.standard_normal(features) * (rng.random(features) < 0.2)
    y = X @ w + ERROR * rng.standard_normal(2 * features)
    C, c = X.T @ X, X.T @ y
    P = np.block([[C, -C], [-C, C]])
    linear, ones = np.append(-c, c), np.ones(2 * features)
    penalties = np.abs(c).max() * np.geomspace(1.0, LAST, VALUES[level])
    problem = Problem(P, linear + penalties[0] * ones, lb=0.0 * ones)

    def steps() -> Steps:
        for penalty in penalties:
            yield {"q": linear + penalty * ones}

    return problem, steps()


SCENES = {
    "condensed MPC": Scene(partial(closed_loop, condensed), (5, 10, 25)),
    "sparse MPC": Scene(partial(closed_loop, stagewise), (10, 30, 60)),
    "sparse MPC, definite": Scene(
        partial(closed_loop, stagewise_definite), (10, 30, 60)
    ),
    "portfolio": Scene(rebalancing, (50, 200, 500)),
    "lasso path": Scene(penalty_path, (10, 50, 200)),
    "contact": Scene(shaken_heap, (30, 120, 500)),
}
