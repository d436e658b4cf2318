"""The units of the path: equilibrated; of linear programs, whatever the user chose."""

import numpy as np
import pytest
from problems_qp import complementary, make_qp, upper_triangle_of
from scipy.sparse import csc_array, diags_array

from namlcp.limits import Deadline, Limits
from namlcp.qp.guess import make_guess
from namlcp.qp.judge import Judge
from namlcp.qp.path.advance import START
from namlcp.qp.path.loop import TOLERABLE, Interior
from namlcp.qp.path.refinement import Refinement
from namlcp.qp.path.workspace import Workspace
from namlcp.qp.transforms.presolve import presolve
from namlcp.qp.transforms.scaling import EQUAL, ScaledQP


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
def test_the_scaling_of_linear_programs_does_not_see_units(seed):
    qp = complementary(seed, 20, 30, 5, 20, 0.5).qp
    rng = np.random.default_rng(seed)
    D, E, F = (10.0 ** rng.uniform(-3, 3, k) for k in (20, 30, 5))
    d, e, f = (diags_array(v) for v in (D, E, F))

    def scaled(P):
        """Return K for the QP with this P and for that in other units, scaled."""
        _, q, G, h, A, b, lb, ub = qp
        other = make_qp(
            d @ P @ d, D * q, e @ G @ d, E * h, f @ A @ d, F * b, lb / D, ub / D
        )
        problems = qp._replace(P=P), other
        return (ScaledQP(presolve(problem, 1e-9, 0.0)).kkt.base for problem in problems)

    here, there = scaled(csc_array((20, 20)))
    np.testing.assert_allclose(there, here, atol=0.01)
    assert np.abs(here).max() < 1.1
    here, there = scaled(qp.P)
    assert np.abs(here - there).max() > 0.1


def test_a_linear_program_without_rows_has_scales_of_one():
    lp = make_qp(csc_array((3, 3)), np.ones(3), lb=np.zeros(3), ub=np.ones(3))
    np.testing.assert_array_equal(ScaledQP(presolve(lp, 1e-9, 0.0)).scale, 1.0)


def test_sides_give_way_from_where_they_were():
    """At the first restart and the second alike, tolerably; far off they stay."""
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
