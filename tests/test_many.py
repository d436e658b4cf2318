"""Problems of many shapes, in this process, in others and on a Dask cluster."""

import os
import signal
import sys

import numpy as np
import pytest
import qpsolvers
from problems_qp import complementary
from scipy import sparse

from namlcp import Status, solve_lcp, solve_many, solve_qp

joblib = pytest.importorskip("joblib")


def mixed():
    """QPs of different shapes, each written in another way."""
    small, large = complementary(0, 5, 8, 1, 5).qp, complementary(1, 30, 20, 3, 9).qp
    box = {"P": np.eye(3), "q": -np.ones(3), "ub": np.full(3, 0.5)}
    return [
        tuple(small),
        box,
        qpsolvers.Problem(large.P, large.q, large.G, large.h, lb=large.lb),
        (sparse.csc_array(np.eye(4)), np.ones(4)),
    ]


def singles():
    small, box, problem, last = mixed()
    return [
        solve_qp(*small),
        solve_qp(**box),
        solve_qp(*problem.unpack()),
        solve_qp(*last),
    ]


def assert_same(found, expected):
    for one, other in zip(found, expected, strict=True):
        assert one.status is other.status
        assert one.x.tobytes() == other.x.tobytes()


def test_problems_of_all_kinds_in_order():
    assert_same(solve_many(mixed(), 1, progress=False), singles())
    assert_same(solve_many(iter(mixed()), 1, progress=False), singles())
    assert solve_many([], 1, progress=False) == []


def test_options_are_for_all():
    found = solve_many(mixed(), 1, False, max_iter=1, eps_abs=1e-12)
    assert Status.MAX_ITER in {result.status for result in found}


def test_an_exception_is_the_result_of_its_problem():
    bad = [(np.eye(2), [np.nan, 0.0]), (-np.eye(2), np.ones(2)), {"P": np.eye(2)}, 7]
    found = solve_many([*mixed(), *bad], 1, progress=False)
    assert_same(found[:4], singles())
    kinds = [type(error).__name__ for error in found[4:]]
    assert kinds == ["ValueError", "NotConvex", "TypeError", "TypeError"]
    assert str(found[4]) == "q must be finite, got nan at (0)"


@pytest.mark.parametrize("problems", [3, {"P": np.eye(1), "q": np.ones(1)}])
def test_one_problem_is_no_list_of_problems(problems):
    with pytest.raises(TypeError, match="problems must be an iterable"):
        solve_many(problems, n_jobs=1, progress=False)


def test_lcps():
    A, q = np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([-5.0, -6.0])
    lcps = [(A, q), {"A": A, "q": q, "upper": 1.0}]
    found = solve_many(lcps, 1, progress=False, solve=solve_lcp)
    assert [one.z.round(9).tolist() for one in found] == [
        solve_lcp(A, q).z.round(9).tolist(),
        [1.0, 1.0],
    ]


def test_the_bar_goes_to_standard_error(capfd):
    solve_many(mixed(), 1)
    out, err = capfd.readouterr()
    assert out == ""
    assert "4/4" in err


def test_processes():
    assert_same(solve_many(3 * mixed(), 2, progress=False), 3 * singles())


def die(number, folder=None):
    """Return the number; with a folder, only a second process can tell it."""
    if folder is not None and not os.path.exists(f"{folder}/mark"):
        open(f"{folder}/mark", "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def test_a_dead_process_is_the_result_of_what_it_left(tmp_path):
    problems = [(0,), (1,), (2, tmp_path), (3,), (4,)]
    found = solve_many(problems, 2, progress=False, solve=die)
    errors = [isinstance(one, Exception) for one in found]
    assert errors == sorted(errors)
    assert errors[-1]
    assert solve_many([(0,), (1,)], 2, progress=False, solve=die) == [0, 1]


@pytest.fixture(scope="module")
def cluster():
    """A Dask cluster with two processes as workers."""
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster),
        joblib.parallel_config(backend="dask"),
    ):
        yield


@pytest.mark.usefixtures("cluster")
def test_a_dask_cluster():
    assert_same(solve_many(3 * mixed(), progress=False), 3 * singles())


@pytest.mark.usefixtures("cluster")
def test_a_dask_cluster_goes_on_without_a_worker(tmp_path):
    problems = [(k, tmp_path if k == 7 else None) for k in range(20)]
    assert solve_many(problems, progress=False, solve=die) == list(range(20))


def test_one_process_needs_no_other_package(monkeypatch, capfd):
    for package in ("joblib", "tqdm"):
        monkeypatch.setitem(sys.modules, package, None)
    assert_same(solve_many(mixed(), n_jobs=1), singles())
    assert capfd.readouterr() == ("", "")
    with pytest.raises(ImportError, match=r'needs joblib .* "namlcp\[batch\]"'):
        solve_many([])
