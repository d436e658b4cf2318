"""At the edge of feasibility: rounding errors, margins, rays, second tries."""

import numpy as np
import pytest
from problems_qp import (
    assert_certificate,
    assert_solves_qp,
    complementary,
    infeasible,
    make_qp,
)
from problems_qp import (
    solve_sparse as solve,
)
from scipy.sparse import diags_array

import namlcp
from namlcp.limits import Limits
from namlcp.qp.certificates import accept_dual, accept_primal, farkas_numbers
from namlcp.qp.guess import Guess
from namlcp.qp.judge import Judge
from namlcp.qp.path.advance import ACTIVE_SET, EVALUATE
from namlcp.qp.path.candidates import CertificateSearch
from namlcp.qp.path.loop import PATIENCE
from namlcp.qp.path.workspace import Workspace
from namlcp.qp.transforms.presolve import presolve
from namlcp.qp.transforms.scaling import ScaledQP
from namlcp.status import Status

TOL = 1e-6
LOOSE = Limits(eps_abs=TOL, eps_rel=0.0)


def with_sums(seed, n, m, p, rank, off):
    """Add sums of two equations, off by +-off: dependent rows, not proportional."""
    P, q, G, h, A, b, lb, ub = complementary(seed, n, m, p, rank).qp
    A = A.toarray()
    A = np.vstack((A, A[0] + A[1], A[1] + A[2]))
    b = np.concatenate((b, [b[0] + b[1] + off, b[1] + b[2] - off]))
    return make_qp(P, q, G, h, A, b, lb, ub)


SHAPES = [(20, 30, 5, 7), (30, 60, 6, 0), (60, 80, 10, 20), (40, 0, 10, 10)]


@pytest.mark.parametrize("off", [1e-8, 1e-7])
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", range(2))
def test_rows_contradicting_within_the_tolerance_are_solved(seed, shape, off):
    qp = with_sums(seed, *shape, off)
    assert_solves_qp(qp, solve(qp, LOOSE), TOL)


def test_a_second_try_follows_the_first():
    qp = with_sums(0, *SHAPES[2], 1e-7)
    result = solve(qp, LOOSE)
    assert PATIENCE < result.iterations < 2 * PATIENCE
    assert_solves_qp(qp, result, TOL)
    short = solve(qp, Limits(TOL, 0.0, max_iter=PATIENCE))
    assert short.status is Status.MAX_ITER


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("off", [1e-5, 1e-3])
def test_rows_contradicting_beyond_the_tolerance_are_proved(shape, off):
    qp = with_sums(0, *shape, off)
    assert_certificate(qp, solve(qp, LOOSE))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_repeated_equations_are_merged_within_the_tolerance(sign):
    P, q, G, h, A, b, lb, ub = complementary(0, 20, 10, 4, 7).qp
    A = np.vstack((A.toarray(), sign * A.toarray()[2]))
    for off, count in ((0.5e-6, 0), (1e-4, 1)):
        qp = make_qp(P, q, G, h, A, np.append(b, sign * (b[2] + off)), lb, ub)
        small = presolve(qp, TOL, 0.0)
        assert small.b.size == 4
        assert small.b[2] == pytest.approx(b[2] + 0.5 * off, abs=1e-12)
        assert len(small.contradictions) == count
        result = solve(qp, LOOSE)
        if count == 0:
            assert_solves_qp(qp, result, TOL)
        else:
            assert result.iterations == 0
            assert result.message == "rows 4 and 2 of A contradict each other"
            assert_certificate(qp, result)


def test_rows_give_way_to_a_point_that_violates_them():
    qp = complementary(1, 8, 6, 3, 8).qp
    s = ScaledQP(presolve(qp, TOL, 0.0))
    t = np.random.default_rng(0).standard_normal(s.kkt.size)
    c, b = s.c.copy(), s.b.copy()
    s.relax(t)
    row = s.place >= s.n + s.p
    excess = s.sign * t[s.place]
    np.testing.assert_array_equal(s.b, t[s.n : s.n + s.p])
    np.testing.assert_array_equal(s.c[~row], c[~row])
    np.testing.assert_array_equal(s.c[row], np.maximum(c, excess)[row])
    again = ScaledQP(s.small, s)  # the next problem starts from the user's sides
    np.testing.assert_array_equal(again.b, b)
    np.testing.assert_array_equal(again.c, c)


@pytest.mark.parametrize("seed", range(3))
def test_projection_makes_a_proof_of_inexact_multipliers(seed):
    qp = infeasible(seed, 10, 20, 3, 4)
    found = solve(qp, LOOSE)
    rng = np.random.default_rng(seed)
    y = found.y * (1.0 + 1e-5 * rng.standard_normal(3))
    z = found.z * (1.0 + 1e-5 * rng.standard_normal(20))
    x = np.zeros(10)
    assert accept_primal(qp, x, y, z, TOL) is None
    work = Workspace(ScaledQP(presolve(qp, TOL, 0.0)), LOOSE)
    tests = CertificateSearch(work, Judge(qp, LOOSE))
    z_box = -(qp.G.T @ z + qp.A.T @ y)
    guess = Guess(x, y, z, z_box, np.zeros(20 + 2 * 10, dtype=np.int8))
    _, y, Z, _ = work.problem.guess(guess)
    proof = tests.farkas_proof(x, *tests.project_multipliers(y, Z)[0])
    assert proof is not None
    assert_certificate(qp, found._replace(y=proof[1], z=proof[2], z_box=proof[3]))


