"""What contrib/ offers to hosts: run beside the hosts' own code, by public names."""

import importlib.util
import re
import sys
import unittest
from pathlib import Path

import pytest

CONTRIB = Path(__file__).parents[2] / "contrib"


def loaded(name, file):
    """Import a file of contrib/ as a module of its host."""
    pytest.importorskip(name.partition(".")[0])
    spec = importlib.util.spec_from_file_location(name, CONTRIB / file)
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_module_of_qpsolvers_passes_its_tests():
    loaded("qpsolvers.solvers.namlcp_", "qpsolvers/namlcp_.py")
    tests = loaded("qpsolvers.solvers.test_namlcp", "qpsolvers/test_namlcp.py")
    found = unittest.defaultTestLoader.loadTestsFromModule(tests)
    assert found.countTestCases() > 4
    assert found.run(unittest.TestResult()).wasSuccessful()


def test_the_module_of_cvxpy_solves_and_starts_from_the_last_solution(monkeypatch):
    cp = pytest.importorskip("cvxpy")
    monkeypatch.setattr("cvxpy.settings.NAMLCP", "NAMLCP", raising=False)
    name = "cvxpy.reductions.solvers.qp_solvers.namlcp_qpif"
    solver = loaded(name, "cvxpy/namlcp_qpif.py").NAMLCP()
    x, floor = cp.Variable(2), cp.Parameter()
    rows = [x >= floor, x[0] + x[1] == 3.0]
    problem = cp.Problem(cp.Minimize(cp.sum_squares(x - [3.0, -1.0])), rows)
    for floor.value, best, price in ((0.0, [3.0, 0.0], 2.0), (1.0, [2.0, 1.0], 6.0)):
        problem.solve(solver=solver)
        assert problem.status == "optimal"
        assert x.value == pytest.approx(best, abs=1e-9)
        assert rows[0].dual_value[1] == pytest.approx(price)
    floor.value = 2.0
    problem.solve(solver=solver)
    assert problem.status == "infeasible"
    unbounded = cp.Problem(cp.Minimize(x[0]))
    unbounded.solve(solver=solver)
    assert unbounded.status == "unbounded"


@pytest.mark.parametrize("file", ["qpsolvers/namlcp_.py", "cvxpy/namlcp_qpif.py"])
def test_they_use_public_names_alone(file):
    import namlcp

    text = (CONTRIB / file).read_text()
    names = re.findall(r"namlcp\.([A-Za-z]\w+)", text)
    assert {name for name in names if name not in namlcp.__all__} == set()
