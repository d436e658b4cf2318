"""Many threads, processes of every kind, and always the same bits."""

import multiprocessing
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import problems_lcp as problems
import pytest
from solves import SOLVES

import namlcp


def bits(result) -> tuple:
    """Return all of a result but its times and its problem, byte for byte."""
    fields = {name: getattr(result, name) for name in type(result).__annotations__}
    return tuple(
        value.tobytes() if isinstance(value, np.ndarray) else repr(value)
        for name, value in fields.items()
        if not name.endswith("_time") and name not in ("history", "problem")
    )


def all_bits(_=None) -> list[tuple]:
    """Solve all problems."""
    return [bits(solve()) for solve in SOLVES.values()]


def test_runs_repeat_bit_for_bit():
    assert all_bits() == all_bits()


@pytest.mark.parametrize("name", [k for k in SOLVES if k not in ("dual", "infeasible")])
def test_looking_on_changes_nothing(name, capfd):
    """Neither verbose, nor history, nor a time limit that is not reached."""
    expected = bits(SOLVES[name]())
    assert capfd.readouterr().out == ""
    for options in ({"verbose": True}, {"history": True}, {"time_limit": 1e3}):
        assert bits(SOLVES[name](**options)) == expected, options
    assert capfd.readouterr().out != ""


def test_many_threads_at_once():
    expected = all_bits()
    start = threading.Barrier(6)

    def work(_):
        start.wait()
        return all_bits()

    with ThreadPoolExecutor(6) as pool:
        assert all(found == expected for found in pool.map(work, range(6)))


def test_threads_share_a_prepared_matrix():
    matrix, q = namlcp.Prepared(problems.laplacian(12)), -np.ones(144)
    namlcp.solve_lcp(matrix, q)  # from now on the first face is the right one
    expected = bits(namlcp.solve_lcp(matrix, q))
    with ThreadPoolExecutor(4) as pool:
        found = pool.map(lambda _: bits(namlcp.solve_lcp(matrix, q)), range(12))
        assert all(one == expected for one in found)


@pytest.mark.parametrize("kind", ["fork", "spawn", "forkserver"])
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")  # fork, 3.12
def test_processes_of_every_kind(kind):
    """A forked child inherits the compiled code, the others load it."""
    if kind not in multiprocessing.get_all_start_methods():
        pytest.skip(f"no {kind} here")
    expected = all_bits()
    context = multiprocessing.get_context(kind)
    with context.Pool(1) as pool:
        assert pool.map(all_bits, [None]) == [expected]
