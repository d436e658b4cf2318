"""Machine code: never old, never of others, and nothing that stops a start."""

import compileall
import json
import os
import py_compile
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import namlcp
from namlcp.compiled import sources, store

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

ALL_PROBES = ("clean", "asymmetric", "tridiagonal", "block", "fronts")

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


@pytest.fixture(scope="session")
def sources_alone(tmp_path_factory):
    """A copy of the package without machine code, in a folder to import it from.

    Its bytecode goes by the hash of the source: an edit may leave time and size.
    """
    root = tmp_path_factory.mktemp("sources")
    unwanted = shutil.ignore_patterns("__pycache__", "prebuilt")
    shutil.copytree(PACKAGE, root / "namlcp", ignore=unwanted)
    by_hash = py_compile.PycInvalidationMode.CHECKED_HASH
    compileall.compile_dir(root / "namlcp", quiet=1, invalidation_mode=by_hash)
    return root


@pytest.fixture(scope="session")
def warm_copy(sources_alone, tmp_path_factory):
    """A copy with the machine code of all probes, and what the process said.

    Tests that compile nothing may use it; all others copy it.
    """
    root = copied(sources_alone, tmp_path_factory.mktemp("warm"))
    timed = PROBES + "assert 0.05 < namlcp.compiled.compile_time() < 60.0\n"
    return root, ended(start(root, *ALL_PROBES, code=timed))


@pytest.fixture
def cold(sources_alone, tmp_path):
    """A folder of the test's own with a copy of the package without machine code."""
    return copied(sources_alone, tmp_path)


@pytest.fixture
def warm(warm_copy, tmp_path):
    """A folder with a copy that has machine code, and what its maker said."""
    return copied(warm_copy[0], tmp_path), warm_copy[1]


def copied(made, folder):
    """Copy a made package, bytecode and machine code with it; return its folder."""
    shutil.copytree(made / "namlcp", folder / "namlcp")
    return folder


def start(root, *probes, code=PROBES, **environment):
    """Start a process with the package in a folder; it keeps files beside it."""
    plain = {
        "PYTHONPATH": str(root), "NUMBA_CACHE_DIR": None, "XDG_CACHE_HOME": None,
        "HOME": str(root / "home"), "LOCALAPPDATA": str(root / "home"),
        "PYTHONDONTWRITEBYTECODE": "1",  # it would go by time and size
    }  # fmt: skip
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


# ---- never old


def test_unchanged_sources_compile_nothing(warm_copy):
    root, first = warm_copy
    assert first[0]["clean"] == 1.0
    assert first[1]
    assert not first[2]
    again = run(root, *ALL_PROBES)
    assert again[0] == first[0]
    assert not again[1]
    assert set(again[2]) <= set(first[1])


def test_a_changed_callee_is_noticed_in_another_file(warm):
    """Its callers are compiled anew; with the old text back they answer as before."""
    root, old = warm
    for name, before, after, _ in CHANGES.values():
        edit(root, name, before, after)
    new = run(root, *ALL_PROBES)
    for *_, probe in CHANGES.values():
        assert new[0][probe] != old[0][probe]
    assert set(new[1]) >= set(old[1])
    assert not new[2]
    for name, before, after, _ in CHANGES.values():
        edit(root, name, after, before)
    back = run(root, "asymmetric")
    assert back[0]["asymmetric"] == old[0]["asymmetric"]
    assert len({path.parent for path in files(root)}) == 1


def test_another_version_compiles_anew(warm):
    root, first = warm
    edit(root, "__init__.py", f'"{namlcp.__version__}"', '"9.9.9"')
    compiled = run(root, "clean")[1]
    assert compiled
    assert set(compiled) <= set(first[1])
    assert len({path.parent for path in files(root)}) == 1


def test_sources_that_change_under_a_process_leave_no_files(cold):
    change = f"open({str(cold / 'namlcp' / 'status.py')!r}, 'a').write('# new')\n"
    late = PROBES.replace("answers = {}", change + "answers = {}")
    assert ended(start(cold, "clean", code=late))[0]["clean"] == 1.0
    assert not files(cold)


def test_a_module_that_changed_before_its_import_leaves_no_files(cold):
    """The stamp was taken when the package was imported."""
    finish = cold / "namlcp" / "lcp" / "modulus" / "coloured.py"
    change = f"open({str(finish)!r}, 'a').write('# new')\n"
    late = PROBES.replace("I = np.eye", change + "I = np.eye")
    assert ended(start(cold, "block", code=late))[0]["block"][1] == 0.0
    assert not files(cold)


def test_other_settings_of_numba_have_other_code(warm):
    root, _ = warm
    checked = run(root, "clean", NUMBA_BOUNDSCHECK="1")
    assert checked[1]
    assert not checked[2]
    assert run(root, "clean", NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="")[1]
    assert not run(root, "clean")[1]


@pytest.fixture
def stamp_of(monkeypatch):
    """A function that takes the stamp of the package in a folder."""

    def taken(root):
        monkeypatch.setattr(sources, "PACKAGE", root / "namlcp")
        sources.hashed_files.cache_clear()
        return sources.stamp()

    yield taken
    monkeypatch.undo()
    sources.hashed_files.cache_clear()


