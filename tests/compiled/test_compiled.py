"""Machine code: never old, never of others, and nothing that stops a start."""

import ast
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

import namlcp
from namlcp import residuals
from namlcp.compiled import decorators, internals, sources, store, views

PACKAGE = Path(namlcp.__file__).parent

# Each probe calls one kernel, through the public function where that is quick, whose
# answer depends on a callee in another file.
PROBES = """
import json, sys
import numpy as np, namlcp
from scipy import sparse
I = np.eye(2)

def asymmetric():
    return namlcp.qp.problem.qp_data(I, np.ones(2), *6 * [None]).q.tolist()

def tridiagonal():
    from namlcp.lcp.tridiagonal.elimination import scan_for_states
    state = np.zeros(2, dtype=np.int8)
    spans = np.zeros((2, 1), dtype=np.int64)
    rows, vectors = np.full((5, 2), 1.0), (-np.ones(2), np.zeros(2), np.full(2, np.inf))
    scan_for_states(rows, *vectors, state, np.zeros((7, 4)), np.zeros((6, 1)), spans)
    return state.tolist()

def block():
    from namlcp.lcp.modulus.coloured import coloured_sweep
    return namlcp.solve_lcp(
        sparse.csr_array(4 * I), np.array([-4.0, 4.0]), method="mgs", threads=1
    ).z.tolist()

def fronts():
    from namlcp.linalg.ordering import Supernodes
    from namlcp.linalg.multifrontal import solve_fronts
    index, long = np.array([0, 2], dtype=np.int32), np.array([0, 4])
    rows, L = np.array([0, 1], dtype=np.int32), np.array([1.0, 0.0, 0.5, 1.0])
    u = np.ones(2)
    kinds = Supernodes.__annotations__
    nodes = {name: np.zeros(1, dtype=np.int32) for name in kinds}
    nodes |= {"first": index, "starts": index, "rows": rows, "panels": long}
    solve_fronts(Supernodes(**nodes), L, np.ones(2), u)
    return u.tolist()

def clean():
    return namlcp.natural_residual(*np.array([[3.0], [1.0], [0.0], [9.0]]))

def kernels(kind):
    from namlcp.compiled.decorators import KERNELS
    return sorted(k for k, d in KERNELS.items() if getattr(d.stats, kind))

answers = {}
for name in sys.argv[1:]:
    try:
        answers[name] = globals()[name]()
    except ValueError as error:
        answers[name] = str(error)
print(json.dumps([answers, kernels("cache_misses"), kernels("cache_hits")]))
"""

# A callee, in which file, what it becomes, and the probe that calls it from another.
CHANGES = {
    "checks": (
        "linalg/symmetry.py",
        "return gap, size\n\n\n@kernel",
        "return 9.0, 1.0\n\n\n@kernel",
        "asymmetric",
    ),
    "lcp elimination": (
        "lcp/tridiagonal/scan.py",
        "n = state.size\n    top = -1",
        "n = 0\n    top = -1",
        "tridiagonal",
    ),
    "lcp sweeps": (
        "lcp/relaxation.py",
        "return u if x > u else x",
        "return 5.0",
        "block",
    ),
    "BLAS": (
        "linalg/lapack.py",
        "total += a[i] * b[i]\n    return total",
        "total += a[i] * b[i]\n    return 3.0 * total",
        "fronts",
    ),
}


def copied(folder):
    """Copy the package's sources; return the folder to import it from."""
    shutil.copytree(
        PACKAGE,
        folder / "namlcp",
        ignore=shutil.ignore_patterns("__pycache__", "prebuilt"),
    )
    return folder


