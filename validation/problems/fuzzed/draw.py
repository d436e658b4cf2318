"""Random numbers and sizes of one problem of the campaign, and the matrices they make.

A problem is of whole numbers (ties and degeneracy are exact there, and it can be passed
as integers) or of normal ones, with a share of zeros.
"""

import numpy as np

MOST_VARIABLES, MOST_ROWS = 60, 120
WHOLE = 0.35  # share of the problems that have whole numbers alone
DENSITIES = (1.0, 1.0, 0.5, 0.2, 0.08)


def symmetric(M: np.ndarray) -> np.ndarray:
    return (M + M.T) / 2.0


class Draw:
    """The random numbers of one problem, all of them from `rng`."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.whole = bool(rng.random() < WHOLE)
        self.density = float(rng.choice(DENSITIES))

    def size(self, least: int, most: int) -> int:
        """Return a size in [least, most], small ones more often: log-uniform."""
        u = self.rng.uniform(np.log(least + 1.0), np.log(most + 2.0))
        return min(int(np.exp(u)) - 1, most)

    def sizes(self) -> tuple[int, int, int]:
        """Return n >= 1, the number of inequalities and that of equalities."""
        n = self.size(1, MOST_VARIABLES)
        p = self.size(0, n) if self.chance(0.6) else 0
        m = self.size(0, MOST_ROWS) if self.chance(0.8) else 0
        return n, m, p

    def chance(self, share: float) -> bool:
        return bool(self.rng.random() < share)

    def some(self, n: int, share: float) -> np.ndarray:
        """Return n flags, that share of them set."""
        return self.rng.random(n) < share

    def one_of(self, *values: float) -> float:
        return float(self.rng.choice(values))

    def power(self, low: float, high: float, n: int | None = None) -> np.ndarray:
        """Return 10^U(low, high), n of them or one."""
        return np.asarray(10.0 ** self.rng.uniform(low, high, n))

    def numbers(self, *shape: int) -> np.ndarray:
        """Return whole numbers from -3 to 3, or normal ones."""
        if self.whole:
            return self.rng.integers(-3, 4, shape).astype(float)
        return self.rng.standard_normal(shape)

    def positive(self, n: int) -> np.ndarray:
        """Return whole numbers from 1 to 4, or exponential ones above 0.01."""
        if self.whole:
            return self.rng.integers(1, 5, n).astype(float)
        return self.rng.exponential(size=n) + 0.01

    def matrix(self, rows: int, n: int) -> np.ndarray:
        return self.numbers(rows, n) * (self.rng.random((rows, n)) < self.density)

    def definite(self, n: int) -> np.ndarray:
        F = self.matrix(n, n)
        return F @ F.T + np.eye(n)

    def semidefinite(self, n: int) -> np.ndarray:
        """Return F F' of a random rank below n, from 0 on."""
        F = self.matrix(n, int(self.rng.integers(0, max(n, 1))))
        return F @ F.T

    def ill_conditioned(self, n: int, decades: float = 8.0) -> np.ndarray:
        """Return a definite matrix with eigenvalues from 10^-decades to 1."""
        V, _ = np.linalg.qr(self.rng.standard_normal((n, n)))
        values = 10.0 ** -np.linspace(0.0, decades, n)
        return symmetric((V * values) @ V.T)

    def nearly_singular(self, n: int) -> np.ndarray:
        """Return a semidefinite matrix plus 10^U(-12, -6) of its size times I."""
        P = self.semidefinite(n)
        size = max(1.0, np.abs(P).max(initial=0.0))
        return P + self.power(-12, -6) * size * np.eye(n)

    def diagonal(self, n: int) -> np.ndarray:
        """Return a diagonal of positive numbers, a fifth of them zero."""
        return np.diag(self.positive(n) * self.some(n, 0.8))

    def linear(self, n: int) -> np.ndarray:
        return np.zeros((n, n))

    def indefinite(self, n: int) -> np.ndarray:
        """Return a matrix with a curvature of at most -1e-3 of its size; n >= 1."""
        P = self.semidefinite(n)
        d = self.rng.standard_normal(n)
        d /= np.linalg.norm(d)
        depth = max(1.0, np.abs(P).max()) * self.power(-3, 0) + d @ P @ d
        return symmetric(P - depth * np.outer(d, d))

    def any_cost(self, n: int) -> np.ndarray:
        return COSTS[int(self.rng.integers(len(COSTS)))](self, n)


COSTS = (
    Draw.definite, Draw.semidefinite, Draw.semidefinite, Draw.linear,
    Draw.ill_conditioned, Draw.nearly_singular, Draw.diagonal,
)  # fmt: skip
