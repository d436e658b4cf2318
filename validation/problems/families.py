"""The problem families of the work-precision chart, at least five problems in each.

`families(data)` returns them by name; a problem is made only when its function is
called. What comes from the data folder stands beside generated problems of the same
kind, so that every family is there without it; `missing` says what is not. LCPs with a
symmetric A are the QPs min 1/2 z'Az + q'z over the box.
"""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from namlcp.scenes import disc_pile, preview_control
from validation.problems import data_sets, draw, osqp_classes, sequences
from validation.problems.contact_scenes import brick_wall, heap
from validation.problems.known_scenes import (
    BoxLCP,
    ball_obstacle,
    input_bounded_mpc,
    journal_bearing,
    nonnegative,
    obstacle,
    portfolio,
    svm_data,
    svm_l2,
    svm_rbf,
    torsion,
    two_clouds,
)
from validation.problems.large_scenes import (
    anisotropic,
    biactive,
    rough_obstacle,
)
from validation.problems.sweep_scenes import paper_example

PAPER_SIDES = (10, 30, 100)  # m of the paper's tables, with n = m^2 unknowns


class Task(NamedTuple):
    """A problem, its solution where the construction knows it, a sweep's start."""

    problem: Problem
    exact: np.ndarray | None = None
    s0: np.ndarray | None = None


class Family(NamedTuple):
    """The makers of the problems by name.

    `distance`: the solutions are unique, so that the error is the distance to them,
    || x - x* ||_inf / || x* ||_inf; else it is the worst residual. `quick`: the names
    that the quick version takes. `sweeps` stand beside method="auto", where there are
    some, else the QP solvers beside namlcp.
    """

    distance: bool
    makers: dict[str, Callable[[], Task]]
    quick: tuple[str, ...]
    sweeps: tuple[str, ...] = ()


def boxed(scene: BoxLCP, exact: np.ndarray | None = None) -> Task:
    A, q, lower, upper = scene
    P = A if isinstance(A, np.ndarray) else sp.csc_matrix(A)
    return Task(Problem(P, q, lb=lower, ub=upper), exact)


