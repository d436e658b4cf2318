"""Seven classes of sparse QPs after the OSQP paper, from 10^3 to 10^6 entries.

Stellato, Banjac, Goulart, Bemporad and Boyd, "OSQP: an operator splitting solver for
quadratic programs", Math. Prog. Comp. 12 (2020) 637-672, appendix A. Matrices "15 %
full" have as many normally distributed entries at random places. Signs and factors of
the paper, with two differences: a constant of the objective is left out, and the
initial state of `control` is shrunk until the states stay inside their bounds without
any input, so that every problem has a solution.

`CLASSES` has a maker of each class and its sizes, one for each number of ENTRIES.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from qpsolvers import Problem

from validation.harness import qps

Rng = np.random.Generator

ENTRIES = (1e3, 1e4, 1e5, 1e6)
"""What P, G and A of the four sizes of a class have together, to within a quarter."""

DENSITY = 0.15  # part of the entries of a random matrix that are not zero
SHIFT = 1e-2  # on the diagonal of a random P
POINTS = 100  # data points for each feature; assets for each factor
STAGES = 10  # time steps of `control`


class Class(NamedTuple):
    """make(rng, size): variables, factors (portfolio), features or states (control)."""

    make: Callable[[Rng, int], Problem]
    sizes: tuple[int, ...]


def normal(rng: Rng, rows: int, columns: int, density: float = DENSITY) -> Any:
    draw = {"rng": rng, "data_sampler": rng.standard_normal}
    return sp.random_array((rows, columns), density=density, **draw)


def posed(P: Any, q: np.ndarray, **constraints: Any) -> Problem:
    return qps.sparse(Problem(P, q, **constraints))


def definite(rng: Rng, n: int) -> Any:
    M = sp.csr_array(normal(rng, n, n))
    return M @ M.T + SHIFT * sp.eye_array(n)


def random_qp(rng: Rng, n: int) -> Problem:
    P, q = definite(rng, n), rng.standard_normal(n)
    C = normal(rng, 10 * n, n)
    lower, upper = -rng.random(10 * n), rng.random(10 * n)
    return posed(P, q, G=sp.vstack((C, -C)), h=np.append(upper, -lower))


def equality_qp(rng: Rng, n: int) -> Problem:
    P, q = definite(rng, n), rng.standard_normal(n)
    return posed(P, q, A=normal(rng, n // 2, n), b=rng.standard_normal(n // 2))


def portfolio(rng: Rng, factors: int) -> Problem:
    """Return a long-only portfolio: covariance F F' + D, risk aversion 1.

    min 1/2 x'Dx + 1/2 y'y - 1/2 mu'x subject to y = F'x, sum x = 1, x >= 0.
    """
    n = POINTS * factors
    F = normal(rng, n, factors, 0.5)
    D = rng.uniform(0.0, np.sqrt(factors), n)
    q = np.append(-0.5 * rng.standard_normal(n), np.zeros(factors))
    P = sp.diags_array(np.append(D, np.ones(factors)))
    total = sp.csr_array(np.append(np.ones(n), np.zeros(factors))[None])
    A = sp.vstack((total, sp.hstack((F.T, -sp.eye_array(factors)))))
    lb = np.append(np.zeros(n), np.full(factors, -np.inf))
    return posed(P, q, A=A, b=np.append(1.0, np.zeros(factors)), lb=lb)


def lasso(rng: Rng, n: int) -> Problem:
    """Return least squares with an l1 penalty, variables (x, y, t).

    min 1/2 y'y + lambda sum t subject to y = Cx - d, -t <= x <= t, with half of the
    true x zero and lambda = 1/5 of the least one at which x = 0.
    """
    m = POINTS * n
    C = sp.csr_array(normal(rng, m, n))
    truth = np.where(rng.random(n) < 0.5, 0.0, rng.normal(0.0, 1.0 / np.sqrt(n), n))
    d = C @ truth + rng.standard_normal(m)
    weight = np.abs(C.T @ d).max() / 5.0
    zero, eye = sp.csr_array((n, m)), sp.eye_array(n)
    G = sp.block_array([[eye, zero, -eye], [-eye, zero, -eye]])
    A = sp.hstack((C, -sp.eye_array(m), sp.csr_array((m, n))))
    P = sp.diags_array(np.concatenate((np.zeros(n), np.ones(m), np.zeros(n))))
    q = np.append(np.zeros(n + m), np.full(n, weight))
    return posed(P, q, G=G, h=np.zeros(2 * n), A=A, b=d)


def svm(rng: Rng, n: int) -> Problem:
    """Return a support vector machine with hinge loss, variables (x, t).

    min 1/2 x'x + sum t subject to t >= diag(s) C x + 1, t >= 0, where the entries of C
    are normal with variance 1/n around s_i / n for the labels s_i = 1, then -1.
    """
    m = POINTS * n
    label = np.repeat([1.0, -1.0], m // 2)
    C = sp.coo_array(normal(rng, m, n))
    C.data = C.data / np.sqrt(n) + label[C.coords[0]] / n
    G = sp.hstack((sp.diags_array(label) @ C, -sp.eye_array(m)))
    P = sp.diags_array(np.append(np.ones(n), np.zeros(m)))
    q = np.append(np.zeros(n), np.ones(m))
    lb = np.append(np.full(n, -np.inf), np.zeros(m))
    return posed(P, q, G=G, h=np.full(m, -1.0), lb=lb)


def huber(rng: Rng, n: int) -> Problem:
    """Return robust regression with Huber's loss of threshold 1.

    Variables (x, u, r, s): min u'u + 2 sum (r + s) subject to Cx - d - u = r - s,
    r >= 0, s >= 0. One point in twenty has an error in [0, 10], the others a normal one
    of deviation 1/2.
    """
    m = POINTS * n
    C = sp.csr_array(normal(rng, m, n))
    outlier = rng.random(m) < 0.05
    error = np.where(outlier, rng.uniform(0.0, 10.0, m), rng.normal(0.0, 0.5, m))
    d = C @ rng.normal(0.0, 1.0 / np.sqrt(n), n) + error
    eye = sp.eye_array(m)
    P = sp.diags_array(np.concatenate((np.zeros(n), np.full(m, 2.0), np.zeros(2 * m))))
    q = np.append(np.zeros(n + m), np.full(2 * m, 2.0))
    lb = np.append(np.full(n + m, -np.inf), np.zeros(2 * m))
    return posed(P, q, A=sp.hstack((C, -eye, -eye, eye)), b=d, lb=lb)


def control(rng: Rng, n: int) -> Problem:
    """Return linear control with n states and n / 2 inputs over STAGES steps.

    min x_T'Q_T x_T + sum (x_t'Q x_t + u_t'R u_t) subject to x_{t+1} = F x_t + B u_t,
    x_0 given and bounds on all; Q has 30 % zeros, Q_T solves the Riccati equation.
    Variables (x_0, ..., x_T, u_0, ..., u_{T-1}).
    """
    inputs = n // 2
    values, vectors = np.linalg.eig(np.eye(n) + 0.1 * rng.standard_normal((n, n)))
    values /= np.maximum(np.abs(values) + SHIFT, 1.0)  # stable, if only just
    F = np.linalg.solve(vectors.T, (vectors * values).T).T.real
    B = rng.standard_normal((n, inputs))
    cost = np.where(rng.random(n) < 0.7, rng.uniform(0.0, 10.0, n), 0.0)
    last = scipy.linalg.solve_discrete_are(F, B, np.diag(cost), 0.1 * np.eye(inputs))
    last = 0.5 * (last + last.T)
    state, force = rng.uniform(1.0, 2.0, n), rng.uniform(0.0, 0.1, inputs)
    start = rng.uniform(-0.5, 0.5, n) * state
    x, largest = start, 1.0
    for _ in range(STAGES):
        x = F @ x
        largest = max(largest, np.max(np.abs(x) / state))
    steps = sp.eye_array(STAGES)
    weights = np.tile(cost, STAGES), np.full(STAGES * inputs, 0.1)
    P = sp.block_diag((sp.diags_array(weights[0]), last, sp.diags_array(weights[1])))
    before = sp.kron(sp.eye_array(STAGES + 1, k=-1), F, "csr")
    moved = sp.vstack((sp.csr_array((n, STAGES * inputs)), sp.kron(steps, B)))
    A = sp.hstack((before - sp.eye_array((STAGES + 1) * n), moved))
    b = np.append(-start / largest, np.zeros(STAGES * n))
    bound = np.append(np.tile(state, STAGES + 1), np.tile(force, STAGES))
    return posed(2.0 * P, np.zeros(bound.size), A=A, b=b, lb=-bound, ub=bound)


CLASSES = {
    "random": Class(random_qp, (18, 52, 160, 500)),
    "equality": Class(equality_qp, (40, 100, 305, 965)),
    "portfolio": Class(portfolio, (3, 12, 43, 139)),
    "lasso": Class(lasso, (4, 20, 75, 250)),
    "SVM": Class(svm, (6, 22, 78, 255)),
    "Huber": Class(huber, (2, 15, 70, 245)),
    "control": Class(control, (8, 24, 78, 250)),
}


def generate(name: str, size: int | str) -> Problem:
    """Return the problem of a class and size, the same in every run."""
    size = int(size)
    return CLASSES[name].make(np.random.default_rng([*name.encode(), size]), size)


def entries(problem: Problem) -> int:
    matrices = problem.P, problem.G, problem.A
    return sum(int(M.nnz) for M in matrices if M is not None)
