"""Model-predictive control: a cart is moved while the pendulum on it stays upright.

    minimise  sum_k (x_k - r)'Q(x_k - r) / 2 + R u_k^2 / 2
    subject to  x_{k+1} = F x_k + B u_k,  |u_k| <= FORCE,  |angle_k| <= ANGLE

over the next HORIZON steps, from the measured state x_0; the first force is applied.
The states x_k = powers of F times x_0 + (linear in u) are substituted, so that the
unknowns are the forces alone. From step to step only q and h change.
"""

import time
from types import SimpleNamespace
from typing import Any

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from namlcp import Solver, Status

PERIOD, HORIZON = 0.05, 30  # s, steps
FORCE, ANGLE = 4.0, 0.12  # N, rad
CART, BOB, LENGTH, GRAVITY = 1.0, 0.2, 0.5, 9.81  # kg, kg, m, m/s^2
POSITION, TILT = 0, 2  # of the state: position, speed, angle, rate of the angle
Q, R = np.diag([10.0, 1.0, 10.0, 1.0]), 0.1


def plant() -> tuple[np.ndarray, np.ndarray]:
    """Return F and B: linearised where upright, the force constant in a step."""
    M = np.zeros((5, 5))
    M[0, 1] = M[2, 3] = 1.0
    M[1, 2], M[1, 4] = -BOB * GRAVITY / CART, 1.0 / CART
    M[3, 2] = (CART + BOB) * GRAVITY / (CART * LENGTH)
    M[3, 4] = -1.0 / (CART * LENGTH)
    E = expm(PERIOD * M)
    return E[:4, :4], E[:4, 4:]


def condensed(F: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return S and T with (x_1, ..., x_N) = S x_0 + T u, N = HORIZON."""
    S, T = np.empty((HORIZON, 4, 4)), np.zeros((HORIZON, 4, HORIZON))
    for k in range(HORIZON):
        S[k] = F @ (S[k - 1] if k else np.eye(4))
        T[k] = F @ T[k - 1] if k else 0.0
        T[k, :, k] = B[:, 0]
    return S, T


def run(steps: int = 300) -> SimpleNamespace:
    """Control the cart, and print what that took."""
    F, B = plant()
    S, T = condensed(F, B)
    weights = np.tile(Q, (HORIZON, 1, 1))
    weights[-1] = solve_discrete_are(F, B, Q, [[R]])  # the cost of all later steps
    P = np.einsum("kia,kij,kjb->ab", T, weights, T) + R * np.eye(HORIZON)
    tilts = T[:, TILT]
    bound = np.full(HORIZON, FORCE)
    solver = Solver(
        0.5 * (P + P.T), np.zeros(HORIZON), np.vstack((tilts, -tilts)),
        np.full(2 * HORIZON, ANGLE), lb=-bound, ub=bound,
    )  # fmt: skip
    solver.solve()  # computes what depends on the matrices alone
    rng = np.random.default_rng(0)
    state, solved = np.zeros(4), True
    states, forces, seconds = np.empty((steps, 4)), np.empty(steps), np.empty(steps)
    wanted = np.where(np.arange(steps) // 100 % 2 == 0, 1.0, -0.5)
    for k in range(steps):
        target = np.array([wanted[k], 0.0, 0.0, 0.0])
        q = np.einsum("kia,kij,kj->a", T, weights, S @ state - target)
        tilt = S[:, TILT] @ state
        h = np.concatenate((ANGLE - tilt, ANGLE + tilt))
        start = time.perf_counter()
        solver.update(q=q, h=h)
        result = solver.solve()
        seconds[k] = time.perf_counter() - start
        solved &= result.status is Status.SOLVED
        states[k], forces[k] = state, result.x[0]
        state = F @ state + B[:, 0] * result.x[0]
        state += [0.0, 2e-3, 0.0, 4e-3] * rng.standard_normal(4)
    limited = np.count_nonzero(abs(forces) > FORCE - 1e-9)
    median, most, worst = 1e6 * np.quantile(seconds, (0.5, 0.99, 1.0))
    print(
        f"{steps} steps, n = {HORIZON} forces, {2 * HORIZON} rows, bounds\n"
        f"{limited} forces at their limit, largest |angle| "
        f"{abs(states[:, TILT]).max():.3f} of {ANGLE}\n"
        f"a step (update and solve) takes {median:.0f} microseconds in the median, "
        f"{most:.0f} at 99 %, {worst:.0f} at worst"
    )
    return SimpleNamespace(
        states=states, wanted=wanted, forces=forces, seconds=seconds, solved=solved
    )


def draw(record: SimpleNamespace, figure: Any) -> None:
    """Draw position, angle, force and time of each step."""
    position, angle, force, cost = figure.subplots(4, 1, sharex=True)
    at = PERIOD * np.arange(record.forces.size)
    position.step(at, record.wanted, color="0.6", where="post", label="wanted")
    position.plot(at, record.states[:, POSITION], label="position")
    position.set_ylabel("cart [m]")
    position.legend(loc="lower right")
    angle.plot(at, record.states[:, TILT])
    force.step(at, record.forces, where="post")
    for axes, limit, name in (angle, ANGLE, "angle [rad]"), (force, FORCE, "force [N]"):
        for sign in (1.0, -1.0):
            axes.axhline(sign * limit, color="0.6", linestyle=":")
        axes.set_ylabel(name)
    cost.plot(at, 1e6 * record.seconds, ".", markersize=3)
    cost.set(yscale="log", ylabel="solve [µs]", xlabel="time [s]")
