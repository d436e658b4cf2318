"""The comparison of closest points with other solvers, on small problems."""

import numpy as np
import pytest

import namlcp
from validation.harness import qps
from validation.peers import closest
from validation.problems.sequences import condensed, stagewise


@pytest.mark.parametrize("build", [condensed, stagewise])
def test_a_step_from_a_lost_state_has_no_feasible_point(build):
    problem = closest.lost(build, 3, 0)
    found = namlcp.solve_qp(**qps.by_name(problem), infeasible="closest")
    assert found.status is namlcp.Status.PRIMAL_INFEASIBLE
    assert closest.conditions(problem, found.closest) <= 1e-9


def test_conditions_see_a_point_that_is_not_the_closest():
    problem = closest.gross(6, dense=True)
    found = namlcp.solve_qp(**qps.by_name(problem), infeasible="closest").closest
    assert closest.conditions(problem, found) <= 1e-12
    elastic = namlcp.solve_qp(**qps.by_name(problem), infeasible="elastic").closest
    assert closest.conditions(problem, elastic) > 1e-3
    shift = np.append(found.shift_h, found.shift_b)
    assert min(closest.distances(problem, shift).values()) <= 1e-8
    assert min(closest.distances(problem, shift + 1e-3).values()) > 1e-5
