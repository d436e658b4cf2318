"""Bimatrix games as LCPs: random ones, whole numbers with ties, and known ones.

Two players with payoffs R and C (p x r) choose rows and columns at random, with
probabilities x and y. In costs r_ij = max R - R_ij + 1 > 0 and likewise c,

    w = [0 r; c' 0] (x, y) - 1 >= 0,   (x, y) >= 0,   (x, y)'w = 0

has the equilibria as its solutions, with x and y divided by their sums.
"""

from pathlib import Path

import numpy as np

from validation.harness import MissingDataError

KNOWN: dict[str, tuple[list[list[float]], list[list[float]], tuple[float, ...]]] = {
    "prisoner's dilemma": ([[3, 0], [5, 1]], [[3, 5], [0, 1]], (0, 1, 0, 1)),
    "matching pennies": ([[1, -1], [-1, 1]], [[-1, 1], [1, -1]], (0.5, 0.5, 0.5, 0.5)),
    "rock, paper, scissors": (
        [[0, -1, 1], [1, 0, -1], [-1, 1, 0]],
        [[0, 1, -1], [-1, 0, 1], [1, -1, 0]],
        (1 / 3, 1 / 3, 1 / 3, 1 / 3, 1 / 3, 1 / 3),
    ),
}
"""Payoffs of both players, and the only equilibrium."""


def costs(R: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return R.max() - R + 1.0, C.max() - C + 1.0


def lcp(R: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    R, C = costs(np.array(R, dtype=float), np.array(C, dtype=float))
    p, r = R.shape
    A = np.block([[np.zeros((p, p)), R], [C.T, np.zeros((r, r))]])
    return A, np.full(p + r, -1.0)


def strategies(z: np.ndarray, p: int) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of a solution z; the first player has p rows."""
    return z[:p] / z[:p].sum(), z[p:] / z[p:].sum()


def regret(R: np.ndarray, C: np.ndarray, x: np.ndarray, y: np.ndarray) -> float:
    """Return what a player gains at most by a change of mind: 0 at an equilibrium."""
    R, C = np.asarray(R), np.asarray(C)
    first = (R @ y).max() - x @ R @ y
    second = (x @ C).max() - x @ C @ y
    return float(max(first, second))


def payoffs(
    rows: int, columns: int, seed: int, whole: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return random payoffs: uniform, or whole numbers from 0 to 4, with many ties."""
    rng = np.random.default_rng(seed)
    shape = 2, rows, columns
    R, C = rng.integers(0, 5, shape).astype(float) if whole else rng.random(shape)
    return R, C


def gambit(data: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return Gambit's games of the data folder: payoffs by name."""
    files = sorted((data / "general").glob("game_*.npz"))
    if not files:
        raise MissingDataError(f"no game_*.npz in {data / 'general'}")
    loaded = {file.stem.removeprefix("game_"): np.load(file) for file in files}
    return {name: (game["R"], game["C"]) for name, game in loaded.items()}
