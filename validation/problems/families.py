"""The problem families of the work-precision chart, at least five problems in each.

`families(data)` returns them by name; a problem is made only when its function is
called. What comes from the data folder stands beside generated problems of the same
kind, so that every family is there without it. LCPs with a symmetric A are the QPs
min 1/2 z'Az + q'z over the box.
"""

from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from validation.problems import data_sets, draw, osqp_classes, sequences
from validation.problems import known_scenes as known
from validation.problems.contact_scenes import brick_wall, disc_pile, heap
from validation.problems.sweep_scenes import paper_example, paper_solution, paper_start

PAPER_SIDES = (10, 30, 100)  # m of the paper's tables, with n = m^2 unknowns


class Task(NamedTuple):
    """A problem, its solution where the construction knows it, a sweep's start."""

    problem: Problem
    exact: np.ndarray | None = None
    s0: np.ndarray | None = None


class Family(NamedTuple):
    """The makers of the problems by name.

    `distance`: the solutions are unique, so that the error is the distance to them,
    || x - x* ||_inf / || x* ||_inf; else it is the worst residual. `sweeps` stand
    beside method="auto", where there are some, else the QP solvers beside namlcp.
    """

    distance: bool
    makers: dict[str, Callable[[], Task]]
    sweeps: tuple[str, ...] = ()


QUICK = 2  # problems of a family in the quick version, its first ones


def boxed(scene: known.BoxLCP, *solution: np.ndarray) -> Task:
    A, q, lower, upper = scene
    P = A if isinstance(A, np.ndarray) else sp.csc_matrix(A)
    return Task(Problem(P, q, lb=lower, ub=upper), *solution)


def paper_task(number: int, delta: float, m: int) -> Task:
    """Return an example of the paper, z* = (1, 2, 1, 2, ...), from its start."""
    return boxed(paper_example(number, m, delta), paper_solution(m), paper_start(m))


def quadcopter(stages: int) -> Task:
    """Return a step of sparse predictive control, 16 unknowns a stage, P definite."""
    state = np.zeros(sequences.STATES)
    state[[3, sequences.HEIGHT]] = 1.0, 2.0  # where it is, x and z
    return Task(sequences.single(sequences.stagewise_definite, stages, state))


