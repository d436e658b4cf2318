"""method="auto" for matrices that are neither P nor semidefinite."""

import itertools

import numpy as np
import problems_general as problems
import pytest
from lcp_definition import assert_solves_lcp
from problems_lcp import with_solution
from scipy import sparse

from namlcp import Status, solve_lcp
from namlcp.lcp.data import lcp_data
from namlcp.lcp.general import order
from namlcp.lcp.general.farkas import farkas
from namlcp.lcp.general.order import solve_general
from namlcp.lcp.pivoting.rays import proof
from namlcp.lcp.prepared import DENSE_ORDER, Prepared
from namlcp.limits import Deadline, Limits
from validation.problems.general.families import FAMILIES

INF = np.inf
LIMITS = Limits(eps_rel=1e-9)


def lcp_of(A, q, lower=None, upper=None):
    return lcp_data(Prepared(A), np.asarray(q), lower, upper)


# ---- what has a solution


@pytest.mark.parametrize("bodies", [3, 10, 40])
@pytest.mark.parametrize("ratio", [1.0, 1e4])
def test_friction(bodies, ratio):
    for seed, mu in enumerate((0.2, 0.5, 0.9)):
        rng = np.random.default_rng(seed)
        A, q = problems.friction(rng, bodies, mu, ratio)
        result = solve_lcp(A, q)
        assert_solves_lcp(result, A, q)
        assert result.residual < 1e-11 * np.abs(q).max()


@pytest.mark.parametrize(("family", "seed"), [("wall", 5), ("chain", 5), ("pile", 17)])
def test_a_solution_of_lemkes_method_is_finished(family, seed):
    """Nearly singular bases leave up to 1e-8 max |q_i|."""
    A, q = FAMILIES[family](200, seed, 1e4)
    assert solve_lcp(A, q).residual < 1e-10 * np.abs(q).max()


@pytest.mark.parametrize(("bodies", "joints", "motors"), [(4, 2, 2), (30, 10, 10)])
def test_friction_with_joints_and_motors(bodies, joints, motors):
    for seed in range(4):
        rng = np.random.default_rng(seed)
        A, q, lower, upper = problems.machine(rng, bodies, joints, motors)
        assert_solves_lcp(solve_lcp(A, q, lower, upper), A, q, lower, upper)


@pytest.mark.parametrize("generator", [problems.copositive, problems.p0])
@pytest.mark.parametrize("n", [5, 40, 160])
def test_classes(generator, n):
    for seed in range(3):
        A, q = generator(np.random.default_rng(seed), n)
        assert_solves_lcp(solve_lcp(A, q), A, q)


def test_lemke_comes_first_where_the_matrix_is_dense():
    """A path takes several times as long; sparse matrices are left to paths."""
    rng = np.random.default_rng(0)
    A, q = rng.random((300, 300)), rng.standard_normal(300)  # strictly copositive
    outcome = solve_general(lcp_of(A, q), None, LIMITS)
    assert (outcome.status, outcome.method) == (Status.SOLVED, "lemke")
    A, q = problems.friction(rng, 40)
    assert q.size > DENSE_ORDER
    assert solve_general(lcp_of(A, q), None, LIMITS).method == "path"


def test_collections():
    """Siconos' own LCP tests and Gambit's games."""
    found = problems.collection()
    if not found:
        pytest.skip(f"no general LCPs in {problems.DATA}; set NAMLCP_DATA")
    for name, (A, q) in found.items():
        result = solve_lcp(A, q)
        if name == "siconos_lcp_Pang_isolated_sol_perturbed":
            assert result.status is Status.UNSOLVABLE
            np.testing.assert_allclose(result.ray @ q, -1.0)
        else:
            assert_solves_lcp(result, A, q)


@pytest.mark.parametrize("A", [[[0, 1], [1, 0]], [[0, 2, 0], [3, 0, 1], [0, 5, 0]]])
def test_tiny_games(A):
    """Pivoting is stuck there at once: every free system is singular."""
    A = np.array(A, dtype=float)
    assert_solves_lcp(solve_lcp(A, -np.ones(len(A))), A, -np.ones(len(A)))


STAGES = ("by_path", "by_arc", "by_lemke")


@pytest.mark.parametrize("stage", STAGES)
def test_every_stage_alone(stage, monkeypatch):
    monkeypatch.setattr(order, "STAGES", (order.Stage(getattr(order, stage)),))
    A, q = problems.friction(np.random.default_rng(0), 5)
    outcome = solve_general(lcp_of(A, q), None, LIMITS)
    assert outcome.status is Status.SOLVED
    assert outcome.method == stage.removeprefix("by_")


def test_a_start_at_the_solution_takes_one_factorisation():
    """Of a path, which ends inside a face; a vertex of Lemke's may take more."""
    A, q = problems.friction(np.random.default_rng(0), 40)
    z = solve_lcp(A, q).z
    again = solve_lcp(A, q * (1.0 + 1e-6), z0=z)
    assert_solves_lcp(again, A, q * (1.0 + 1e-6))
    assert (again.method, again.iterations) == ("start", 1)


@pytest.mark.parametrize("sizes", [(1e-6, 1.0), (1.0, 1e-150), (1e6, 1e120)])
def test_any_unit(sizes):
    A, q = problems.friction(np.random.default_rng(3), 8)
    A, q = A * sizes[0], q * sizes[1]
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED


def test_mixed_problems_get_an_honest_answer():
    solved = 0
    for seed in range(20):
        A, q, lower, upper = problems.mixed(np.random.default_rng(seed), 15)
        result = solve_lcp(A, q, lower, upper)
        if result.status is Status.SOLVED:
            assert_solves_lcp(result, A, q, lower, upper)
            solved += 1
        else:
            assert result.status is Status.STALLED
    assert solved >= 15


# ---- what has none


def test_farkas_is_the_proof():
    A, q = problems.closing_walls()
    result = solve_lcp(A, q)
    assert result.status is Status.UNSOLVABLE
    v = result.ray
    assert q @ v == pytest.approx(-1.0)
    assert (v >= 0.0).all()
    assert (A.T @ v <= 1e-12 * v.max()).all()


def proved(lcp):
    rays = (proof(lcp, 1.0 / lcp.matrix.root, v) for v in farkas(lcp) if v.any())
    return next((ray for ray in rays if ray is not None), None)


@pytest.mark.parametrize("seed", range(20))
def test_farkas_proves_what_linear_programming_finds(seed):
    """Boxes of all kinds, beside SciPy's linprog."""
    from scipy.optimize import linprog

    rng = np.random.default_rng(seed)
    A, q, lower, upper = problems.mixed(rng, 8)
    q += 3.0 * rng.standard_normal(8)
    low, high = np.isfinite(lower), np.isfinite(upper)
    least, most = ~high, ~low  # rows with w >= 0, with w <= 0
    program = linprog(
        np.zeros(8),
        np.vstack([-A[least], A[most]]),
        np.append(q[least], -q[most]),
        bounds=np.stack([lower, upper], 1),
    )
    assert program.status in (0, 2)
    assert (proved(lcp_of(A, q, lower, upper)) is not None) == (program.status == 2)


def has_solution(A, q):
    """By all faces, with regular ones alone."""
    n = q.size
    for face in itertools.product([False, True], repeat=n):
        F = np.array(face)
        z = np.zeros(n)
        if F.any():
            z[F] = np.linalg.solve(A[np.ix_(F, F)], -q[F])
        if min(z.min(), (A @ z + q)[~F].min(initial=INF)) >= -1e-12:
            return True
    return False


def test_random_matrices_without_any_class():
    """Half of them have no solution; all are decided, and rightly."""
    said = {True: 0, False: 0}
    for seed in range(60):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(2, 6))
        A, q = rng.standard_normal((n, n)), rng.standard_normal(n)
        result, truth = solve_lcp(A, q), has_solution(A, q)
        assert result.status is (Status.SOLVED if truth else Status.UNSOLVABLE)
        assert truth or result.ray is not None or "enumerated" in result.message
        said[truth] += 1
    assert min(said.values()) > 10


def test_solvable_problems_without_any_class_are_not_called_unsolvable():
    """Gaussian matrices with a planted solution: most are out of reach."""
    left = 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        A = rng.standard_normal((30, 30))
        q, _ = with_solution(rng, A)
        result = solve_lcp(A, q)
        if result.status is not Status.SOLVED:
            assert result.status is Status.STALLED
            assert result.message == order.UNDECIDED
            left += 1
    assert left > 0


# ---- limits


@pytest.mark.parametrize("most", [1, 3, 7])
def test_factorisations_are_limited(most):
    A, q = problems.friction(np.random.default_rng(0), 40)
    result = solve_lcp(A, q, max_iter=most)
    assert result.status is Status.MAX_ITER
    assert result.iterations == most
    assert np.isfinite(result.z).all()


class Looks(Deadline):
    """A deadline that is over at the given look."""

    def __init__(self, most):
        super().__init__()
        self.left = most

    def reached(self):
        self.left -= 1
        return self.left < 0


@pytest.mark.parametrize("most", [1, 5, 9])
def test_the_deadline_is_looked_at_between_factorisations(most):
    A, q = problems.friction(np.random.default_rng(0), 40)
    outcome = solve_general(lcp_of(A, q), None, LIMITS._replace(deadline=Looks(most)))
    assert outcome.status is Status.TIME_LIMIT
    assert outcome.iterations <= most


def test_history():
    A, q = problems.friction(np.random.default_rng(0), 40)
    result = solve_lcp(A, q, history=True)
    assert len(result.history) >= result.iterations
    assert result.history["residual"][-1] == pytest.approx(result.residual)


def test_an_accuracy_beyond_rounding_stalls_soon():
    A, q = problems.friction(np.random.default_rng(0), 40)
    whole = solve_lcp(A, q)
    result = solve_lcp(A, q, eps_abs=1e-40)
    assert result.status is Status.STALLED
    assert result.iterations <= whole.iterations + 10
    assert result.residual < 1e-12


@pytest.mark.parametrize("layout", [np.asarray, sparse.csr_array])
def test_which_matrices_are_general(layout):
    def is_general(A):
        return Prepared(layout(np.array(A, dtype=float))).is_general

    assert not is_general([[1, 5], [0, 1]])
    assert not is_general([[0, -1], [1, 0]])  # skew-symmetric
    assert not is_general([[0, 0], [0, 1]])
    assert is_general([[0, 1], [1, 0]])
    assert is_general([[1, 0], [0, -1]])
    assert not is_general(np.zeros((0, 0)))
