"""Projected SOR on large matrices: rate, relaxation, and when it is given up."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from problems_lcp import box_lcp
from scipy import sparse
from test_sweeps import paper_example

from namlcp import Prepared
from namlcp.lcp.criterion import Criterion
from namlcp.lcp.data import LCP
from namlcp.lcp.psor import relax, relaxation, solve_by_sweeps
from namlcp.lcp.relaxation import relax_csr
from namlcp.limits import Deadline, Limits
from namlcp.residuals import natural_residual
from namlcp.status import Status


def test_dominance_and_its_solver():
    A, q, lower, upper = paper_example(2, 40)
    q = q + 6.0 * np.random.default_rng(0).normal(size=q.size)
    mu = Prepared(A).dominance
    assert mu == pytest.approx(0.5)
    alpha = relaxation(mu, symmetric=False)
    assert alpha == pytest.approx(2.0 / (1.0 + math.sqrt(0.75)))
    assert relaxation(0.9, symmetric=False) == 1.0
    asked = []

    def accept(z, w):
        asked.append(natural_residual(z, w, lower, upper))
        return asked[-1] < 1e-10

    z, lcp = np.zeros_like(q), box_lcp(A, q, lower, upper)
    criterion = SimpleNamespace(accepts=accept, goal=1e-10)
    found = relax(lcp, z, alpha, Limits(max_iter=100), criterion)
    assert found.status is Status.SOLVED
    assert found.z is z
    assert found.iterations < 30
    assert len(asked) == 1
    np.testing.assert_array_equal(found.w, A @ z + q)
    assert natural_residual(z, found.w, lower, upper) < 1e-10
    assert 0 < np.count_nonzero(z == 0.0) < z.size
    limits = ((Status.MAX_ITER, 1, Deadline()), (Status.TIME_LIMIT, 9, Deadline(0.0)))
    for expected, max_iter, deadline in limits:
        limits = Limits(max_iter=max_iter, deadline=deadline)
        found = relax(lcp, np.zeros_like(q), alpha, limits, criterion)
        assert (found.status, found.iterations) == (expected, 1)
    never = SimpleNamespace(accepts=lambda z, w: False, goal=1e-300)
    found = relax(lcp, z, alpha, Limits(max_iter=1000), never)
    assert found.status is Status.STALLED


@pytest.mark.parametrize("example", [1, 2])
@pytest.mark.parametrize(("delta", "most"), [(0.0, 16), (0.01, 16), (1.0, 50)])
def test_auto_notices_in_time_whether_sweeps_will_do(example, delta, most, monkeypatch):
    """Units do not matter, and slow cases are given up after a few sweeps."""
    A, q, lower, upper = paper_example(example, 60, delta)
    sweeps = []

    def counted(*arguments):
        sweeps[-1] += 1
        return relax_csr(*arguments)

    monkeypatch.setattr("namlcp.lcp.psor.relax_csr", counted)
    units = 10.0 ** np.random.default_rng(0).uniform(-3, 3, q.size)
    for s in (np.ones_like(q), units):
        B = sparse.csr_array(sparse.diags_array(s) @ A @ sparse.diags_array(s))
        B.sort_indices()
        sweeps.append(0)
        lcp, limits = LCP(Prepared(B), s * q, lower, upper), Limits(eps_rel=1e-9)
        outcome = solve_by_sweeps(lcp, None, limits, Criterion(lcp, limits))
        assert (outcome.status is Status.SOLVED) == (delta == 1.0)
    assert sweeps[0] == sweeps[1] <= most


def test_dominance_without_positive_diagonal():
    A = sparse.csr_array(np.array([[1.0, 0.5], [0.25, 0.0]]))
    assert Prepared(A).dominance == math.inf
