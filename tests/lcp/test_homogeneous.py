"""Monotone LCPs that are not symmetric: solved, or proved to have no solution."""

import numpy as np
import pytest
from problems_lcp import box_lcp, skew
from scipy import sparse

from namlcp import Status, solve_lcp
from namlcp.lcp.distances import Distances
from namlcp.lcp.pivoting import driver as exact
from namlcp.lcp.pivoting import homogeneous
from namlcp.lcp.pivoting.driver import at_once
from namlcp.lcp.pivoting.homogeneous import (
    Embedded,
    homogeneous_path,
    longest,
    step_from,
)
from namlcp.lcp.scaling import congruent, equilibrating_scale
from namlcp.lcp.shifted import Shifted
from namlcp.limits import Deadline, Limits
from namlcp.residuals import natural_residual
from validation.problems.fuzzed import cases as problems
from validation.stress import campaign_answers as answers
from validation.stress.campaign_judge import judge_lcp

INF = np.inf
MOST = 60
"""Factorisations of an LCP that has to be decided."""


def whole_numbers(seed):
    """Return a small degenerate LCP with x'Ax >= 0, in a box of any kind.

    It is B'B + K - K' and q in whole numbers: rows repeat, tie and contradict.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 9))
    B = rng.integers(-2, 3, (int(rng.integers(0, n + 1)), n)) * (rng.random(n) < 0.6)
    K = rng.integers(-2, 3, (n, n)) * (rng.random((n, n)) < rng.choice([0.2, 0.5, 1.0]))
    lower, upper = np.zeros(n), np.full(n, INF)
    if rng.random() < 0.5:
        kind = rng.integers(0, 6, n)
        lower = rng.integers(-2, 3, n).astype(float)
        upper = lower + rng.integers(0, 3, n)
        upper[kind <= 1], lower[kind == 2] = INF, -INF
        lower[kind == 3], upper[kind == 3] = -INF, INF
    A, q = (B.T @ B + K - K.T).astype(float), rng.integers(-3, 4, n).astype(float)
    return problems.lcps.LCP(A, q, lower, upper)


def program(seed, n, m, kind, free=1.0):
    """Return the LCP of min 1/2 x'Px + q'x, Gx <= h, a share of x free, others >= 0.

    kind: "infeasible" by a combination of rows, "unbounded" along d, or "solvable".
    """
    rng = np.random.default_rng([seed, n])
    is_free = rng.random(n) < free
    B, G, x = (
        rng.standard_normal((n // 2, n)),
        rng.standard_normal((m, n)),
        rng.random(n),
    )
    d = np.abs(rng.standard_normal(n))
    d /= np.linalg.norm(d)
    q = rng.standard_normal(n)
    if kind == "unbounded":
        B -= np.outer(B @ d, d)
        rising = G @ d > 0.0
        G[rising] -= np.outer(G[rising] @ d, d)
        q -= (q @ d + 0.05) * d
    h = G @ x + rng.random(m)
    if kind == "infeasible":
        y = rng.random(m - 1) * (rng.random(m - 1) < 0.3)
        G[-1] = -y @ G[:-1] + rng.random(n) * ~is_free
        h[-1] = -y @ h[:-1] - 0.1 * np.linalg.norm(h)
    elif kind == "solvable":
        active = rng.random(m) < 0.4 * n / m
        h, y = G @ x + ~active * rng.random(m), active * rng.random(m)
        x_is_0 = ~is_free & (rng.random(n) < 0.5)
        h -= G @ (x * x_is_0)
        x[x_is_0] = 0.0
        q = -B.T @ (B @ x) / n - G.T @ y + x_is_0 * rng.random(n)
    A = np.block([[B.T @ B / n, G.T], [-G, np.zeros((m, m))]])
    lower = np.where(np.append(is_free, np.zeros(m)) > 0.0, -INF, 0.0)
    return problems.lcps.LCP(A, np.append(q, h), lower, np.full(n + m, INF))


def chain(n, room):
    """Return a sparse LCP: x_i+1 >= x_i + 1 and x_n <= n - 1 + room; x, y >= 0."""
    G = sparse.diags_array([1.0, -1.0], offsets=[0, 1], shape=(n, n)).tolil()
    h = np.append(-np.ones(n - 1), n - 1 + room)
    A = sparse.block_array([[None, G.T], [-G, None]], format="csr")
    return A, np.append(np.ones(n), h)


def assert_decided(lcp, truth):
    """By the definition, in few factorisations."""
    result = solve_lcp(*lcp)
    answer = answers.lcp_answer(result)
    assert judge_lcp(lcp, truth, answer, answers.NAM_LCP) == ("right", ""), result
    assert truth == "near" or (answer.said == "solved") == (truth == "solvable")
    return result


# ---- whole LCPs


def test_every_lcp_of_whole_numbers_is_decided():
    said = [assert_decided(whole_numbers(seed), "near").status for seed in range(500)]
    assert 80 < said.count(Status.UNSOLVABLE) < 200


@pytest.mark.parametrize("free", [1.0, 0.3, 0.0])
@pytest.mark.parametrize("kind", ["infeasible", "unbounded", "solvable"])
@pytest.mark.parametrize("shape", [(4, 6), (15, 30), (60, 100)])
def test_quadratic_programs(shape, kind, free):
    truth = "solvable" if kind == "solvable" else "unsolvable"
    for seed in range(3):
        result = assert_decided(program(seed, *shape, kind, free), truth)
        assert result.iterations <= MOST


@pytest.mark.parametrize(
    "index",
    [
        *(98, 149, 302, 557, 710, 4790, 5963, 16775, 18611),  # stalled or went round
        *(1678, 43855, 57166, 70069),  # symmetric, nearly singular: rho hid it
    ],
)
def test_unsolvable_ones_of_the_campaign(index):
    case = problems.make(1, index)
    result = assert_decided(case.problem, case.truth)
    assert result.status is Status.UNSOLVABLE
    assert result.iterations <= MOST


@pytest.mark.parametrize(
    "index",
    [
        *(7228, 9319, 40633, 47314, 59860, 66541, 81994, 89848, 92806, 96886),
        *(12839, 96776),  # z = clip(0) solves them, but for rounding
    ],
)
def test_solvable_ones_of_the_campaign(index):
    case = problems.make(1, index)
    assert case.truth == "solvable"
    assert assert_decided(case.problem, "solvable").iterations <= MOST


@pytest.mark.parametrize("n", [40, 400])
def test_sparse_ones_small_and_large(n):
    """Dense LU up to order 600, sparse LU beyond."""
    A, q = chain(n, 0.5)
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.z[:n], np.arange(n), atol=1e-7)
    A, q = chain(n, -0.5)
    result = solve_lcp(A, q)
    assert result.status is Status.UNSOLVABLE
    assert result.iterations <= MOST
    assert result.ray.min() >= 0.0
    assert (A.T @ result.ray).max() <= 1e-10 * result.ray.max()
    assert q @ result.ray == pytest.approx(-1.0)


@pytest.mark.parametrize("tiny", [1e-3, 1e-6])
def test_a_definite_part_leaves_no_proof(tiny):
    """A little more than the unsolvable matrix, and there is a solution far away."""
    for index in (98, 149, 302, 557, 710):
        A, q, lower, upper = problems.make(1, index).problem
        result = solve_lcp(A + tiny * np.eye(q.size), q, lower, upper)
        assert result.ray is None


def test_a_proof_by_the_bounds():
    """q'v = 0, but z_1 = 2 makes w_2 = -6, and z_2 has no upper bound."""
    result = solve_lcp([[0.0, 3.0], [-3.0, 0.0]], [1.0, 0.0], 2.0, [2.0, INF])
    assert result.status is Status.UNSOLVABLE
    np.testing.assert_allclose(result.ray, [0.0, 1.0 / 6.0])