def preview_control(steps: int) -> Task:
    """Return a QP: a walking robot keeps its balance (linear model predictive control).

    Point mass at height 0.8 m above alternating footsteps, state (position, velocity,
    acceleration), jerks as unknowns, 0.1 s a step; the zero-moment point
    position - 0.8/9.81 acceleration stays within 0.06 m of the support, and the state
    ends at rest over the last support (Kajita et al., ICRA 2003; Wieber, Humanoids
    2006).
    """
    T, height, gravity = 0.1, 0.8, 9.81
    F = np.array([[1.0, T, T**2 / 2.0], [0.0, 1.0, T], [0.0, 0.0, 1.0]])
    g = np.array([T**3 / 6.0, T**2 / 2.0, T])
    rows = np.zeros((steps, 3, steps))
    for k in range(steps):
        if k:
            rows[k] = F @ rows[k - 1]
        rows[k, :, k] = g
    zmp = rows[:, 0] - height / gravity * rows[:, 2]
    support = np.where(np.arange(steps) // 8 % 2 == 0, 0.1, -0.1)
    P = 1e-3 * np.eye(steps) + rows[:, 1].T @ rows[:, 1]
    G = np.vstack((zmp, -zmp))
    h = np.concatenate((support + 0.06, 0.06 - support))
    start = 0.1 * np.ones(2 * steps)
    start[steps:] = -0.1
    end = np.array([support[-1] - 0.1, 0.0, 0.0])
    return Task(Problem(P, np.zeros(steps), G, h - start, rows[-1], end))


def linear_svm(points: int, features: int = 20) -> Task:
    """Return min |w|^2 / 2 + sum xi_i^2 / 2 subject to y_i x_i'w + xi_i >= 1."""
    X, y = known.two_clouds(points, features)
    G = sp.csc_matrix(sp.hstack([-(y[:, None] * X), -sp.eye_array(points)]))
    n = features + points
    P = sp.csc_matrix(sp.eye_array(n))
    return Task(Problem(P, np.zeros(n), G, np.full(points, -1.0)))


def random_qp(largest: int, seed: int) -> Task:
    return Task(draw.random_qp(np.random.default_rng(seed), draw.Dials(largest)))


def stored(data: Path, problem_set: str, name: str) -> Task:
    return Task(data_sets.load(data, problem_set, name))


STORED = {
    "contact": ("contact", "boxstacks_g82 capsules_286 kaplas_570 mj_pile40"),
    "MPC": ("mpc", "LIPMWALK0 LIPMWALK14 WHLIPBAL0 WHLIPBAL14"),
    "general QP": ("all", "HS118 DUAL4 QPCBLEND CVXQP1_M MOSARQP1 LISWET1 AUG2DCQP"),
}


def families(data: Path | None) -> dict[str, Family]:
    """Return the families by name, with what the data folder has of them."""
    from namlcp.lcp.modulus.methods import SWEEPS

    heart = data is not None and (data / "svm" / "heart_scale").exists()
    X, y = data_sets.heart_scale(data) if heart else known.two_clouds(270)
    classed = osqp_classes.generate
    sweeps = tuple(f"sweep {name}" for name in (*SWEEPS, "lemke"))
    examples = {
        f"Example {k}, delta = {delta:g}, n = {m**2}": partial(paper_task, k, delta, m)
        for m, delta, k in product(PAPER_SIDES, (4.0, 0.25), (1, 2))
    }
    found = {
        "obstacle": Family(True, {
            "forced, small": lambda: boxed(known.obstacle(22)),
            "torsion, small": lambda: boxed(known.torsion(22, 22)),
            "forced": lambda: boxed(known.obstacle(100)),
            "ball": lambda: boxed(known.ball_obstacle(52)),
            "torsion": lambda: boxed(known.torsion(50, 50)),
            "journal bearing": lambda: boxed(known.journal_bearing(50, 50, 0.99)),
            "rough": lambda: boxed(known.rough_obstacle(50)),
            "anisotropic": lambda: boxed(known.anisotropic(100)),
            "half biactive": lambda: boxed(*known.biactive(50)),
        }),
        "contact": Family(False, {
            "wall, small": lambda: boxed(brick_wall(100)),
            "wedge": lambda: boxed(known.nonnegative(*disc_pile(12))),
            "heap": lambda: boxed(heap(1000)),
            "wide heap": lambda: boxed(heap(300, sideways=True)),
            "wall": lambda: boxed(brick_wall(1000)),
            "heap, large": lambda: boxed(heap(10_500)),
        }),
        "MPC": Family(True, {
            "point mass": lambda: boxed(known.input_bounded_mpc(100)),
            "walk": partial(preview_control, 24),
            "point mass, long": lambda: boxed(known.input_bounded_mpc(200)),
            "walk, long": partial(preview_control, 40),
            "sparse": partial(quadcopter, 60),
            "sparse, long": partial(quadcopter, 650),
        }),
        "SVM": Family(True, {
            "RBF": lambda: boxed(known.svm_rbf(X, y, 1.0 / 13.0)),
            "squared hinge": lambda: boxed(known.svm_l2(X, y)),
            "clouds, 500": lambda: boxed(known.svm_rbf(*known.two_clouds(500), 0.2)),
            "clouds, 1000": lambda: boxed(
                known.svm_rbf(*known.two_clouds(1000, 13), 1.0 / 13.0)
            ),
            "linear, 1000": partial(linear_svm, 1000),
            "linear, 10 000": partial(linear_svm, 10_000),
        }),
        "general QP": Family(False, {
            "random, 1": partial(random_qp, 2000, 1),
            "lasso": lambda: Task(classed("lasso", 20)),
            "random, 4": partial(random_qp, 800, 4),
            "portfolio": lambda: Task(classed("portfolio", 12)),
            "portfolio, long": lambda: Task(classed("portfolio", 43)),
            "Huber": lambda: Task(classed("Huber", 15)),
        }),
        "paper": Family(True, examples, sweeps),
    }  # fmt: skip
    for family, (problem_set, names) in STORED.items() if data is not None else ():
        for name in names.split():
            found[family].makers[name] = partial(stored, data, problem_set, name)
    return found