def test_the_stamp_goes_by_lines_and_not_by_their_ends(cold, stamp_of):
    stamps = [stamp_of(cold)]
    for text in (b"# one\n", b"# one\r\n", b"# two\n"):
        (cold / "namlcp" / "qp" / "new.py").write_bytes(text)
        stamps.append(stamp_of(cold))
    assert stamps[1] == stamps[2]
    assert len(set(stamps)) == 3


def test_the_stamp_covers_every_folder(cold, stamp_of):
    doors = list((cold / "namlcp").rglob("__init__.py"))
    changed = [cold / "namlcp" / name for name, *_ in CHANGES.values()]
    stamps = {stamp_of(cold)}
    for path in (*doors, *changed):
        with path.open("a") as file:
            file.write("# new\n")
        stamps.add(stamp_of(cold))
    assert len(stamps) == 1 + len(doors) + len(changed)


# ---- where it is kept


def blocked(root):
    """Put a file where the folder of machine code would be: not even root writes it."""
    folders = [path.parent for path in (root / "namlcp").rglob("__init__.py")]
    for folder in folders:
        shutil.rmtree(folder / "__pycache__")
        (folder / "__pycache__").write_text("")
    return root


def test_a_package_that_cannot_be_written_uses_the_users_folder(cold):
    blocked(cold)
    cache = {"XDG_CACHE_HOME": str(cold / "cache")}
    first = run(cold, "clean", **cache)
    assert not run(cold, "clean", **cache)[1]
    if sys.platform == "linux":
        assert len(files(cold / "cache" / "namlcp")) == len(first[1])


def test_a_package_that_is_reached_by_a_link_keeps_its_code(cold):
    link = cold / "link"
    (cold / "below").mkdir()
    link.symlink_to(cold)
    assert run(link, "clean")[1]
    assert not run(link / "below" / "..", "clean")[1]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no such permissions")
def test_an_open_umask_opens_no_folder(cold):
    before = os.umask(0)
    try:
        assert run(cold, "clean")[1]
        assert not run(cold, "clean")[1]
    finally:
        os.umask(before)
    for path in files(cold):
        assert not path.stat().st_mode & 0o022
        assert not path.parent.stat().st_mode & 0o022


def test_nowhere_to_write(cold):
    blocked(cold)
    (cold / "home").write_text("")
    answers, compiled, _ = run(cold, "clean")
    assert answers["clean"] == 1.0
    assert compiled
    assert not files(cold)
    verbose = (
        "import namlcp.progress as p, namlcp.lcp.relaxation as k\n"
        "p.Progress(('iter',), True).announce(k.relax_csr)\n"
    )
    out, errors = start(cold, code=verbose).communicate()
    assert out.count("no folder for machine code can be written") == 1, errors


def test_numbas_folder_alone_where_it_is_set(cold):
    run(cold, "clean", NUMBA_CACHE_DIR=str(cold / "given"))
    assert files(cold / "given")
    assert files(cold / "given") == files(cold)


def test_truncated_and_foreign_files_are_compiled_anew(warm):
    root, first = warm
    for k, path in enumerate(files(root)):
        content = path.read_bytes()
        payload = b"foreign" if k % 2 else content[store.DIGEST :][:-100]
        if k % 3:  # whole, as far as its sum tells
            path.unlink()
            store.Folder(path.parent.parent).write(path.name, payload)
            (path.parent.parent / sources.stamp() / path.name).replace(path)
        else:
            path.write_bytes(content[: len(content) // 2])
    again = run(root, *ALL_PROBES)
    assert again == first
    assert not run(root, *ALL_PROBES)[1]


def test_four_processes_on_an_empty_cache(cold):
    answers = [ended(p)[0] for p in [start(cold, "clean") for _ in range(4)]]
    assert answers == [{"clean": 1.0}] * 4
    names = [path.suffix for path in files(cold)[0].parent.iterdir()]
    assert set(names) == {".kernel"}
    assert not run(cold, "clean")[1]


# ---- another numba


def test_an_unknown_numba_has_its_own_cache_under_the_stamp(cold):
    """A new numba costs time at the start and nothing else."""
    unknown = (
        "import numba, sys; numba.version_info = (0, 999, 0)\n"
        "sys.modules['namlcp.compiled.internals'] = None\n"  # its import would fail
    ) + PROBES
    first = ended(start(cold, "clean", code=unknown))
    assert first[0]["clean"] == 1.0
    assert list(cold.rglob("*.nbi"))
    listing = "from namlcp.compiled import signatures; signatures.all_modules()\n"
    again = ended(start(cold, "clean", code=unknown + listing))
    assert again[0] == first[0]
    assert not again[1]
    edit(cold, "residuals.py", "z - upper) + 0.0 * z", "z - upper) + 2.0 * z")
    assert ended(start(cold, "clean", code=unknown))[0]["clean"] == 7.0