def test_max_iter_of_the_homogeneous_path_is_exact():
    lcp = program(0, 15, 30, "unbounded")
    whole = solve_lcp(*lcp)
    for most in range(1, whole.iterations):
        result = solve_lcp(*lcp, max_iter=most)
        assert (result.status, result.iterations) == (Status.MAX_ITER, most)
    assert solve_lcp(*lcp, max_iter=whole.iterations).status is whole.status


def test_a_limit_after_the_tolerance_is_met_changes_nothing():
    """The path has met it when factorisation 18 ends, and pivoting would go on."""
    result = solve_lcp(*program(0, 15, 30, "solvable", 0.3), max_iter=18)
    assert (result.status, result.iterations) == (Status.SOLVED, 18)


@pytest.mark.parametrize("index", [98, 149, 302, 557, 710])
def test_rounding_of_a_skew_matrix_does_not_hide_that_it_is_monotone(index):
    A, q, lower, upper = problems.make(1, index).problem
    rng = np.random.default_rng(index)
    A = A + 1e-16 * np.abs(A).max() * rng.standard_normal(A.shape)
    assert solve_lcp(A, q, lower, upper).iterations <= MOST


@pytest.mark.parametrize("layout", [np.asarray, sparse.csc_array])
def test_equilibration(layout):
    A = layout(np.array([[0.0, 1e8, 0.0], [-1e8, 1e-6, 0.0], [0.0, 0.0, 0.0]]))
    d = equilibrating_scale(A)
    sums = np.abs(congruent(A, d) @ np.ones(3))
    assert (d > 0.0).all()
    np.testing.assert_allclose(sums[:2], 1.0, rtol=0.5)


