"""Multigrid runs that end otherwise than solved, and what they cost in all."""

from types import SimpleNamespace

import numpy as np
from problems_lcp import box_lcp
from test_multigrid import EPS, INF, convection

from namlcp import Status
from namlcp.lcp.multigrid import cycles as multigrid
from namlcp.lcp.multigrid.cycles import solve_by_multigrid
from namlcp.lcp.multigrid.hierarchy import Hierarchy, build, coarsen, suits
from namlcp.lcp.multigrid.vcycle import VCycle
from namlcp.limits import Deadline, Limits
from namlcp.scenes import forced_obstacle
from validation.problems import large_scenes


def problem(m=40):
    """Return a hierarchy and the arguments that belong to it."""
    A, q = forced_obstacle(m)
    lcp = box_lcp(A, q, np.zeros(q.size), np.full(q.size, INF))
    assert lcp.matrix.hierarchy() is not None
    return lcp


def never(goal):
    """Return a criterion that accepts no point."""
    return SimpleNamespace(accepts=lambda z, w: False, goal=goal)


def test_limits_return_the_best_point():
    lcp = problem()
    found = solve_by_multigrid(lcp, None, Limits(max_iter=1), never(EPS))
    assert (found.status, found.iterations) == (Status.MAX_ITER, 1)
    cold = lcp.residual(lcp.lower, lcp.q)
    assert lcp.residual(found.z, found.w) < 0.1 * cold
    late = Limits(deadline=Deadline(0.0))
    found = solve_by_multigrid(lcp, None, late, never(EPS))
    assert (found.status, found.iterations) == (Status.TIME_LIMIT, 0)
    np.testing.assert_array_equal(found.w, lcp.A @ found.z + lcp.q)


def test_what_rounding_forbids_ends_as_stalled():
    lcp = problem()
    found = solve_by_multigrid(lcp, None, Limits(), never(1e-30))
    assert found.status is Status.STALLED
    assert found.iterations < 10
    assert lcp.residual(found.z, found.w) < 1e-14


def test_cycles_that_do_not_converge_say_so():
    """Central differences far beyond cell Peclet number 1, which `build` refuses."""
    A = convection(40, 1.5)
    n = A.shape[0]
    assert suits(A)
    assert build(A, False) is None
    hierarchy = Hierarchy(A, False, np.ones(n), coarsen(A, False, False), 1.0)
    lcp = box_lcp(A, -np.ones(n), np.zeros(n), np.full(n, INF), symmetric=False)
    lcp.matrix.levels = hierarchy
    found = solve_by_multigrid(lcp, None, Limits(), never(EPS))
    assert found.status is Status.STALLED
    assert found.iterations <= 20
    np.testing.assert_array_equal(found.w, A @ found.z + lcp.q)
    assert lcp.residual(found.z, found.w) <= np.sqrt(n)


def test_transport_takes_few_v_cycles_on_all_levels_together(monkeypatch):
    """Example 2 at delta = 0, with a load: 60 at most, whatever the order."""
    A, *vectors = large_scenes.transport(100)
    lcp = box_lcp(A, *vectors, symmetric=False)
    criterion = SimpleNamespace(
        accepts=lambda z, w: lcp.residual(z, w) < 1e-9, goal=1e-9
    )
    solver = multigrid.MultigridSolver(lcp, build(A, False), criterion)
    solve, begun = VCycle.solve, []

    def counted(cycle, k, b, x):
        begun.append(b is not cycle.faces[k].b)  # else part of a cycle from above
        return solve(cycle, k, b, x)

    monkeypatch.setattr(VCycle, "solve", counted)
    assert solver.run(None, Limits(max_iter=40)) is Status.SOLVED
    assert 0 < sum(begun) <= 60
