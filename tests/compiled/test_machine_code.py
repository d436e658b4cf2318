"""Machine code: never old, never of others, and nothing that stops a start."""

import compileall
import json
import os
import py_compile
import shutil
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import namlcp
from namlcp.compiled import store

PACKAGE = Path(namlcp.__file__).parent

# Each probe calls a kernel whose answer depends on a callee in another file.
PROBES = """
import json, sys
import numpy as np, namlcp
from namlcp.lcp.pivoting.state import PivotMemory
from namlcp.linalg.columns import columns_of
from namlcp.residuals import natural_residuals

def clean():
    return natural_residuals(*np.array([[3.0], [1.0], [0.0], [9.0], [1.0]]))[0]

def block():
    columns, vectors = columns_of(np.eye(2), True), np.ones((4, 2))
    return PivotMemory(columns, *vectors).q.tolist()

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
ALL = "clean", "block"

# A callee, in which file, what it becomes, and the probe that calls it from another.
CHANGES = (
    ("linalg/lapack.py", "out[i] = a[i]", "out[i] = 5.0", "block"),
)  # fmt: skip


@pytest.fixture(scope="session")
def sources_alone(tmp_path_factory):
    """A copy of the package without machine code, in a folder to import it from.

    Its bytecode goes by the hash of the source: an edit may leave time and size.
    """
    if Path(find_spec("namlcp._shared").origin).parent != PACKAGE:
        pytest.skip("a copy of a package in place has no compiled modules")
    root = tmp_path_factory.mktemp("sources")
    unwanted = shutil.ignore_patterns("__pycache__")
    shutil.copytree(PACKAGE, root / "namlcp", ignore=unwanted)
    by_hash = py_compile.PycInvalidationMode.CHECKED_HASH
    compileall.compile_dir(root / "namlcp", quiet=1, invalidation_mode=by_hash)
    return root


@pytest.fixture(scope="session")
def warm_copy(sources_alone, tmp_path_factory):
    """A copy with the machine code of all probes, and what the process said."""
    root = tmp_path_factory.mktemp("warm")
    shutil.copytree(sources_alone / "namlcp", root / "namlcp")
    return root, run(root, *ALL)


@pytest.fixture
def cold(sources_alone, tmp_path):
    """A folder of the test's own with a copy of the package without machine code."""
    shutil.copytree(sources_alone / "namlcp", tmp_path / "namlcp")
    return tmp_path


@pytest.fixture
def warm(warm_copy, tmp_path):
    """A folder with a copy that has machine code, and what its maker said."""
    shutil.copytree(warm_copy[0] / "namlcp", tmp_path / "namlcp")
    return tmp_path, warm_copy[1]


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


def run(root, *probes, **options):
    return ended(start(root, *probes, **options))


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


def test_only_changed_sources_are_compiled_anew(warm):
    """A changed callee is noticed in another file, and so is the old text."""
    root, first = warm
    assert first[0]["clean"] == 1.0
    assert not first[2]
    again = run(root, *ALL)
    assert again[0] == first[0]
    assert not again[1]
    for name, before, after, _ in CHANGES:
        edit(root, name, before, after)
    new = run(root, *ALL)
    assert not new[2]
    for name, before, after, probe in CHANGES:
        assert new[0][probe] != first[0][probe]
        edit(root, name, after, before)
    assert run(root, *ALL)[0] == first[0]


# ---- where it is kept


def blocked(root):
    """Put a file where the folder of machine code would be: not even root writes it."""
    for path in (root / "namlcp").rglob("__init__.py"):
        shutil.rmtree(path.parent / "__pycache__")
        (path.parent / "__pycache__").write_text("")
    return root


def test_a_package_that_cannot_be_written(cold):
    """It uses the user's folder; where there is none, either, it says so if asked."""
    blocked(cold)
    cache = {"XDG_CACHE_HOME": str(cold / "cache")}
    first = run(cold, "clean", **cache)
    assert not run(cold, "clean", **cache)[1]
    if sys.platform == "linux":
        assert len(files(cold / "cache" / "namlcp")) == len(first[1])
    (cold / "home").write_text("")
    assert run(cold, "clean")[0]["clean"] == 1.0
    verbose = (
        "import namlcp.progress as p, namlcp.lcp.pivoting.state as k\n"
        "p.Progress(('iter',), True).announce(k.best_point)\n"
    )
    out, errors = start(cold, code=verbose).communicate()
    assert out.count("no folder for machine code can be written") == 1, errors


def test_two_processes_on_an_empty_cache(cold):
    """Their folders are not open to others, even where the umask is."""
    before = os.umask(0)
    try:
        answers = [ended(p)[0] for p in [start(cold, "clean") for _ in range(2)]]
    finally:
        os.umask(before)
    assert answers == [{"clean": 1.0}] * 2
    assert {path.suffix for path in files(cold)[0].parent.iterdir()} == {".kernel"}
    for path in files(cold):
        assert not (path.stat().st_mode | path.parent.stat().st_mode) & 0o022
    assert not run(cold, "clean")[1]


def test_truncated_and_foreign_files_are_compiled_anew(warm):
    root, first = warm
    for k, path in enumerate(files(root)):
        content = path.read_bytes()
        payload = b"foreign" if k % 2 else content[store.DIGEST :][:-100]
        if k % 3:  # whole, as far as its sum tells
            folder = store.Folder(path.parent.parent)
            path.unlink()
            folder.write(path.name, payload)
            (folder.path / path.name).replace(path)
        else:
            path.write_bytes(content[: len(content) // 2])
    assert run(root, *ALL) == first
    assert not run(root, *ALL)[1]


# ---- which files are trusted


@pytest.fixture
def folder(tmp_path):
    folder = store.Folder(tmp_path / "kept")
    assert folder.write("a.kernel", b"code")
    assert folder.read("a.kernel") == b"code"
    return folder


@pytest.mark.parametrize(
    "damage",
    [lambda t: t[:-1], lambda t: b"", lambda t: t[:10], lambda t: t[:-1] + b"f",
     lambda t: b"\0" + t[1:], lambda t: t + b"e"],
)  # fmt: skip
def test_a_damaged_file_is_no_file(folder, damage):
    path = folder.path / "a.kernel"
    path.write_bytes(damage(path.read_bytes()))
    assert folder.read("a.kernel") is None


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no such permissions")
@pytest.mark.parametrize(
    ("place", "mode"),
    [("path/a.kernel", 0o666), ("path/a.kernel", 0o664), ("path/a.kernel", 0o646),
     ("path", 0o777), ("path", 0o775), ("path", 0o1777), ("parent", 0o777)],
)  # fmt: skip
def test_nothing_that_others_may_write_is_run(folder, place, mode):
    name, _, file = place.partition("/")
    (getattr(folder, name) / file).chmod(mode)
    assert folder.read("a.kernel") is None
    assert folder.write("b.kernel", b"code") == bool(file)


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="no such links")
def test_no_link_is_followed_no_pipe_waited_for_and_no_stranger_trusted(
    folder, monkeypatch
):
    (folder.path / "b.kernel").symlink_to(folder.path / "a.kernel")
    os.mkfifo(folder.path / "c.kernel")
    assert folder.read("b.kernel") is folder.read("c.kernel") is None
    monkeypatch.setattr(store, "trusted_owners", lambda: {os.getuid() + 1})
    assert folder.read("a.kernel") is None


def test_no_file_is_left_half_written(folder, monkeypatch):
    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    assert not folder.write("b.kernel", b"code")
    assert [path.name for path in folder.path.iterdir()] == ["a.kernel"]
