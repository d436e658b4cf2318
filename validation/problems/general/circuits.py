"""A bridge of four diodes that rectifies the current of an oscillator, step by step.

A coil (L) and a capacitor (C) feed a resistor (R) through four ideal diodes. With the
capacitor's voltage and the coil's current in the state x, and a voltage or current
of each diode in l, the other in y,

    x' = F x + B l,   y = H x + D l,   0 <= y, 0 <= l, y'l = 0.

An implicit Euler step of length h gives LCP(q, A) with A = D + h H W B, q = H W x,
W = (I - h F)^-1. D alone is not a P-matrix: [1 1; 1 1]/R and a skew part.

References
----------
Acary, Bonnefon and Brogliato, Nonsmooth Modeling and Simulation for Switched Circuits
(2011), section 1.1.
"""

from collections.abc import Callable

import numpy as np

COIL, CAPACITOR, RESISTOR = 1e-2, 1e-6, 1e3  # [H], [F], [Ohm]
START = 10.0  # voltage of the capacitor [V]
STEP = 1e-6  # [s]

F = np.array([[0.0, -1.0 / CAPACITOR], [1.0 / COIL, 0.0]])
B = np.array([[0.0, 0.0, -1.0 / CAPACITOR, 1.0 / CAPACITOR], [0.0, 0.0, 0.0, 0.0]])
H = np.array([[0.0, 0.0], [0.0, 0.0], [-1.0, 0.0], [1.0, 0.0]])
G = 1.0 / RESISTOR
D = np.array(
    [[G, G, -1.0, 0.0], [G, G, 0.0, -1.0], [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0]]
)
W = np.linalg.inv(np.eye(2) - STEP * F)

Solve = Callable[[np.ndarray, np.ndarray], np.ndarray]
"""From A and q to z."""


def march(steps: int, solve: Solve) -> tuple[np.ndarray, np.ndarray]:
    """Return the states (steps + 1, 2) and the diodes' values l (steps, 4)."""
    states, diodes = [np.array([START, 0.0])], []
    for _ in range(steps):
        diodes.append(solve(D + STEP * H @ W @ B, H @ W @ states[-1]))
        states.append(W @ (states[-1] + STEP * B @ diodes[-1]))
    return np.array(states), np.array(diodes)


def energy(states: np.ndarray) -> np.ndarray:
    """Return the energy [J] of coil and capacitor: it never grows."""
    return 0.5 * (CAPACITOR * states[:, 0] ** 2 + COIL * states[:, 1] ** 2)
