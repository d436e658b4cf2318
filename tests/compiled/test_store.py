"""Files of machine code: which are run, and when they go."""

import os
import time

import pytest

from namlcp.compiled import store

with_permissions = pytest.mark.skipif(
    not hasattr(os, "getuid"), reason="no such permissions"
)


@pytest.fixture
def folder(tmp_path):
    folder = store.Folder(tmp_path / "kept")
    assert folder.write("a.kernel", b"code")
    assert folder.read("a.kernel") == b"code"
    return folder


def test_code_of_other_versions_goes_after_a_month(tmp_path):
    old, new, foreign = (tmp_path / name for name in ("0" * 32, "1" * 32, "notes"))
    for folder in (old, new, foreign):
        folder.mkdir()
        (folder / "a.kernel").write_text("")
    then = time.time() - 1.1 * store.KEPT
    for folder in (old, foreign):
        os.utime(folder, (then, then))
    assert store.Folder(tmp_path).write("b.kernel", b"code")
    assert not old.exists()
    assert new.exists()
    assert foreign.exists()


def test_use_is_noted(tmp_path):
    folder = store.Folder(tmp_path)
    folder.write("a.kernel", b"code")
    then = time.time() - 10 * store.USED
    os.utime(folder.path, (then, then))
    assert folder.read("a.kernel") == b"code"
    assert folder.path.stat().st_mtime > time.time() - store.USED


@pytest.mark.parametrize(
    "damage",
    [lambda t: t[:-1], lambda t: b"", lambda t: t[:10], lambda t: t[:-1] + b"f",
     lambda t: b"\0" + t[1:], lambda t: t + b"e"],
)  # fmt: skip
def test_a_damaged_file_is_no_file(folder, damage):
    path = folder.path / "a.kernel"
    path.write_bytes(damage(path.read_bytes()))
    assert folder.read("a.kernel") is None


@with_permissions
@pytest.mark.parametrize("mode", [0o666, 0o664, 0o646])
def test_a_file_that_others_may_write_is_not_run(folder, mode):
    (folder.path / "a.kernel").chmod(mode)
    assert folder.read("a.kernel") is None


@with_permissions
@pytest.mark.parametrize("mode", [0o777, 0o775, 0o1777])
def test_nothing_from_a_folder_that_others_may_write(folder, mode):
    folder.path.chmod(mode)
    assert folder.read("a.kernel") is None
    assert not folder.write("b.kernel", b"code")


@with_permissions
def test_nothing_from_below_a_folder_that_others_may_write(folder):
    folder.parent.chmod(0o777)
    assert folder.read("a.kernel") is None
    assert not folder.write("b.kernel", b"code")


@pytest.mark.skipif(not hasattr(os, "O_NOFOLLOW"), reason="no such links")
def test_a_link_is_not_followed_and_a_pipe_not_waited_for(folder):
    (folder.path / "b.kernel").symlink_to(folder.path / "a.kernel")
    os.mkfifo(folder.path / "c.kernel")
    assert folder.read("b.kernel") is None
    assert folder.read("c.kernel") is None


@with_permissions
def test_a_strangers_file_is_not_run(folder, monkeypatch):
    monkeypatch.setattr(store, "trusted_owners", lambda: {os.getuid() + 1})
    assert folder.read("a.kernel") is None


def test_no_file_is_left_half_written(folder, monkeypatch):
    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", fail)
    assert not folder.write("b.kernel", b"code")
    assert [path.name for path in folder.path.iterdir()] == ["a.kernel"]
