"""The command line: good files and hostile ones."""

import gzip
import io
import json
import struct
import subprocess
import sys
import zipfile

import numpy as np
import pytest
import scipy.sparse as sp
from qpsolvers import Problem
from qpsolvers.problems import get_qpgurdu, get_qpsut01

import namlcp
from namlcp import files
from namlcp.__main__ import main


def test_without_a_command_there_is_help(capsys):
    assert main([]) == 0
    assert "solve a problem file" in capsys.readouterr().out


def test_version(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["--version"])
    assert capsys.readouterr().out == f"namlcp {namlcp.__version__}\n"


@pytest.mark.parametrize("get", [get_qpsut01, get_qpgurdu])
def test_npz_of_the_host(tmp_path, capsys, get):
    problem, _ = get()
    path = tmp_path / "problem.npz"
    problem.save(str(path))
    assert main(["solve", str(path)]) == 0
    assert capsys.readouterr().out.startswith("QPResult: solved")


QPS = """NAME HS21, minimise 0.01 x^2 + y^2, its row with a range
ROWS
 N cost
 G row
COLUMNS
    x cost 0.0 row 10.0
    y row -1.0
RHS
    rhs row 10.0
RANGES
    range row 500.0
BOUNDS
 LO set x 2.0
 UP set x 50.0
 MI set y
QUADOBJ
    x x 0.02
    y y 2.0
ENDATA
"""


def test_qps_file(tmp_path, capsys):
    """HS21: x = (2, 0), objective 0.04."""
    path, output = tmp_path / "HS21.qps.gz", tmp_path / "x.npz"
    path.write_bytes(gzip.compress(QPS.encode()))
    rows = files.read_problem(str(path)).G.toarray().tolist()
    assert rows == [[10.0, -1.0], [-10.0, 1.0]]
    assert main(["solve", str(path), "--json", "--output", str(output)]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["status"] == "solved"
    assert record["objective"] == pytest.approx(0.04, abs=1e-12)
    assert np.load(output)["x"].tolist() == record["x"]
    assert main(["solve", str(path), "--compare", "osqp"]) == 0  # tells no objective
    table = [line.split()[:3] for line in capsys.readouterr().out.splitlines()[-2:]]
    assert [row[:2] for row in table] == [["nam", "yes"], ["osqp", "yes"]]
    assert [float(row[2]) for row in table] == pytest.approx([0.04, 0.04], abs=1e-6)
    for option in (["--compare", "nobody"], ["--method", "pgs"]):
        assert main(["solve", str(path), *option]) == 2


def test_a_line_of_a_qps_file_may_have_two_entries(tmp_path):
    path = tmp_path / "two.qps"
    path.write_text(QPS.replace("    x x 0.02", "    x x 0.02 y 0.01"))
    P = files.read_problem(str(path)).P.toarray()
    assert P.tolist() == [[0.02, 0.01], [0.01, 2.0]]


def test_a_solver_that_raises_is_named(tmp_path, capsys):
    path = tmp_path / "bounds.mps"
    path.write_text(QPS.replace(" UP set x 50.0", " UP set x 1.0"))
    assert main(["solve", str(path), "--compare", "osqp"]) == 2
    assert "osqp failed: OSQPException(" in capsys.readouterr().err


def test_infeasible_file_says_so(tmp_path, capsys):
    path = tmp_path / "infeasible.mps"
    path.write_text(QPS.replace(" LO set x 2.0", " LO set x 60.0"))
    assert main(["solve", str(path), "--verbose", "--eps-abs", "1e-9"]) == 1
    assert "primal_infeasible" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("line", "instead", "word"),
    [
        (" x cost 0.0 row 10.0", " x cost 0.0 row", "line 6: a line has a name"),
        (" x cost 0.0 row 10.0", " x other 1.0", "line 6: there is no row other"),
        (" LO set x 2.0", " BV set x", "line 13: bounds of the kind BV"),
        (" G row", " H row", "line 4: row row is of the unknown kind H"),
        (" x x 0.02", " x x much", "line 17: could not convert"),
        (" x x 0.02", " x other 0.02", "line 17: there is no column other"),
        (" rhs row 10.0", " rhs row nan", "line 9: the number of the row row is NaN"),
        ("ROWS", "OBJSENSE\n WORST\nROWS", "line 3: the sense WORST is unknown"),
        (" y row -1.0", " M 'MARKER' 'INTORG'", "integer variables"),
    ],
)
def test_bad_qps_lines_are_named(tmp_path, capsys, line, instead, word):
    path = tmp_path / "bad.mps"
    path.write_text(QPS.replace(line, instead))
    assert main(["solve", str(path)]) == 2
    assert word in capsys.readouterr().err