def paper_task(number: int, delta: float, m: int) -> Task:
    """Return an example of the paper, z* = (1, 2, 1, 2, ...), from its start."""
    scene = paper_example(number, m, delta)
    problem = Problem(sp.csc_matrix(scene.A), scene.q, lb=scene.lower, ub=scene.upper)
    return Task(problem, np.tile([1.0, 2.0], m * m // 2), scene.s0)


def quadcopter(stages: int) -> Task:
    """Return a step of sparse predictive control, 16 unknowns a stage, P definite."""
    state = np.zeros(sequences.STATES)
    state[[3, sequences.HEIGHT]] = 1.0, 2.0  # where it is, x and z
    return Task(sequences.single(sequences.stagewise_definite, stages, state))


def linear_svm(points: int, features: int = 20) -> Task:
    """Return a linear SVM with squared hinge loss, as its users write it.

    min 1/2 |w|^2 + 1/2 sum xi_i^2 subject to y_i x_i'w + xi_i >= 1.
    """
    X, y = two_clouds(points, features)
    G = sp.hstack([-(y[:, None] * X), -sp.eye_array(points)])
    n = features + points
    P = sp.eye_array(n)
    return Task(
        Problem(sp.csc_matrix(P), np.zeros(n), sp.csc_matrix(G), np.full(points, -1.0))
    )


def random_qp(largest: int, seed: int) -> Task:
    """Return a sparse QP of random size up to `largest` around a planted point."""
    return Task(draw.random_qp(np.random.default_rng(seed), draw.Dials(largest)))


def classed(name: str, size: int) -> Task:
    return Task(osqp_classes.generate(name, size))


def denoising(n: int, seed: int = 0) -> Task:
    """Return total-variation denoising of n samples: min 1/2 |x - y|^2 + sum |Dx|.

    |x_{i+1} - x_i| <= t_i, y a step function with noise.
    """
    rng = np.random.default_rng(seed)
    y = np.repeat(rng.standard_normal(-(-n // 50)), 50)[:n]
    y += 0.2 * rng.standard_normal(n)
    D = sp.diags_array([-1.0, 1.0], offsets=[0, 1], shape=(n - 1, n))
    eye = sp.eye_array(n - 1)
    G = sp.vstack([sp.hstack([D, -eye]), sp.hstack([-D, -eye])])
    P = sp.diags_array(np.r_[np.ones(n), np.zeros(n - 1)])
    q = np.r_[-y, np.ones(n - 1)]
    return Task(Problem(sp.csc_matrix(P), q, sp.csc_matrix(G), np.zeros(2 * n - 2)))


def stored(data: Path, problem_set: str, name: str) -> Task:
    return Task(data_sets.load(data, problem_set, name))


STORED = {
    "contact": ("contact", "boxstacks_g82 capsules_286 kaplas_570 mj_pile40".split()),
    "MPC": ("mpc", "LIPMWALK0 LIPMWALK14 WHLIPBAL0 WHLIPBAL14".split()),
    "general QP": (
        "all",
        "HS118 DUAL4 QPCBLEND CVXQP1_M MOSARQP1 LISWET1 AUG2DCQP".split(),
    ),
}
"""What the data folder adds to a family: the set and the names."""


def file_of(data: Path, problem_set: str, name: str) -> Path:
    if problem_set == "all":
        return data / "maros_meszaros" / f"{name}.mat"
    return data / problem_set / f"{name}.npz"


def families(data: Path | None) -> dict[str, Family]:
    """Return the families by name, with what the data folder has of them.

    obstacle: on 100 x 100, 50 x 50 and 22 x 22 nodes; contact: without friction, many A
    are singular; MPC: condensed and sparse; SVM: up to 10^4 points; general QP:
    everything a QP may have; paper: for the sweeps and method="auto" alone.
    """
    from namlcp.lcp import SWEEPS

    X, y = svm_data(data)
    obstacles = {
        "forced": lambda: boxed(obstacle(100)),
        "ball": lambda: boxed(ball_obstacle(52)),
        "torsion": lambda: boxed(torsion(50, 50)),
        "journal bearing": lambda: boxed(journal_bearing(50, 50, 0.99)),
        "rough": lambda: boxed(rough_obstacle(50)),
        "anisotropic": lambda: boxed(anisotropic(100)),
        "half biactive": lambda: boxed(*biactive(50)),
        "forced, small": lambda: boxed(obstacle(22)),
        "torsion, small": lambda: boxed(torsion(22, 22)),
    }
    contacts = {
        "heap": lambda: boxed(heap(1000)),
        "wide heap": lambda: boxed(heap(300, sideways=True)),
        "wall": lambda: boxed(brick_wall(1000)),
        "wall, small": lambda: boxed(brick_wall(100)),
        "wedge": lambda: boxed(nonnegative(*disc_pile(12))),
        "heap, large": lambda: boxed(heap(10_500)),
    }
    controls = {
        "point mass": lambda: boxed(input_bounded_mpc(100)),
        "point mass, long": lambda: boxed(input_bounded_mpc(200)),
        "walk": lambda: Task(preview_control(24)),
        "walk, long": lambda: Task(preview_control(40)),
        "sparse": partial(quadcopter, 60),
        "sparse, long": partial(quadcopter, 650),
    }
    machines = {
        "RBF": lambda: boxed(svm_rbf(X, y, 1.0 / 13.0)),
        "squared hinge": lambda: boxed(svm_l2(X, y)),
        "clouds, 500": lambda: boxed(svm_rbf(*two_clouds(500), 0.2)),
        "clouds, 1000": lambda: boxed(svm_rbf(*two_clouds(1000, 13), 1.0 / 13.0)),
        "linear, 1000": partial(linear_svm, 1000),
        "linear, 10 000": partial(linear_svm, 10_000),
    }
    general = {
        "random, 1": partial(random_qp, 2000, 1),
        "random, 4": partial(random_qp, 800, 4),
        "portfolio": lambda: boxed(portfolio(300)),
        "factor portfolio": partial(classed, "portfolio", 43),
        "denoising": partial(denoising, 2000),
        "lasso": partial(classed, "lasso", 20),
    }
    examples = {
        f"Example {number}, delta = {delta:g}, n = {m**2}": partial(
            paper_task, number, delta, m
        )
        for m in PAPER_SIDES
        for delta in (4.0, 0.25)
        for number in (1, 2)
    }
    every = tuple(f"sweep {name}" for name in (*SWEEPS, "lemke"))
    known = {
        "obstacle": Family(True, obstacles, ("forced, small", "torsion, small")),
        "contact": Family(False, contacts, ("wall, small", "wedge")),
        "MPC": Family(True, controls, ("point mass", "walk")),
        "SVM": Family(True, machines, ("RBF", "squared hinge")),
        "general QP": Family(False, general, ("random, 1", "lasso")),
        "paper": Family(True, examples, tuple(examples)[:2], every),
    }
    for name, (problem_set, stored_names) in STORED.items():
        for key in stored_names:
            if data is not None and file_of(data, problem_set, key).exists():
                maker = partial(stored, data, problem_set, key)
                known[name].makers[key] = maker
    return known


def missing(data: Path | None) -> list[str]:
    """Return what the families would take from the data folder and do not find."""
    known = families(data)
    absent = [
        f"{family}: {key}"
        for family, (_, names) in STORED.items()
        for key in names
        if key not in known[family].makers
    ]
    heart = data is not None and (data / "svm" / "heart_scale").exists()
    return absent if heart else [*absent, "SVM: heart_scale"]
