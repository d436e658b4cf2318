"""The two stages of a closest point: what is said where one does not end well."""

import numpy as np
import pytest
from problems_qp import Options, make_qp, opposed

from namlcp import Relaxation, Status, results
from namlcp.qp.closest import nearest
from namlcp.qp.route import route
from namlcp.residuals import UNDEFINED
from namlcp.status import Outcome

DEFAULT_LIMITS = Options().limits()
WITHOUT = (None,) * 3


def bent(change):
    """Return a `solve` whose answers, numbered from 1, `change` replaces."""
    count = 0

    def solve(stage, guess, limits):
        nonlocal count
        count += 1
        with np.errstate(all="ignore"):
            return change(count, route(stage, guess, limits))

    return solve


def ending(*statuses):
    """Return a `solve` that ends with these statuses, then always with the last."""

    def change(number, answer):
        status = statuses[min(number, len(statuses)) - 1]
        if status is Status.SOLVED:
            return answer
        point = answer.point._replace(x=np.full(answer.point.x.size, 4.0))
        return Outcome(status, point, UNDEFINED, 1, "path", "Because.")

    return bent(change)


def closest_point(qp, solve, limits=DEFAULT_LIMITS):
    """Return the closest point of a QP that is known to be infeasible."""
    found = nearest(qp, Relaxation(), limits, solve)
    return results.closest_point(found, (qp, WITHOUT))


@pytest.mark.parametrize("status", [Status.STALLED, Status.TIME_LIMIT, Status.MAX_ITER])
def test_a_stage_that_does_not_end_says_so(status):
    found = closest_point(opposed(), ending(status))
    assert found.status is status
    assert found.message.startswith("The search for the least shifts ended with")
    assert found.message.endswith("Because.")
    np.testing.assert_array_equal(found.shift_h, [4.0, 0.0])
    found = closest_point(opposed(), ending(Status.SOLVED, status))
    assert found.status is status
    assert "the search for the least cost ended with" in found.message
    np.testing.assert_allclose(found.shift_h, [1.5, 1.5])
    np.testing.assert_allclose(found.x[0], 1.5)
    assert np.isnan(found.z).all()


def test_a_second_stage_that_contradicts_itself_by_rounding_has_stalled():
    steps = ending(Status.SOLVED, Status.PRIMAL_INFEASIBLE)
    assert closest_point(opposed(), steps).status is Status.STALLED


def test_a_first_stage_that_leaves_a_contradiction_is_solved_finer():
    good, bad = Status.SOLVED, Status.PRIMAL_INFEASIBLE
    found = closest_point(opposed(), ending(good, bad, good, bad, good))
    assert found.status is Status.SOLVED
    np.testing.assert_allclose(found.shift_h, [1.5, 1.5])


def test_a_least_cost_that_residuals_do_not_confirm_has_stalled():
    def spoil(number, answer):
        if answer.point.y.size == 0:  # of the first stage
            return answer
        wrong = answer.point._replace(y=answer.point.y + np.arange(2.0))
        return answer._replace(point=wrong)

    found = closest_point(opposed(), bent(spoil))
    assert found.status is Status.STALLED
    assert "is not proved" in found.message
    assert "a dual one of 1.0e+00" in found.message
    np.testing.assert_allclose(found.x, [1.5, 1.0])
    np.testing.assert_allclose(found.shift_h, [1.5, 1.5])
    assert np.isnan([*found.z, found.residuals.dual]).all()
    with pytest.raises(ValueError, match="status solved, got stalled"):
        found.backward(dx=np.ones(2))


def test_a_row_held_by_rounding_alone_is_released():
    """x_2 >= 1, active by chance after stage 1, with noise 1e-8 as its multiplier."""
    rows = [[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0]]
    qp = make_qp(np.eye(2), [0.0, -5.0], rows, [0.0, -3.0, -1.0])

    def spoil(number, answer):
        if number == 1:
            answer.point.x[1], answer.point.z[2] = 1.0, 1e-8
        return answer

    found = closest_point(qp, bent(spoil))
    assert found.status is Status.SOLVED
    assert found.residuals.solved(1e-9, 1e-10)
    np.testing.assert_allclose(found.x, [1.5, 5.0])
    np.testing.assert_allclose(found.z, [0.0, 1.5, 0.0], atol=1e-9)


@pytest.mark.parametrize(("error", "status"), [(1e-7, "solved"), (1e-5, "stalled")])
def test_stages_are_solved_exactly_or_to_the_tolerances_asked_for(error, status):
    """A stage that stalls within the tolerances of the user is solved."""

    def stall(number, answer):
        residuals = answer.residuals._replace(dual=error)
        return answer._replace(status=Status.STALLED, residuals=residuals)

    found = closest_point(opposed(), bent(stall), Options(eps_abs=1e-6).limits())
    assert found.status.value == status
