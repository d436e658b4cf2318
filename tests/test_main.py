"""The command line: the demonstration, good files and hostile ones."""

import numpy as np
import pytest
import scipy.sparse as sp
from qpsolvers import Problem
from qpsolvers.problems import get_qpgurdu, get_qpsut01
from scipy.io import savemat

from namlcp.__main__ import main


def test_demonstration_solves_its_scenes(capsys):
    assert main([]) == 0
    out = capsys.readouterr().out
    assert out.endswith("all solved\n")
    assert "contact" in out
    assert "MPC" in out


@pytest.mark.parametrize("get", [get_qpsut01, get_qpgurdu])
def test_npz_of_the_host(tmp_path, capsys, get):
    problem, _ = get()
    path = tmp_path / "problem.npz"
    problem.save(str(path))
    assert main([str(path)]) == 0
    assert capsys.readouterr().out.startswith("status     solved")


def maros_meszaros() -> dict:
    """Return HS21 as the collection stores it."""
    return {
        "P": sp.csc_matrix(np.diag([0.02, 2.0])),
        "q": np.zeros((2, 1)),
        "A": sp.csc_matrix(np.array([[10.0, -1.0], [1.0, 0.0], [0.0, 1.0]])),
        "l": np.array([[10.0], [2.0], [-50.0]]),
        "u": np.array([[1e20], [50.0], [50.0]]),
        "r": 0.0,
        "n": 2,
        "m": 3,
    }


def test_maros_meszaros_file(tmp_path, capsys):
    """HS21: x = (2, 0), objective 0.04."""
    path = tmp_path / "HS21.mat"
    savemat(path, maros_meszaros())
    assert main([str(path), "--verbose", "--eps-abs", "1e-9"]) == 0
    assert "objective  0.04\n" in capsys.readouterr().out


def test_infeasible_file_says_so(tmp_path, capsys):
    path = tmp_path / "infeasible.mat"
    savemat(path, {**maros_meszaros(), "l": np.array([[10.0], [60.0], [-50.0]])})
    assert main([str(path)]) == 1
    assert "primal_infeasible" in capsys.readouterr().out


def hostile(tmp_path):
    """Yield files that must be refused, each with a word of the refusal."""
    (tmp_path / "text.npz").write_text("not an archive")
    yield "text.npz", "cannot read"
    np.savez(tmp_path / "other.npz", a=np.ones(3))
    yield "other.npz", "holds no P"
    objects = np.array([{"a": 1}, None], dtype=object)
    np.savez(tmp_path / "pickle.npz", P=objects, q=np.ones(2))
    yield "pickle.npz", "Python objects"
    np.savez(tmp_path / "shape.npz", P=np.eye(3), q=np.ones(2))
    yield "shape.npz", "q must have shape"
    savemat(tmp_path / "short.mat", {**maros_meszaros(), "l": np.ones((1, 1))})
    yield "short.mat", "as many rows"
    savemat(tmp_path / "missing.mat", {"P": np.eye(2)})
    yield "missing.mat", "holds no q"
    (tmp_path / "text.mat").write_text("nothing of the kind")
    yield "text.mat", "cannot read"
    yield "absent.npz", "cannot read"


def test_hostile_files_are_refused(tmp_path, capsys):
    for name, word in hostile(tmp_path):
        assert main([str(tmp_path / name)]) == 2, name
        assert word in capsys.readouterr().err, name


def test_absent_parts_are_no_pickles(tmp_path):
    path = tmp_path / "bounds.npz"
    Problem(np.eye(2), np.ones(2), lb=np.zeros(2)).save(str(path))
    assert main([str(path)]) == 0