class Looks(Deadline):
    """A deadline that is over at the given look."""

    def __init__(self, most):
        super().__init__()
        self.left = most

    def reached(self):
        self.left -= 1
        return self.left < 0


@pytest.mark.parametrize("definite", [False, True])
def test_one_factorisation_between_two_looks_at_the_deadline(definite, monkeypatch):
    """By both paths, for orders where one takes long."""
    steps, follow = [], exact.follow
    monkeypatch.setattr(
        exact,
        "follow",
        lambda *arguments: steps.append(arguments[-1]) or follow(*arguments),
    )
    A, q, lower, upper = program(1, 120, 200, "solvable")
    if definite:
        rng = np.random.default_rng(0)
        A, q = skew(rng, 320, 1.0), rng.standard_normal(320)
        lower = np.zeros(320)
    lcp = box_lcp(A, q, lower, upper, symmetric=False)
    limits = Limits(eps_rel=exact.ACCURACY)
    whole = exact.solve_box(lcp, None, limits)
    assert whole.status is Status.SOLVED
    assert set(steps) <= {1}
    assert (len(steps) > 3) == definite
    for most in (1, 5, 9):
        steps.clear()
        late = exact.solve_box(lcp, None, limits._replace(deadline=Looks(most)))
        assert late.status is Status.TIME_LIMIT
        assert late.iterations + len(steps) <= most + 1
        assert np.isfinite(late.w).all()


def test_small_factorisations_go_by_without_a_look():
    assert [at_once(n) for n in (0, 1, 100, 311, 3000)] == [50, 50, 30, 1, 1]


# ---- the parts


def example(is_skew=False):
    """Return an LCP with a flipped, a free, a boxed and a pinned unknown."""
    rng = np.random.default_rng(3)
    n = 12
    K, B = rng.standard_normal((n, n)), rng.standard_normal((n - 3, n))
    A = K - K.T + (not is_skew) * B.T @ B
    lower, upper = np.zeros(n), np.full(n, INF)
    lower[0], upper[0] = -INF, 2.0
    lower[1] = -INF
    lower[2:5], upper[2:5] = -1.0, [0.5, 1.0, 3.0]
    lower[5] = upper[5] = 0.7
    return A, rng.standard_normal(n), lower, upper


def residuals(model, x):
    """Return what is missing in the three equations of the model, written out."""
    tau, kappa = x.tau[0], x.kappa[0]
    Mp = model.M @ x.p
    rx = Mp + model.c * tau + x.y - x.s
    rt = model.boxed * (model.r * tau - x.p - x.t)
    rk = -x.p @ Mp / tau - model.c @ x.p - model.r @ x.y - kappa
    return rx, rt, rk


@pytest.mark.parametrize("layout", [np.asarray, sparse.csc_array])
def test_a_step_takes_the_same_share_of_all_residuals(layout):
    """It is Newton's: what is linear falls by one factor. So is kappa, for a skew A."""
    A, q, lower, upper = example(is_skew=True)
    model = Distances(layout(A), q, lower, upper, equilibrating_scale)
    system = Shifted(model.M)
    one = np.ones(1)
    on, up = 1.0 * model.signed, 1.0 * model.boxed
    x = Embedded(on, on, up, up, one, one)
    inside = model.signed, model.signed, model.boxed, model.boxed, one > 0, one > 0
    for _ in range(3):
        dx, step = step_from(model, system, x, inside)
        after = Embedded(*(v + step * dv for v, dv in zip(x, dx, strict=True)))
        rx, rt, rk = residuals(model, x)
        there = residuals(model, after)
        share = there[2] / rk
        assert 0.0 <= share < 1.0
        np.testing.assert_allclose(there[0], share * rx, atol=1e-9)
        np.testing.assert_allclose(there[1], share * rt, atol=1e-9)
        assert longest(x, dx, inside) * homogeneous.STEP_PART >= step
        assert min(v[on_].min() for v, on_ in zip(after, inside, strict=True)) > 0.0
        x = after


@pytest.mark.parametrize("layout", [np.asarray, sparse.csc_array])
def test_the_path_leads_to_the_solution(layout):
    A, q, lower, upper = example()
    *_, last = homogeneous_path(layout(A), q, lower, upper)
    w = A @ last.z + q
    assert last.ratio < 1e-6
    assert natural_residual(np.clip(last.z, lower, upper), w, lower, upper) < 1e-8
