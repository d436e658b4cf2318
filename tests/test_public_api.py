"""Names, layering and errors that every user may meet."""

import copy
import inspect
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import namlcp
from namlcp.__main__ import main

CLIENT = Path(__file__).parent / "shared" / "typed_client.py"

METHODS = {
    "BatchResult": ("backward",),
    "ClosestPoint": ("backward",),
    "LCPResult": ("backward", "forward", "directional"),
    "QPResult": ("backward", "forward", "directional"),
    "Solver": ("update", "solve"),
}
"""The methods for users, by class; those of named tuples stand in their class."""


def public():
    """Yield all that users call, by name."""
    for name in namlcp.__all__:
        yield name, getattr(namlcp, name)
        for method in METHODS.get(name, ()):
            yield f"{name}.{method}", getattr(getattr(namlcp, name), method)


def test_public_names():
    assert namlcp.__all__ == sorted(namlcp.__all__)


@pytest.mark.parametrize(("name", "what"), list(public()))
def test_every_public_name_has_an_example(name, what):
    """`test_doctests` runs them all."""
    assert ">>> " in what.__doc__


def test_a_typed_client_passes_mypy(tmp_path):
    """With the package's own hints, from outside, and as strictly as mypy can."""
    pytest.importorskip("mypy")
    if "editable" in type(namlcp.__loader__).__module__:
        pytest.skip("mypy does not find a package that is installed in place")
    options = "--strict", "--no-error-summary", "--cache-dir", str(tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(CLIENT)],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_the_typed_client_runs():
    assert subprocess.run([sys.executable, CLIENT], check=False).returncode == 0


def test_import_prints_nothing_and_warns_of_nothing():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "import namlcp.qp.interior.loop"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_what_takes_long_to_import_is_imported_where_it_is_used():
    late = {"pyamg", "joblib", "tqdm", "dask", "cvxpy", "torch"}
    code = f"import namlcp, sys; sys.exit(not {late}.isdisjoint(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_what_cannot_be_imported_is_no_attribute(monkeypatch):
    """So that help(namlcp), which asks for all, needs no other package."""
    monkeypatch.setitem(sys.modules, "torch", None)
    monkeypatch.delitem(sys.modules, "namlcp.torch", raising=False)
    monkeypatch.delattr(namlcp, "torch", raising=False)
    assert not hasattr(namlcp, "torch")
    with pytest.raises(AttributeError, match=r"namlcp\.torch cannot be imported: "):
        namlcp.torch.solve_qp(EYE, ONE)


ONE, EYE = np.ones(2), np.eye(2)
ROWS = np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([0.0, -3.0])  # x_1 <= 0, >= 3
RESULTS = {
    "QPResult": namlcp.solve_qp(EYE, -np.arange(2.0)),
    "infeasible": namlcp.solve_qp(EYE, ONE, *ROWS, infeasible="closest"),
    "LCPResult": namlcp.solve_lcp(EYE, -ONE),
    "unsolvable": namlcp.solve_lcp(0.0 * EYE, -ONE),
    "BatchResult": namlcp.solve_batch(np.eye(300), np.ones((20, 300))),
    "long": namlcp.solve_qp(np.eye(300), np.arange(300.0)),
}
RESULTS["ClosestPoint"] = RESULTS["infeasible"].closest


def test_results_can_be_compared_without_an_error():
    result = RESULTS["QPResult"]
    assert result == result
    assert result != namlcp.solve_qp(np.eye(2), np.ones(2))


@pytest.mark.parametrize("name", RESULTS)
def test_a_deep_copy_of_a_result_shares_no_array(name):
    result = RESULTS[name]
    parts = {key: getattr(result, key) for key in type(result).__annotations__}
    arrays = {key: part for key, part in parts.items() if isinstance(part, np.ndarray)}
    other = copy.deepcopy(result)
    for key, array in arrays.items():
        np.testing.assert_array_equal(getattr(other, key), array)
        assert not np.shares_memory(getattr(other, key), array)


@pytest.mark.parametrize("name", [n for n in RESULTS if n != "BatchResult"])
def test_a_result_is_true_where_a_solution_was_found(name):
    result = RESULTS[name]
    assert bool(result) is result.found is (result.status == "solved")
    assert result.found is (name not in ("infeasible", "unsolvable"))


def test_a_batch_is_neither_true_nor_false():
    with pytest.raises(TypeError, match=r"ask batch\.solved\.all\(\), or len"):
        bool(RESULTS["BatchResult"])


@pytest.mark.parametrize("name", RESULTS)
def test_a_result_is_shown_in_a_few_lines(name):
    lines = repr(RESULTS[name]).splitlines()
    assert lines[0].startswith(f"{type(RESULTS[name]).__name__}: ")
    assert len(lines) <= 10
    assert max(map(len, lines)) <= 120
    assert "    x = [0. 1.]" in repr(RESULTS["QPResult"])
    assert "    x = [   0.   -1.   -2. ... -297. -298. -299.]" in repr(RESULTS["long"])
    assert "    z = [1. 1.]" in repr(RESULTS["LCPResult"])


HOSTS = ["__version__", "cvxpy", "cvxpylayers", "jax", "qpsolvers", "scenes", "torch"]


@pytest.mark.parametrize(
    ("what", "names"),
    [
        (namlcp, [*namlcp.__all__, *HOSTS]),
        (Solver := namlcp.Solver, METHODS["Solver"]),
        (Solver(EYE, ONE), METHODS["Solver"]),
        *[(result, None) for result in RESULTS.values()],
        *[(type(result), None) for result in RESULTS.values()],
    ],
)
def test_dir_shows_what_is_public_alone(what, names):
    """Of results: what their docstring describes, and what follows from that."""
    shown = [name for name in dir(what) if name[:2] != "__" or what is namlcp]
    if names is None:
        kind = what if isinstance(what, type) else type(what)
        is_batch = kind is namlcp.BatchResult
        names = ("solved", "statuses") if is_batch else ("found", "derivative")
        names += METHODS[kind.__name__]
        for attributes in re.findall(r"^(\w[\w, ]*) : ", inspect.getdoc(kind), re.M):
            names += tuple(attributes.split(", "))
    assert sorted(names) == shown


@pytest.mark.parametrize("status", namlcp.Status)
def test_every_status_explains_itself(status):
    assert status == status.value == str(status) == status.name.lower()
    assert status.explanation.endswith(".")


def test_warmup_says_that_it_does_nothing(capsys):
    with pytest.warns(DeprecationWarning, match="does nothing"):
        namlcp.warmup()
    assert main(["--warmup"]) == 0
    assert "does nothing" in capsys.readouterr().err


def test_copies_of_a_subclass_hold_what_results_hold():
    class Own(namlcp.QPResult):
        pass

    found = namlcp.solve_qp(np.eye(2), np.ones(2))
    values = {name: getattr(found, name) for name in namlcp.QPResult.__annotations__}
    again = copy.copy(Own(**values))
    assert type(again) is Own
    np.testing.assert_array_equal(again.x, found.x)
