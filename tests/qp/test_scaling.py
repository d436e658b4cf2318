"""The units of the path: equilibrated, and the same from whatever the user chose."""

import numpy as np
import pytest
from problems_qp import complementary, make_qp, upper_triangle_of
from scipy.sparse import csc_array, csr_array, diags_array, random_array

from namlcp.limits import Deadline, Limits
from namlcp.qp.guess import make_guess
from namlcp.qp.judge import Judge
from namlcp.qp.kkt import KKT
from namlcp.qp.path.advance import START
from namlcp.qp.path.loop import TOLERABLE, Interior
from namlcp.qp.path.refinement import Refinement
from namlcp.qp.path.workspace import Workspace
from namlcp.qp.transforms.presolve import presolve
from namlcp.qp.transforms.scaling import EQUAL, PAYS, ScaledQP, normalise


def test_scaling_equilibrates_and_is_inverted_exactly():
    known = complementary(3, 10, 12, 2, 10)
    s = ScaledQP(presolve(known.qp, 1e-9, 0.0))
    K = upper_triangle_of(s.kkt)
    K = abs(K + K.T).toarray()
    np.fill_diagonal(K, abs(s.kkt.base[s.kkt.diagonal]))
    np.testing.assert_allclose(K.max(axis=1), 1.0, atol=EQUAL)
    guess = make_guess(known.qp, known.x, None)
    np.testing.assert_allclose(
        s.small.with_fixed(s.guess(guess)[0] * s.unit[:10]), known.x, rtol=1e-14
    )


@pytest.mark.parametrize("seed", range(3))
def test_geometric_means_do_not_see_units(seed):
    qp = complementary(seed, 20, 30, 5, 20, 0.5).qp
    rng = np.random.default_rng(seed)
    D, E, F = (10.0 ** rng.uniform(-3, 3, k) for k in (20, 30, 5))
    d, e, f = (diags_array(v) for v in (D, E, F))
    P, q, G, h, A, b, lb, ub = qp
    other = make_qp(
        d @ P @ d, D * q, e @ G @ d, E * h, f @ A @ d, F * b, lb / D, ub / D
    )
    here, there = (ScaledQP(presolve(problem, 1e-9, 0.0)) for problem in (qp, other))

    def difference():
        return np.abs(here.kkt.base - there.kkt.base).max()

    assert difference() > 0.1
    unit = here.unit
    ratio = here.change_units()
    np.testing.assert_allclose(here.unit, unit * ratio)
    there.change_units()
    assert difference() < 0.01
    assert np.abs(here.kkt.base).max() < 1.1


def normalised(C):
    """Return what `normalise` makes of C, and the factors of its columns and rows."""
    m, n = C.shape
    kkt = KKT(csc_array((n, n)), csr_array((0, n)), csr_array(C))
    scale = np.ones(n + m)
    normalise(kkt.indptr, kkt.indices, kkt.base, n, scale)
    d, e = scale[:n], scale[n:]
    return e[:, None] * C * d, d, e


@pytest.mark.parametrize("seed", range(20))
def test_the_side_with_the_wider_units_is_normalised(seed):
    """Beside a plain transcription: the least variance of log |c_ij| decides."""
    rng = np.random.default_rng(seed)
    C = random_array((30, 20), density=0.3, rng=rng).toarray()
    C *= 10.0 ** rng.uniform(-1.0, 1.0, (30, 1)) ** rng.integers(1, 4)
    C *= 10.0 ** rng.uniform(-1.0, 1.0, 20) ** rng.integers(1, 4)
    C[3], C[:, 5] = 0.0, 0.0
    with np.errstate(divide="ignore"):
        rows, columns = 1.0 / C.max(axis=1), 1.0 / C.max(axis=0)
    rows[3], columns[5] = 1.0, 1.0
    ways = {"as is": (1.0, 1.0), "rows": (1.0, rows), "columns": (columns, 1.0)}
    variance = {}
    for way, (d, e) in ways.items():
        scaled = np.reshape(e, (-1, 1)) * C * d
        variance[way] = np.log(scaled[scaled > 0.0]).var()
    variance["as is"] *= PAYS
    d, e = ways[min(variance, key=variance.get)]
    _, its_d, its_e = normalised(C)
    np.testing.assert_allclose(its_d, d * np.ones(20))
    np.testing.assert_allclose(its_e, e * np.ones(30))


@pytest.mark.parametrize("side", ["rows", "columns"])
def test_units_of_one_side_are_seen_through(side):
    rng = np.random.default_rng(5)
    C = rng.choice([1.0, 2.0], (30, 20)) * (rng.random((30, 20)) < 0.4)
    C[:20] += np.eye(20)
    C[20:, 0] = 1.0
    units = 10.0 ** rng.uniform(-3.0, 3.0, C.shape[side == "columns"])
    found, _, _ = normalised(units[:, None] * C if side == "rows" else C * units)
    axis = 1 if side == "rows" else 0
    np.testing.assert_allclose(found, C / C.max(axis=axis, keepdims=True))
    np.testing.assert_array_equal(np.concatenate(normalised(C)[1:]), 1.0)


def test_a_matrix_without_entries_is_left_alone():
    found, d, e = normalised(np.zeros((3, 2)))
    np.testing.assert_array_equal(found, 0.0)
    np.testing.assert_array_equal(np.r_[d, e], 1.0)


def test_sides_give_way_from_where_they_were():
    """In the second try and the third alike, tolerably; far off they stay."""
    known = complementary(3, 10, 12, 2, 10)
    eps = 1e-6
    limits = Limits(eps, 0.0)
    problem = ScaledQP(presolve(known.qp, eps, 0.0))
    judge = Judge(known.qp, limits)
    work = Workspace(problem, limits)
    loop = Interior(work, judge, limits, Refinement(work, judge, Deadline()))
    work.run(START)
    rows = slice(problem.n, problem.n + problem.p)
    b = problem.b * problem.unit[rows]
    d = np.linalg.lstsq(known.qp.A.toarray(), [1.0, 0.0], rcond=None)[0]
    for violation in (0.4, 0.8):
        x = (known.x + violation * eps * d) / problem.unit[: problem.n]
        work.best_x[:], work.best_y[:], work.best_Z[:] = x, 0.0, 0.0
        assert loop.restart()
        moved = np.abs(problem.b * problem.unit[rows] - b).max()
        expected = violation * eps if violation <= TOLERABLE else 0.0
        assert moved == pytest.approx(expected, abs=1e-3 * eps)
    assert not loop.restart()