def test_lcp_file(tmp_path, capsys):
    path, A = tmp_path / "lcp.npz", np.array([[2.0, 1.0], [1.0, 2.0]])
    np.savez(path, A=A, q=np.array([-5.0, -6.0]), upper=np.array([1.0, np.inf]))
    assert main(["solve", str(path), "--json", "--method", "pgs"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["method"] == "pgs"
    assert record["z"] == pytest.approx([1.0, 2.5])
    for option in (["--threads", "2"], ["--compare", "osqp"], ["--method", "magic"]):
        assert main(["solve", str(path), *option]) == 2


def npz(path, **parts):
    """Write an .npz file of raw .npy members."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in parts.items():
            archive.writestr(f"{name}.npy", content)


def npy(array) -> bytes:
    """Return a .npy file."""
    stream = io.BytesIO()
    np.save(stream, array)
    return stream.getvalue()


def claiming(shape, content=b"") -> bytes:
    """Return a .npy file that claims a shape."""
    header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header.encode() + content


def hostile_npz(folder):
    """Yield files that must be refused, each with words of the refusal."""
    (folder / "text.npz").write_text("not an archive")
    yield "text.npz", "not a zip file"
    (folder / "other.mat").write_bytes(b"")
    yield "other.mat", "must end with"
    np.savez(folder / "other.npz", a=np.ones(3))
    yield "other.npz", "holds no P"
    (folder / "array.npz").write_bytes(npy(np.eye(2)))
    yield "array.npz", "not a zip file"
    objects = np.array([{"a": 1}, None], dtype=object)
    np.savez(folder / "pickle.npz", P=objects, q=np.ones(2))
    yield "pickle.npz", "P cannot be read"
    np.savez(folder / "shape.npz", P=np.eye(3), q=np.ones(2))
    yield "shape.npz", "q must have shape (3,)"
    np.savez(folder / "nan.npz", P=np.diag((1.0, np.nan)), q=np.ones(2))
    yield "nan.npz", "P must be finite, got nan at (1, 1)"
    for name, wrong in (("text", np.array(["a", "b"])), ("complex", np.ones(2) * 1j)):
        np.savez(folder / f"{name}_q.npz", P=np.eye(2), q=wrong)
        yield f"{name}_q.npz", "q must hold real numbers"
    whole = (folder / "shape.npz").read_bytes()
    (folder / "cut.npz").write_bytes(whole[: len(whole) // 2])
    yield "cut.npz", "not a zip file"
    npz(folder / "huge.npz", P=claiming((10**6, 10**6)), q=npy(np.ones(2)))
    yield "huge.npz", "cannot read"
    npz(folder / "negative.npz", P=claiming((-1, 4)), q=npy(np.ones(2)))
    yield "negative.npz", "P cannot be read"
    npz(folder / "magic.npz", P=b"MUMPY", q=npy(np.ones(2)))
    yield "magic.npz", "magic"
    npz(folder / "header.npz", P=claiming("__import__('os')"), q=npy(np.ones(2)))
    yield "header.npz", "header"
    npz(folder / "short.npz", P=npy(np.eye(2))[:-8], q=npy(np.ones(2)))
    yield "short.npz", "P cannot be read"
    npz(folder / "inner.npz", P=npy(np.eye(2)), q=npy(np.array(None))[:-9] + b"x")
    yield "inner.npz", "q cannot be read"
    outside = {"../P": npy(np.eye(2)), "/q": npy(np.ones(2))}
    npz(folder / "paths.npz", **outside)
    yield "paths.npz", "holds no P"
    yield "absent.npz", "No such file"


def test_hostile_files_are_refused(tmp_path, capfd):
    for name, word in hostile_npz(tmp_path):
        assert main(["solve", str(tmp_path / name)]) == 2, name
        out, err = capfd.readouterr()
        assert word in err, name
        assert err.count("\n") == 1, name
        assert out == "", name
    assert all(path.is_file() for path in tmp_path.iterdir())  # nothing extracted


def test_bombs_are_refused_before_they_are_unpacked(tmp_path, capfd, monkeypatch):
    """A thousand times smaller than the bound itself, for speed."""
    monkeypatch.setattr(files, "MOST_BYTES", 2**21)
    zeros = bytes(2**22)
    npz(
        tmp_path / "bomb.npz",
        P=claiming((2**9, 2**10), content=zeros),
        q=npy(np.ones(2)),
    )
    (tmp_path / "bomb.qps.gz").write_bytes(gzip.compress(zeros))
    for name in ("bomb.npz", "bomb.qps.gz"):
        assert (tmp_path / name).stat().st_size < 10_000
        assert main(["solve", str(tmp_path / name)]) == 2
        assert "bytes, allowed are 2097152" in capfd.readouterr().err


def test_a_sparse_matrix_in_a_file_is_not_taken_for_none(tmp_path, capfd):
    """qpsolvers saves it as a pickle; without it the answer would be another."""
    path = tmp_path / "sparse.npz"
    G = sp.csc_matrix(np.array([[1.0, 1.0]]))
    Problem(np.eye(2), np.ones(2), G, -np.ones(1) * 9).save(str(path))
    assert main(["solve", str(path)]) == 2
    assert "G cannot be read (a sparse matrix?" in capfd.readouterr().err


@pytest.mark.parametrize("suffix", ["npz", "qps"])
def test_no_traceback_in_a_process_of_its_own(tmp_path, suffix):
    path = tmp_path / f"noise.{suffix}"
    path.write_bytes(np.random.default_rng(0).bytes(1000))
    done = subprocess.run(
        [sys.executable, "-m", "namlcp", "solve", str(path)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert done.stderr.startswith("cannot read")


def test_absent_parts_are_no_pickles(tmp_path):
    path = tmp_path / "bounds.npz"
    Problem(np.eye(2), np.ones(2), lb=np.zeros(2)).save(str(path))
    assert main(["solve", str(path)]) == 0