def test_rays_stand_still_at_bounds_on_both_sides():
    """The finite sides outnumber the rows and columns of K."""
    rng = np.random.default_rng(0)
    n, box = 40, np.repeat([1.0, np.inf], [39, 1])
    d = np.append(rng.standard_normal(n - 1), 30.0)
    qp = make_qp(np.diag(1.0 - np.isinf(box)), -d, lb=-box, ub=box)
    for _ in range(20):
        used = [rng.standard_normal(rng.integers(20, 100)) for _ in range(99)]
        del used  # what lies behind arrays in memory is not 0 now
        work = Workspace(ScaledQP(presolve(qp, TOL, 0.0)), LOOSE)
        for (ray,) in CertificateSearch(work, Judge(qp, LOOSE)).project_ray(d):
            assert ray[:-1] == pytest.approx(0.0, abs=1e-30)
            assert ray[-1] == pytest.approx(1.0)


@pytest.mark.parametrize("seed", range(3))
def test_rays_along_half_open_bounds_are_proved(seed):
    """P d = 0, A d = 0, half of G d = 0; bounds are open where d goes, nowhere else."""
    rng = np.random.default_rng(seed)
    n, m, p = 50, 100, 10
    d = rng.standard_normal(n)
    d /= np.linalg.norm(d)

    def across(M):
        return M - np.outer(M @ d, d)

    B, A = across(rng.standard_normal((25, n))), across(rng.standard_normal((p, n)))
    G = rng.standard_normal((m, n))
    G = np.where((G @ d > 0.0)[:, None], across(G), G)
    x, q = rng.standard_normal(n), 10.0 * rng.standard_normal(n)
    q -= (q @ d + 1.0) * d
    lb = np.where(d < 0.0, -np.inf, x - rng.random(n))
    ub = np.where(d > 0.0, np.inf, x + rng.random(n))
    qp = make_qp(B.T @ B, q, G, G @ x + rng.random(m), A, A @ x, lb, ub)
    result = solve(qp, LOOSE)
    assert result.status is Status.DUAL_INFEASIBLE
    assert result.iterations < 30
    assert_certificate(qp, result)


def test_a_refinement_waits_for_a_steady_set_and_for_progress():
    """x <= 0 and -x <= 0; the residual of stationarity sets the pace."""
    qp = make_qp([[0.0]], [0.0], [[1.0], [-1.0]], [0.0, 0.0])
    work = Workspace(ScaledQP(presolve(qp, TOL, 0.0)), LOOSE)
    now = work.now
    now.tol, now.drop, now.last_refined, now.best = TOL, 0.1, np.inf, np.inf
    now.reports, now.patience, now.max_iter = True, 99, 99

    def is_due(worst, active):
        q = np.array([worst * TOL])
        now.q = q.ctypes.data
        work.W[:], work.Z[:] = 1.0, np.where(active, 2.0, 0.5)
        q -= (work.problem.sign * work.Z).sum()
        work.run(EVALUATE)
        assert now.worst == pytest.approx(worst)
        return bool(now.wants & ACTIVE_SET)

    one, both = np.array([True, False]), np.array([True, True])
    assert not is_due(1e5, one)  # far away
    assert not is_due(1e3, both)  # the set changes
    assert is_due(1e3, both)
    assert not is_due(5e2, both)  # not ten times better
    assert is_due(50.0, one)  # near enough for any set


def test_the_threshold_of_convexity_is_named():
    """Eigenvalues of the unit-diagonal P: -1.4e-6 is refused, -0.7e-6 is not."""
    ones = np.ones((4, 4)) / 3.0
    for wrong, refused in ((1.4e-6, True), (0.7e-6, False)):
        P = (4.0 / 3.0 + wrong / 3.0) * np.eye(4) - (1.0 + wrong) * ones
        P = 1e3 * P / P[0, 0]
        box = {"lb": -np.ones(4), "ub": np.ones(4)}
        if refused:
            with pytest.raises(
                ValueError, match="diagonal scaled to 1 is below -1e-06"
            ):
                namlcp.solve_qp(P, np.ones(4), **box)
        else:
            assert namlcp.solve_qp(P, np.ones(4), **box).status is Status.SOLVED


def test_a_column_of_tiny_entries_proves_nothing():
    """1e-13 x <= -1 holds far out; x <= 1 with -x <= -2 holds nowhere."""
    one = np.ones(1)
    qp = make_qp([[0.0]], [0.0], [[-1e-13]], [-1.0])
    assert accept_primal(qp, np.zeros(1), np.empty(0), one, TOL) is None
    qp = make_qp([[0.0]], [0.0], [[1e-13], [-1e-13]], [1e-3, -2e-3])
    assert accept_primal(qp, np.zeros(1), np.empty(0), np.ones(2), TOL) is not None


