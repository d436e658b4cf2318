"""The list of all kernels, and their compilation ahead of use."""

import pytest

import namlcp
from namlcp.compiled import ahead, decorators, signatures, store


def test_every_kernel_is_listed_and_every_line_is_one():
    signatures.all_modules()
    lines = signatures.listed()
    assert len(set(lines)) == len(lines)
    assert lines == sorted(lines)
    for line in lines:
        dispatcher, arguments = signatures.read(line)
        name = decorators.name_of(dispatcher.py_func)
        assert f"{name}({', '.join(map(signatures.spelled, arguments))})" == line
    assert {line.partition("(")[0] for line in lines} == set(decorators.KERNELS)


@pytest.mark.skipif(store.prebuilt().path.is_dir(), reason="it came with the package")
def test_warmup_compiles_what_is_listed(tmp_path, monkeypatch, capsys):
    checks = "checks.is_bad", "checks.has_huge"
    two = [line for line in signatures.listed() if line.startswith(checks)]
    assert len(two) == 2
    for module in (ahead, signatures):
        monkeypatch.setattr(module, "listed", lambda: two)
    store.folders.cache_clear()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    namlcp.warmup(processes=2)
    monkeypatch.undo()
    store.folders.cache_clear()
    out = capsys.readouterr().out
    assert f"] {len(two)} of {len(two)}" in out
    assert str(tmp_path) in out
    kept = {path.name.rpartition("-")[0] for path in tmp_path.rglob("*.kernel")}
    assert kept == {line.partition("(")[0] for line in two}


def test_warmup_says_which_argument_is_wrong():
    with pytest.raises(TypeError, match="progress must be True or False, got 3"):
        namlcp.warmup(3)
    with pytest.raises(ValueError, match="processes must be >= 1, got 0"):
        namlcp.warmup(processes=0)


def test_warmup_of_a_process_that_ends_early(monkeypatch):
    monkeypatch.setattr(ahead, "START", "input()")
    with pytest.raises(RuntimeError, match="ended at checks"):
        namlcp.warmup(progress=False, processes=2)