def start(root, *probes, code=PROBES, **environment):
    """Start a process with the package in a folder; it keeps files beside it."""
    plain = {
        "PYTHONPATH": str(root),
        "NUMBA_CACHE_DIR": None,
        "HOME": str(root / "home"),
    }
    plain |= {"XDG_CACHE_HOME": None, "LOCALAPPDATA": str(root / "home")}
    # Python's own cache goes by time and size, which `edit` may leave as they were.
    plain["PYTHONDONTWRITEBYTECODE"] = "1"
    wanted = os.environ | plain | environment
    return subprocess.Popen(
        [sys.executable, "-W", "error", "-P", "-c", code, *probes],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={k: v for k, v in wanted.items() if v is not None},
    )  # fmt: skip


def ended(process):
    """Return what the probes of a process answered, what was compiled, what loaded."""
    out, errors = process.communicate()
    assert process.returncode == 0, errors
    return json.loads(out)


def run(root, *probes, **environment):
    return ended(start(root, *probes, **environment))


def files(root):
    return sorted(root.rglob("*.kernel"))


def edit(root, name, before, after):
    """Change one place of a source file; the file's time stays as it was."""
    path = root / "namlcp" / name
    text, found = path.read_text(), path.stat()
    assert text.count(before) == 1, (name, before)
    path.write_text(text.replace(before, after))
    os.utime(path, ns=(found.st_atime_ns, found.st_mtime_ns))


V3 = internals.BASELINE_FEATURES["x86-64-v3"]


# ---- never old


def test_unchanged_sources_compile_nothing(tmp_path):
    root = copied(tmp_path)
    first = run(root, "clean")
    assert first[0]["clean"] == 1.0
    assert first[1]
    assert not first[2]
    again = run(root, "clean")
    assert again[0] == first[0]
    assert not again[1]
    assert again[2]
    assert set(again[2]) <= set(first[1])


@pytest.mark.parametrize("room", CHANGES)
def test_a_changed_callee_is_noticed_in_another_file(room, tmp_path):
    """Its callers are compiled anew; with the old text back they answer as before."""
    name, before, after, probe = CHANGES[room]
    root = copied(tmp_path)
    old = run(root, probe)
    edit(root, name, before, after)
    new = run(root, probe)
    assert new[0] != old[0]
    assert set(new[1]) >= set(old[1])
    assert not new[2]
    edit(root, name, after, before)
    back = run(root, probe)
    assert back[0] == old[0]
    assert len({path.parent for path in files(root)}) == 1


def test_another_version_compiles_anew(tmp_path):
    root = copied(tmp_path)
    first = run(root, "clean")
    edit(root, "__init__.py", f'"{namlcp.__version__}"', '"9.9.9"')
    assert run(root, "clean")[1] == first[1]
    assert len({path.parent for path in files(root)}) == 1


def test_sources_that_change_under_a_process_leave_no_files(tmp_path):
    root = copied(tmp_path)
    change = f"open({str(root / 'namlcp' / 'status.py')!r}, 'a').write('# new')\n"
    late = PROBES.replace("answers = {}", change + "answers = {}")
    assert ended(start(root, "clean", code=late))[0]["clean"] == 1.0
    assert not files(root)


def test_a_module_that_changed_before_its_import_leaves_no_files(tmp_path):
    """The stamp was taken when the package was imported."""
    root = copied(tmp_path)
    finish = root / "namlcp" / "lcp" / "modulus" / "coloured.py"
    change = f"open({str(finish)!r}, 'a').write('# new')\n"
    late = PROBES.replace("I = np.eye", change + "I = np.eye")
    assert ended(start(root, "block", code=late))[0]["block"][1] == 0.0
    assert not files(root)


