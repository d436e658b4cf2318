"""Sweeps in coloured order: the sequential sweep of a permuted matrix, on threads."""

import subprocess
import sys
import threading

import numba
import numpy as np
import problems_lcp as problems
import pytest
from problems_lcp import box_lcp
from scipy import sparse
from sweeping import one_step

from namlcp import solve_lcp
from namlcp.lcp.modulus.coloured import BlockSweep, coloured
from namlcp.lcp.modulus.methods import METHODS as ALL
from namlcp.lcp.modulus.methods import Parameters, checked_parameters
from namlcp.lcp.modulus.triangular import TriangularStep
from namlcp.status import Status

METHODS = ["mgs", "namgs", "namaor", "amsor", "psor"]


def problem(rng, m):
    """A nonsymmetric matrix with a band, q, and every kind of bounds."""
    A = sparse.csr_array(problems.laplacian(m, 1.0))
    A.data *= rng.uniform(0.5, 1.0, A.nnz)
    A.setdiag(5.0)
    A.sort_indices()
    n = m * m
    lower = np.where(rng.random(n) < 0.3, -np.inf, -rng.random(n))
    upper = np.where(rng.random(n) < 0.3, np.inf, rng.random(n))
    return A, rng.standard_normal(n), lower, upper


@pytest.fixture
def rng():
    return np.random.default_rng(3)


def step_of(A, q, lower, upper, method, run=None):
    given = {"namaor": Parameters(0.9, 0.4), "amsor": Parameters(1.2)}
    checked = checked_parameters(A, method, given.get(method, Parameters()))
    return TriangularStep(box_lcp(A, q, lower, upper), ALL[method], checked, run)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("scattered", [False, True])
def test_it_is_the_sequential_sweep_of_the_coloured_order(method, scattered, rng):
    A, q, lower, upper = problem(rng, 12)
    n = q.size
    if scattered:  # couples that reach over several blocks
        p = np.arange(n).reshape(4, -1).T.ravel()
        A = sparse.csr_array(A[p][:, p])
        A.sort_indices()
    run = BlockSweep(A, 2, shift=3)
    rank = np.argsort(run.colours.order)
    blocks = np.arange(n) >> run.colours.shift
    order = np.lexsort((np.arange(n), rank[blocks]))
    B = sparse.csr_array(A[order][:, order])
    B.sort_indices()
    s = rng.standard_normal(n)
    data = q[order], lower[order], upper[order]
    expected, one = one_step(step_of(B, *data, method), s[order], *data[1:])
    step = step_of(A, q, lower, upper, method, run)
    actual, other = one_step(step, s, lower, upper)
    np.testing.assert_allclose(actual[order], expected, atol=1e-13)
    assert other == pytest.approx(one, rel=1e-13)


def test_no_two_coupled_blocks_share_a_colour(rng):
    A = sparse.random_array((200, 200), density=0.003, rng=rng, format="csr")
    colour, colours = coloured(A, 3)
    assert set(colour) == set(range(colours))
    i, j = A.nonzero()
    i, j = i >> 3, j >> 3
    assert np.all((colour[i] != colour[j]) | (i == j))


def test_colours_of_a_band_and_of_a_scattered_matrix(rng):
    A = problem(rng, 32)[0]
    band = BlockSweep(A, 2, shift=5)
    assert band.colours.starts.size - 1 == 2
    assert band.colours.colour.size == 32
    p = rng.permutation(A.shape[0])
    scattered = sparse.csr_array(A[p][:, p])
    scattered.sort_indices()
    assert BlockSweep(scattered, 2, shift=5).colours.colour.size == 1


@pytest.mark.parametrize("method", ["namgs", "psor"])
def test_the_number_of_threads_does_not_matter(method, rng):
    A, q, lower, upper = problem(rng, 160)
    results = [
        solve_lcp(A, q, lower, upper, method=method, threads=threads, eps_abs=1e-9)
        for threads in (1, 2, 10**6)
    ]
    one, natural = results[0], solve_lcp(A, q, lower, upper, method=method)
    assert one.status is natural.status is Status.SOLVED
    np.testing.assert_allclose(one.z, natural.z, atol=1e-7)
    for other in results[1:]:
        assert (other.iterations, other.residual) == (one.iterations, one.residual)
        np.testing.assert_array_equal(other.s, one.s)
    assert numba.get_num_threads() == numba.config.NUMBA_NUM_THREADS


def test_two_solves_at_once(rng):
    A, q, lower, upper = problem(rng, 130)
    results = []

    def solve():
        options = {"method": "namgs", "threads": 2, "eps_abs": 1e-10}
        results.append(solve_lcp(A, q, lower, upper, **options))

    workers = [threading.Thread(target=solve) for _ in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for result in results[1:]:
        np.testing.assert_array_equal(result.s, results[0].s)


def test_auto_parameters_in_coloured_order(rng):
    A, q, lower, upper = problem(rng, 130)
    options = {"method": "namsor", "alpha": "auto", "omega": "auto"}
    one, two = (
        solve_lcp(A, q, lower, upper, threads=threads, **options) for threads in (1, 2)
    )
    assert one.status is Status.SOLVED
    np.testing.assert_array_equal(one.s, two.s)


@pytest.mark.parametrize(
    ("A", "options", "error", "text"),
    [
        (np.eye(2), {"method": "pgs", "threads": 2}, ValueError, "threads is for a"),
        (
            sparse.eye_array(2, format="csr"), {"method": "modulus", "threads": 2},
            ValueError, "threads is for a sparse A and a triangular method",
        ),
        (np.eye(2), {"threads": 2}, ValueError, "threads is for the sweep methods"),
        (
            sparse.eye_array(2, format="csr"), {"method": "pgs", "threads": 0},
            ValueError, "threads must be >= 1",
        ),
    ],
)  # fmt: skip
def test_bad_threads_are_named(A, options, error, text):
    with pytest.raises(error, match=text):
        solve_lcp(A, np.ones(2), **options)


def test_threads_start_only_where_they_are_asked_for():
    code = """
import sys, threading, numpy, scipy.sparse, namlcp
A = scipy.sparse.eye_array(9, format="csr")
namlcp.solve_lcp(A, -numpy.ones(9), method="pgs")
sys.exit("namlcp.lcp.modulus.coloured" in sys.modules or threading.active_count() > 1)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_no_bounds_but_zero(rng):
    """Bounds 0 and inf are not read; they are the same bounds."""
    A, q, _, _ = problem(rng, 20)
    zero, inf = np.zeros_like(q), np.full_like(q, np.inf)
    s = rng.standard_normal(q.size)
    for run in (None, BlockSweep(A, 2, shift=4)):
        one = one_step(step_of(A, q, zero, inf, "namgs", run), s, zero, inf)
        upper = inf.copy()
        upper[0] = 1e9  # finite, but out of the way
        other = one_step(step_of(A, q, zero, upper, "namgs", run), s, zero, upper)
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1] == other[1]
