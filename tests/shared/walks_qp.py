"""QPs that come in sequences: families of matrices, and random steps from each."""

import numpy as np

INF = np.inf


def random_matrices(rng, n, m, p, density=1.0):
    """A definite P."""

    def some(rows):
        return rng.standard_normal((rows, n)) * (rng.random((rows, n)) < density)

    B = some(n)
    return B.T @ B / n + np.eye(n), some(m), some(p)


def flat_matrices(rng, *sizes):
    """P is zero for the last half of the variables."""
    P, G, A = random_matrices(rng, *sizes)
    half = len(P) // 2
    P[half:] = P[:, half:] = 0.0
    return P, G, A


def definite_on_equations(rng, n, m, p):
    """P is singular, but not where A x = 0; rows of A differ in length."""
    root = rng.standard_normal((n, n - p // 2))
    A = 10.0 ** rng.uniform(-1, 1, (p, 1)) * rng.standard_normal((p, n))
    return root @ root.T, rng.standard_normal((m, n)), A


def portfolio(rng, n, factors):
    """A few factors, and a risk of each; the sum is given."""
    loads = rng.standard_normal((n, factors))
    risk = np.diag(rng.uniform(0.5, 2.0, n))
    return loads @ loads.T / n + risk, rng.standard_normal((4, n)), np.ones((1, n))


def sparse_portfolio(rng, n, factors):
    """The factors are variables: A = [loads, -I; 1, 0]."""
    loads = rng.standard_normal((factors, n)) * (rng.random((factors, n)) < 0.3)
    A = np.block([[loads, -np.eye(factors)], [np.ones(n), np.zeros(factors)]])
    P = np.diag(np.append(rng.uniform(0.5, 2.0, n), np.ones(factors)))
    return P, np.eye(4, n + factors), A


def control(rng, stages):
    """x_0, ..., x_N, u_0, ..., u_{N-1}; the weights of some states are zero."""
    nx, nu = 3, 2
    F = 0.9 * np.eye(nx) + 0.1 * rng.standard_normal((nx, nx))
    past = np.eye(stages + 1, k=-1)
    inputs = np.kron(past[:, :stages], rng.standard_normal((nx, nu)))
    A = np.hstack((np.kron(past, F) - np.eye(nx * (stages + 1)), inputs))
    weights = np.where(np.arange(nx * (stages + 1)) % nx == 0, 0.0, 1.0)
    P = np.diag(np.append(weights, np.full(nu * stages, 0.1)))
    G = np.eye(2 * stages, len(P)) + (rng.random((2 * stages, len(P))) < 3 / len(P))
    return P, G, A


def heap(rng, n):
    """A definite P with few entries, rows G, no equations."""
    root = rng.standard_normal((n, n)) * (rng.random((n, n)) < 1.0 / n)
    G = rng.random((2 * n, n)) * (rng.random((2 * n, n)) < 2.0 / n) - np.eye(2 * n, n)
    P = np.diag(rng.uniform(0.1, 10.0, n)) + root @ root.T
    return P, G, np.empty((0, n))


def lasso(rng, m, n):
    """|r|^2 with r = X w - y, -t <= w <= t, for (r, w, t): P is singular."""
    X, I, none = rng.standard_normal((m, n)), np.eye(n), np.zeros((n, m))
    A = np.hstack((np.eye(m), -X, np.zeros((m, n))))
    G = np.block([[none, I, -I], [none, -I, -I]])
    return np.diag(np.append(np.full(m, 2.0), np.zeros(2 * n))), G, A


def store(rng, n):
    """Buy, sell and store: P is zero for most variables."""
    I = np.eye(n)
    P = np.diag(np.where(rng.random(3 * n) < 0.3, 1.0, 0.0))
    return P, np.hstack((I, I, 0.0 * I)), np.hstack((-I, I, I - np.eye(n, k=-1)))


FAMILIES = {
    "one variable": (random_matrices, (1, 2, 0)),
    "small": (random_matrices, (3, 5, 1)),
    "half full": (random_matrices, (6, 12, 2, 0.5)),
    "no equations": (random_matrices, (12, 8, 0, 0.4)),
    "large": (random_matrices, (20, 30, 5, 0.2)),
    "flat and small": (flat_matrices, (3, 5, 1)),
    "flat": (flat_matrices, (12, 8, 0, 0.4)),
    "flat and large": (flat_matrices, (20, 30, 5, 0.2)),
    "definite where A x = 0": (definite_on_equations, (12, 12, 3)),
    "portfolio": (portfolio, (60, 5)),
    "portfolio with factors": (sparse_portfolio, (60, 5)),
    "control": (control, (8,)),
    "heap": (heap, (30,)),
    "lasso": (lasso, (8, 5)),
    "wide lasso": (lasso, (6, 15)),
    "long lasso": (lasso, (30, 40)),
    "store": (store, (10,)),
}
NARROW = {"portfolio", "portfolio with factors"}  # most variables end at bounds


class Walk:
    """A QP that changes at random, as keyword arguments; `point` is feasible."""

    def __init__(self, name, seed):
        self.rng = np.random.default_rng(seed)
        make, sizes = FAMILIES[name]
        P, G, A = make(self.rng, *sizes)
        n = len(P)
        if len(G) > 1:  # so that it may become -G[0]
            G[1] = G[0] * self.rng.uniform(0.5, 1.0, n)
        self.width = 0.3 if name in NARROW else 1.0
        self.point = self.rng.standard_normal(n)
        self.first = {"P": P, "G": G, "A": A}
        self.data = {**self.first, "q": self.noise(n, 3.0), **self.wide()}
        self.start = dict(self.data)

    def noise(self, size, scale=0.3):
        return scale * self.rng.standard_normal(size)

    def bounds(self, room):
        return {"lb": self.point - room[0], "ub": self.point + room[1]}

    def wide(self):
        """The point is well inside."""
        room = self.width * self.rng.uniform(0.5, 1.0, (2, self.point.size))
        h = self.first["G"] @ self.point + self.rng.random(len(self.first["G"]))
        return {"h": h, "b": self.first["A"] @ self.point, **self.bounds(room)}

    def step(self):
        """Return the changes of one step, by name; most steps change q alone."""
        kinds = sorted(name for name in dir(self) if name.startswith("change_"))
        kind = self.rng.choice([*kinds, "change_q", "back", "back"])
        changes = getattr(self, kind)()
        self.data.update(changes)
        return changes

    def back(self):
        """Near the first problem."""
        return {**self.start, "q": self.start["q"] + self.noise(self.point.size, 0.05)}

    def change_q(self):
        return {"q": self.data["q"] + self.noise(self.point.size)}

    def change_q_wholly(self):
        return {"q": self.noise(self.point.size, 3.0)}

    def change_all_vectors(self):
        """Move the feasible point, and what belongs to it."""
        self.point = self.point + self.noise(self.point.size)
        slack = self.rng.choice([0.0, 0.2, 1.0], self.data["h"].size)
        room = self.rng.choice([0.0, 0.5, INF], (2, self.point.size))
        h, b = self.data["G"] @ self.point + slack, self.data["A"] @ self.point
        return {**self.change_q(), "h": h, "b": b, **self.bounds(room)}

    def change_sides(self):
        """Some rows and bounds vanish, others appear."""
        size = self.data["h"].size
        h = self.data["G"] @ self.point + self.rng.choice([0.1, 1.0, INF, 1e25], size)
        room = self.rng.choice([0.0, 0.1, 2.0, INF], (2, self.point.size))
        return {"h": h, **self.bounds(room)}

    def change_fixed(self):
        """Some variables are fixed: lb = ub."""
        room = self.rng.choice([0.0, 2.0], (1, self.point.size))
        return self.bounds(room * [[1], [1]])

    def change_to_infeasible(self):
        i = self.rng.integers(self.point.size)
        lb, ub = np.full((2, self.point.size), INF) * [[-1], [1]]
        lb[i], ub[i] = self.point[i] + 1.0, self.point[i] - 1.0
        return {"lb": lb, "ub": ub}

    def change_to_contradiction(self):
        """Two rows of G contradict each other, or no longer."""
        G, h = self.data["G"].copy(), self.data["h"].copy()
        G[1], h[1] = -G[0], -(G[0] @ self.point) - 1.0
        h[0] = G[0] @ self.point
        if self.rng.random() < 0.5:
            G[1] = self.first["G"][1]
            h[1] = G[1] @ self.point
        return {"G": G, "h": h}

    def change_to_singular(self):
        """P gets a null space; often the QP becomes unbounded."""
        P = self.first["P"].copy()
        keep = self.rng.random(self.point.size) < 0.5
        P[~keep] = P[:, ~keep] = 0.0
        return {"P": P}

    def change_to_flat(self):
        """No P, no bounds and no rows: unbounded."""
        n, m = self.point.size, self.data["h"].size
        infinite = np.full(n, INF)
        return {"P": np.zeros((n, n)), "h": np.full(m, INF), "lb": -infinite,
                "ub": infinite}  # fmt: skip

    def change_P(self):
        return {"P": self.first["P"] * self.rng.uniform(0.5, 2.0)}

    def change_G(self):
        G = self.first["G"] * self.rng.uniform(0.8, 1.2, self.first["G"].shape)
        G[self.rng.random(G.shape) < 0.1] = 0.0
        return {"G": G, "h": G @ self.point + self.rng.random(G.shape[0])}

    def change_A(self):
        A = self.first["A"] * self.rng.uniform(0.8, 1.2, self.first["A"].shape)
        return {"A": A, "b": A @ self.point}
