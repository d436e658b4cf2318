"""The two stages of a closest point: what is said where one does not end well."""

import numpy as np
import pytest
from problems_qp import make_qp, opposed

from namlcp import Relaxation, Status
from namlcp.limits import Limits
from namlcp.options import Options
from namlcp.qp.answer import Answer
from namlcp.qp.closest import Face, solve_or_approach
from namlcp.qp.closest.rows import Rows
from namlcp.qp.closest.stage_one import STAGE_TOLERANCES
from namlcp.qp.guess import NO_GUESS
from namlcp.qp.solve import solve_or_relax
from namlcp.residuals import UNDEFINED

INF = np.inf
DEFAULT_LIMITS = Options().limits()


def answers(qp, *statuses):
    """Return a `solve` that ends with these statuses, then always with the last."""
    left = list(statuses)

    def solve(stage, guess, limits, memory=None):
        n = stage.q.size
        good = solve_or_relax(stage, guess, limits)
        status = left.pop(0) if len(left) > 1 else left[0]
        if status is Status.SOLVED:
            return good
        point = stage.point(np.full(n, 4.0))
        return Answer(status, point, UNDEFINED, 1, "path", "Because.")

    return solve


def closest_point(qp, solve, limits=DEFAULT_LIMITS):
    """Return the closest point of a QP that is known to be infeasible."""
    known = Answer(Status.PRIMAL_INFEASIBLE, qp.point(), UNDEFINED, 0, "path")
    problem, start = (qp, (None,) * 3), (NO_GUESS, None)
    return solve_or_approach(problem, Relaxation(), start, limits, solve, known)[1]


@pytest.mark.parametrize("status", [Status.STALLED, Status.TIME_LIMIT, Status.MAX_ITER])
def test_a_stage_that_does_not_end_says_so(status):
    qp = opposed()
    found = closest_point(qp, answers(qp, status))
    assert found.status is status
    assert found.message.startswith("The search for the least shifts ended with")
    assert found.message.endswith("Because.")
    np.testing.assert_array_equal(found.shift_h, [4.0, 0.0])
    steps = answers(qp, Status.SOLVED, status)
    found = closest_point(qp, steps)
    assert found.status is status
    assert "the search for the least cost ended with" in found.message
    np.testing.assert_allclose(found.shift_h, [1.5, 1.5])
    np.testing.assert_allclose(found.x[0], 1.5)
    assert np.isnan(found.z).all()


def test_a_second_stage_that_contradicts_itself_by_rounding_has_stalled():
    qp = opposed()
    steps = answers(qp, Status.SOLVED, Status.PRIMAL_INFEASIBLE)
    found = closest_point(qp, steps)
    assert found.status is Status.STALLED


def bent(spoil):
    """Return a `solve` whose answers, numbered from 1, `spoil` changes."""
    count = 0

    def solve(stage, guess, limits, memory=None):
        nonlocal count
        count += 1
        answer = solve_or_relax(stage, guess, limits)
        return answer._replace(point=spoil(count, answer.point))

    return solve


def test_a_least_cost_that_residuals_do_not_confirm_has_stalled():
    def spoil(number, point):
        return point if number == 1 else point._replace(y=point.y + np.arange(2.0))

    found = closest_point(opposed(), bent(spoil))
    assert found.status is Status.STALLED
    assert "is not proved" in found.message
    assert "a dual one of 1.0e+00" in found.message
    np.testing.assert_allclose(found.x, [1.5, 1.0])
    np.testing.assert_allclose(found.shift_h, [1.5, 1.5])
    assert np.isnan(found.z).all()
    assert np.isnan(found.residuals.dual)
    with pytest.raises(ValueError, match="status solved, got stalled"):
        found.backward(dx=np.ones(2))


def test_a_row_held_by_rounding_alone_is_released():
    """x_2 >= 1, active by chance after stage 1, with noise 1e-8 as its multiplier."""
    rows = [[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]
    qp = make_qp(np.eye(2), [0.0, -5.0], rows, [0.0, -3.0, -1.0])

    def spoil(number, point):
        if number == 1:
            point.x[1], point.z[2] = 1.0, 1e-8
        return point

    found = closest_point(qp, bent(spoil))
    assert found.status is Status.SOLVED
    assert found.residuals.solved(1e-9, 1e-10)
    np.testing.assert_allclose(found.x, [1.5, 5.0])
    np.testing.assert_allclose(found.z, [0.0, 1.5, 0.0], atol=1e-9)


def test_a_refined_face_has_multipliers_without_residual():
    rng = np.random.default_rng(1)
    C, nothing, free = rng.standard_normal((6, 3)), np.zeros(6), np.full(3, INF)
    inverse = np.linalg.pinv(C[:5, :2].T)
    exact = np.append(1.0 + rng.random(5), 0.0)
    exact[:5] -= inverse @ (C[:5, :2].T @ exact[:5])  # x_1, x_2 are free: no force
    v_box = np.where(np.arange(3) == 2, -(C.T @ exact), 0.0)
    v = exact + np.append(1e-7 * rng.standard_normal(5), 1e-12)
    rows = Rows(C, nothing, np.ones(6), 0, -free, free, *np.zeros((2, 0), int), 2)
    sense = np.array([0, 0, 0, 0, 0, 1])
    face = Face(rows, v, v_box, sense, nothing, -free, free, v > INF)
    refined = face.refined(lambda qp: solve_or_relax(qp, NO_GUESS, Limits(1e-9, 1e-13)))
    assert np.abs(face.residual()).max() > 1e-8
    np.testing.assert_allclose(refined.residual(), 0.0, atol=1e-15)
    least = inverse @ (C[:5, :2].T @ v[:5])
    np.testing.assert_allclose(refined.v, np.append(v[:5] - least, 0.0), atol=1e-15)


@pytest.mark.parametrize(("error", "status"), [(1e-7, "solved"), (1e-5, "stalled")])
def test_stages_are_solved_exactly_or_to_the_tolerances_asked_for(error, status):
    """A stage that stalls within the tolerances of the user is solved."""
    asked = []

    def solve(stage, guess, limits, memory=None):
        asked.append(limits.tolerances)
        answer = solve_or_relax(stage, guess, limits)
        residuals = answer.residuals._replace(dual=error)
        return answer._replace(status=Status.STALLED, residuals=residuals)

    found = closest_point(opposed(), solve, Options(eps_abs=1e-6).limits())
    assert set(asked) == {STAGE_TOLERANCES}
    assert found.status.value == status