@pytest.mark.parametrize("unit", [1.0, 1e4, 1e-4])
def test_a_variable_that_counts_in_large_units_is_no_ray(unit):
    """The least cost is at x = (-0.01, 0.6, 2, 8545), times the unit."""
    curvature = np.array([1.5e4, 0.0735, 0.0, 9.16e-9])
    q = np.array([276.0, 0.0904, -0.0596, -7.827e-5])
    lb, ub = np.array([-0.01, 0.6, -np.inf, -np.inf]), np.array([0.0, 9.0, 2.0, np.inf])
    result = namlcp.solve_qp(
        np.diag(curvature / unit**2), q / unit, lb=lb * unit, ub=ub * unit
    )
    assert result.status is Status.SOLVED
    x = np.array([-0.01, 0.6, 2.0, 7.827e-5 / 9.16e-9])
    np.testing.assert_allclose(result.x, x * unit, rtol=1e-9)


def test_the_difference_of_rows_alike_is_no_proof():
    """x = 1 and (1 + d) x = 1 + d hold together; so, along a row, no cost can fall.

    d is so small that a residual of this size counts as mere rounding.
    """
    d = 2.0**-40
    a, multipliers = np.array([1.0, 1.0 + d]), np.array([1.0, -1.0]) / d
    tol, none, one = 1e-14, np.empty(0), np.ones(1)
    point = make_qp([[0.0]], [0.0], A=a[:, None], b=a)
    assert accept_primal(point, one, multipliers, none, tol) is None
    row = make_qp(np.zeros((2, 2)), a, A=a[None], b=[0.0])
    start = np.ones(2), np.zeros(1), none
    assert accept_dual(row, *start, multipliers, tol) is None
    apart = make_qp([[0.0]], [0.0], A=np.ones((2, 1)), b=a)
    assert accept_primal(apart, one, multipliers, none, tol) is not None


@pytest.mark.parametrize("unit", [1e-8, 1e8])
@pytest.mark.parametrize("seed", range(10))
def test_feasible_problems_in_odd_units_are_not_called_infeasible(seed, unit):
    qp = complementary(seed, 8, 10, 2, 3, 0.6).qp
    D = np.where(np.random.default_rng(seed).random(8) < 0.5, unit, 1.0)
    P, q, G, h, A, b, lb, ub = qp
    d = diags_array(D)
    result = namlcp.solve_qp(
        d @ P @ d, D * q, G @ d, h, A @ d, b, lb / D, ub / D, eps_abs=TOL, eps_rel=TOL
    )
    assert result.status not in (Status.PRIMAL_INFEASIBLE, Status.DUAL_INFEASIBLE)


@pytest.mark.parametrize("seed", range(6))
def test_numbers_of_a_certificate_are_those_of_their_definition(seed):
    rng = np.random.default_rng(seed)
    n, m, p = 7, 6, 3
    b, h, y, s = (rng.standard_normal(k) for k in (p, m, p, n))
    lb = np.where(rng.random(n) < 0.5, -np.inf, -rng.random(n))
    ub = np.where(rng.random(n) < 0.5, np.inf, rng.random(n))
    h[rng.random(m) < 0.3] = np.inf
    s[rng.random(n) < 0.3] = 0.0
    kept, z_box = np.maximum(rng.standard_normal(m), 0.0), np.empty(n)
    kept[np.isinf(h)] = 0.0
    found = farkas_numbers((b, h, lb, ub), y, kept, s, z_box)
    allowed = np.where(s < 0.0, np.isfinite(ub), np.isfinite(lb))
    np.testing.assert_array_equal(z_box, np.where(allowed & (s != 0.0), -s, 0.0))
    at, up, low = kept > 0.0, z_box > 0.0, z_box < 0.0
    terms = (b * y, h[at] * kept[at], ub[up] * z_box[up], lb[low] * z_box[low])
    terms, entries = np.concatenate(terms), np.abs(np.concatenate((y, kept, z_box)))
    moduli, worst = np.abs(terms).sum(), np.abs(s + z_box).max()
    expected = terms.sum(), moduli, worst, entries.max(), entries.sum()
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    s[2] = np.nan
    assert np.isnan(farkas_numbers((b, h, lb, ub), y, kept, s, z_box)[0])


def test_multipliers_that_prove_nothing_are_left_out_and_nan_refused():
    """1 <= x <= 0 by rows; a row without a side and a wrong sign do no harm."""
    G, h = np.array([[-1.0], [1.0], [1.0], [1.0]]), np.array([-1.0, 0.0, np.inf, 5.0])
    qp = make_qp(np.eye(1), np.zeros(1), G, h)
    z = np.array([1.0, 1.0, 3.0, -2.0])
    proof = accept_primal(qp, np.zeros(1), np.empty(0), z, TOL)
    np.testing.assert_array_equal(proof.z, [1.0, 1.0, 0.0, 0.0])
    z[0] = np.nan
    assert accept_primal(qp, np.zeros(1), np.empty(0), z, TOL) is None