def test_other_settings_of_numba_have_other_code(tmp_path):
    root = copied(tmp_path)
    first = run(root, "clean")
    assert run(root, "clean", NUMBA_BOUNDSCHECK="1")[1] == first[1]
    assert run(root, "clean", NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")[1]
    assert not run(root, "clean")[1]


def test_the_stamp_covers_every_file_and_not_its_line_ends(tmp_path, monkeypatch):
    monkeypatch.setattr(sources, "PACKAGE", copied(tmp_path) / "namlcp")
    stamps = []
    for text in (None, b"# one\n", b"# one\r\n", b"# two\n"):
        if text is not None:
            (tmp_path / "namlcp" / "qp" / "new.py").write_bytes(text)
        sources.hashed_files.cache_clear()
        stamps.append(sources.stamp())
    sources.hashed_files.cache_clear()
    assert stamps[1] == stamps[2]
    assert len(set(stamps)) == 3


# ---- where it is kept


def blocked(root):
    """Put a file where the folder of machine code would be: not even root writes it."""
    for folder in (root / "namlcp").rglob("*"):
        if folder.is_dir():
            (folder / "__pycache__").write_text("")
    (root / "namlcp" / "__pycache__").write_text("")
    return root


def test_a_package_that_cannot_be_written_uses_the_users_folder(tmp_path):
    root = blocked(copied(tmp_path))
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    first = run(root, "clean", **cache)
    assert not run(root, "clean", **cache)[1]
    if sys.platform == "linux":
        assert len(files(tmp_path / "cache" / "namlcp")) == len(first[1])


def test_a_package_that_is_reached_by_a_link_keeps_its_code(tmp_path):
    real, link = tmp_path / "real", tmp_path / "link"
    real.mkdir()
    copied(real)
    link.symlink_to(real)
    first = run(link, "clean")
    assert first[1]
    assert not run(link, "clean")[1]
    assert not run(link / ".." / "real", "clean")[1]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no such permissions")
def test_an_open_umask_opens_no_folder(tmp_path):
    root = copied(tmp_path)
    before = os.umask(0)
    try:
        assert run(root, "clean")[1]
        assert not run(root, "clean")[1]
    finally:
        os.umask(before)
    for path in files(root):
        assert not path.stat().st_mode & 0o022
        assert not path.parent.stat().st_mode & 0o022


def test_nowhere_to_write(tmp_path):
    root = blocked(copied(tmp_path))
    (tmp_path / "home").write_text("")
    for _ in range(2):
        answers, compiled, _ = run(root, "clean")
        assert answers["clean"] == 1.0
        assert compiled
    verbose = (
        "import namlcp.progress as p, namlcp.lcp.relaxation as k\n"
        "p.Progress(('iter',), True).announce(k.relax_csr)\n"
    )
    out, errors = start(root, code=verbose).communicate()
    assert out.count("no folder for machine code can be written") == 1, errors


def test_numbas_folder_alone_where_it_is_set(tmp_path):
    root = copied(tmp_path)
    run(root, "clean", NUMBA_CACHE_DIR=str(tmp_path / "given"))
    assert files(tmp_path / "given")
    assert files(tmp_path / "given") == files(tmp_path)


def test_truncated_and_foreign_files_are_compiled_anew(tmp_path):
    root = copied(tmp_path)
    first = run(root, "clean", "asymmetric")
    for k, path in enumerate(files(root)):
        content = path.read_bytes()
        payload = b"foreign" if k % 2 else content[store.DIGEST :][:-100]
        if k % 3:  # whole, as far as its sum tells
            path.unlink()
            store.Folder(path.parent.parent).write(path.name, payload)
            (path.parent.parent / sources.stamp() / path.name).replace(path)
        else:
            path.write_bytes(content[: len(content) // 2])
    again = run(root, "clean", "asymmetric")
    assert again == first
    assert not run(root, "clean", "asymmetric")[1]


def test_eight_processes_on_an_empty_cache(tmp_path):
    root = copied(tmp_path)
    answers = [ended(p)[0] for p in [start(root, "clean") for _ in range(8)]]
    assert answers == [{"clean": 1.0}] * 8
    names = [path.suffix for path in files(root)[0].parent.iterdir()]
    assert set(names) == {".kernel"}
    assert not run(root, "clean")[1]


# ---- another numba


def test_an_unknown_numba_has_its_own_cache_under_the_stamp(tmp_path):
    """A new numba costs time at the start and nothing else."""
    root = copied(tmp_path)
    unknown = (
        "import numba, sys; numba.version_info = (0, 999, 0)\n"
        "sys.modules['namlcp.compiled.internals'] = None\n"  # its import would fail
    ) + PROBES
    first = ended(start(root, "clean", code=unknown))
    assert first[0]["clean"] == 1.0
    again = ended(start(root, "clean", code=unknown))
    assert again[0] == first[0]
    assert not again[1]
    assert list(root.rglob("*.nbi"))
    listing = "from namlcp.compiled import signatures; signatures.all_modules()\n"
    ended(start(root, code=unknown + listing))
    edit(root, "residuals.py", "z - upper) + 0.0 * z", "z - upper) + 2.0 * z")
    assert ended(start(root, "clean", code=unknown))[0]["clean"] == 7.0


def test_private_parts_of_numba_are_used_in_two_modules():
    """A new version that moves them must not stop the import of the package."""
    public = {"numba", "numba.extending"}
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            taken = []
            if isinstance(node, ast.ImportFrom):
                taken = [node.module or ""]
            elif isinstance(node, ast.Import):
                taken = [alias.name for alias in node.names]
            private = {n for n in taken if n.startswith("numba")} - public
            assert not private or path.name in ("internals.py", "compiler.py"), path


def test_this_numba_is_known():
    """Where it is not, these two are to be read beside the new version."""
    assert decorators.is_known(), numba.__version__


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
@pytest.mark.parametrize("make", [internals.arrays_at, views.portable])
def test_views_have_the_shape_that_was_asked_for(make):
    """As those of functions that are not compiled."""
    at, M = make(np.float64), np.arange(6.0).reshape(2, 3)

    @numba.njit
    def seen(address):
        last = at(address, (2, 3))[1]
        last[0] = 7.0
        cube = at(address, (1, 2, 3))
        return at(address, 6).sum(), last.sum(), cube[0, 1, 2], cube.shape

    assert seen(M.ctypes.data) == (19.0, 16.0, 5.0, (1, 2, 3))
    view = views.interpreted(np.float64)
    np.testing.assert_array_equal(view(M.ctypes.data, (2, 3)), M)
    np.testing.assert_array_equal(view(M.ctypes.data, 6), M.ravel())


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_a_part_refuses_a_call_from_python():
    """Compiled on its own or within a kernel; numba's would end the process."""
    one = np.ones(1)
    for _ in range(2):
        with pytest.raises(
            TypeError, match=r"residuals\.deviation is called by compiled functions"
        ):
            residuals.deviation(1.0, 1.0, 0.0, 2.0)
        assert residuals.natural_squares(one, one, 0.0 * one, 2.0 * one, 1.0) == 1.0


@pytest.mark.parametrize(
    ("given", "name", "features", "expected"),
    [
        (None, "znver3", "+avx,+avx2,+x", False),
        (None, "znver3", "".join(f"+{f}," for f in V3) + "-avx512f", True),
        ("generic", "generic", "", False),
        ("x86-64-v3", "x86-64-v3", "", True),
        ("x86-64-v3", "x86-64-v3", "-avx2", False),
    ],
)
def test_prebuilt_code_is_for_processors_that_have_what_it_needs(
    given, name, features, expected, monkeypatch
):
    monkeypatch.setattr(numba.config, "CPU_NAME", given)
    fits = internals.fits_baseline.__wrapped__
    assert fits("x86-64-v3", name, features) is expected


def test_compile_time_counts_this_package_alone(tmp_path):
    before = namlcp.compiled.compile_time()
    numba.njit(lambda x: x + 1)(1)
    assert namlcp.compiled.compile_time() == before
    nobodys = {}
    exec("def f(x): return x", nobodys)
    nobodys["f"].__module__ = None
    numba.njit(nobodys["f"])(1)
    assert namlcp.compiled.compile_time() == before
    timed = PROBES + "assert 0.05 < namlcp.compiled.compile_time() < 30.0\n"
    assert ended(start(copied(tmp_path), "clean", code=timed))[1]
