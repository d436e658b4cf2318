"""What kernels do as Python and NumPy would, leave nothing behind, and are all listed.

Some functions are translated in place (`compiled.functions`): Python defines them.
"""

import itertools
import math
from typing import NamedTuple

import numba
import numpy as np
import pytest

import namlcp
from namlcp.compiled import ahead, decorators, internals, signatures, store

jit_only = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


def compiled(function):
    """Return the function, compiled as kernels are."""
    return internals.dispatcher_of(function, function.__name__, False, False)


def same(a, b):
    """Tell whether two numbers agree, in type, sign of zero and NaN too."""
    return type(a) is type(b) and (
        (a == b and math.copysign(1.0, a) == math.copysign(1.0, b))
        or (a != a and b != b)
    )


@jit_only
@pytest.mark.parametrize("function", [max, min])
def test_extremes_follow_python(function):
    of_two = compiled(lambda a, b: function(a, b))
    of_three = compiled(lambda a, b, c: function(a, b, c))
    values = 0.0, -0.0, 1.5, -2.0, math.nan, math.inf, -math.inf
    whole = -(2**62), -1, 0, 3, 2**62
    for pair in (
        *itertools.product(values, repeat=2),
        *itertools.product(whole, whole),
    ):
        assert same(of_two(*pair), function(pair))
    for triple in itertools.product(values, repeat=3):
        assert same(of_three(*triple), function(triple))
    assert same(of_two(np.int32(-3), 2), function(-3, 2))
    assert same(of_two(2, 3.5), float(function(2, 3.5)))
    assert same(of_two(3.5, 2), float(function(3.5, 2)))


@jit_only
@pytest.mark.parametrize("kind", [np.int8, np.int32, np.int64, np.uint8, np.uint64])
def test_ranges_are_those_of_python(kind):
    @compiled
    def between(stop, start, end, step):
        """Add the numbers, weighted by their place, of all kinds of range."""
        count, total, numbers = 0, 0, range(start, end)
        for i in range(stop):
            count += 1
            total += count * i
        for i in numbers:
            count += 1
            total += count * i
        for i in range(start, end, step):
            count += 1
            total += count * i
        return count, total

    ends = range(-3 if np.iinfo(kind).min < 0 else 0, 4)
    steps = (1, 2, -1, -3) if np.iinfo(kind).min < 0 else (1, 2)
    for stop, start, end, step in itertools.product(ends, ends, ends, steps):
        if start > end and np.iinfo(kind).min == 0:
            continue
        every = [*range(stop), *range(start, end), *range(start, end, step)]
        total = sum((k + 1) * i for k, i in enumerate(every))
        found = between(kind(stop), kind(start), kind(end), kind(step))
        assert found == (len(every), total)


class Pair(NamedTuple):
    """Two vectors and a number."""

    first: np.ndarray
    second: np.ndarray
    number: int


@jit_only
def test_items_of_tuples_keep_what_they_refer_to():
    @compiled
    def parts(n):
        """Return arrays that were in tuples, in loops and by name."""
        pair = Pair(np.full(n, 1.0), np.full(n, 2.0), n)
        kept, total = pair.first, 0.0
        for a in (pair.second, np.full(n, 3.0), kept):
            kept = a
            total += a.sum()
        triple = kept, pair.second, pair.number
        return triple[0], triple[-2], triple[2], total, pair.second.shape

    for _ in range(20):
        first, second, *rest = parts(4)
        np.testing.assert_array_equal(first, np.full(4, 1.0))
        np.testing.assert_array_equal(second, np.full(4, 2.0))
        assert rest == [4, 24.0, (4,)]


@jit_only
@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int8, np.int32, np.int64])
def test_new_arrays_are_those_of_numpy(kind):
    vector = compiled(
        lambda n: (np.empty(n, dtype=kind), np.empty(n), np.zeros((n, 2)))
    )
    matrix = compiled(lambda m, n: np.zeros((m, n), kind))
    for n in range(3):
        found = [(one.dtype, one.shape) for one in vector(np.int32(n))]
        assert found == [(kind, (n,)), (np.float64, (n,)), (np.float64, (n, 2))]
        expected = np.zeros((2, n), kind)
        np.testing.assert_array_equal(matrix(2, n), expected, strict=True)
    for sizes, words in (((-1, 2), "negative dimensions"), ((2**62, 8), "is too big")):
        with pytest.raises(ValueError, match=words):
            matrix(*sizes)


@jit_only
# ---- the list that warmup compiles


def test_every_kernel_is_listed_and_every_line_is_one():
    signatures.all_modules()
    lines = signatures.listed()
    assert lines == sorted(set(lines))
    for line in lines:
        dispatcher, arguments = signatures.read(line)
        name = decorators.name_of(dispatcher.py_func)
        assert f"{name}({', '.join(map(signatures.spelled, arguments))})" == line
    assert {line.partition("(")[0] for line in lines} == set(decorators.KERNELS)


def test_warmup_compiles_what_is_listed(tmp_path, monkeypatch, capsys):
    two = [
        line for line in signatures.listed() if line.startswith("lcp.pivoting.state")
    ][:2]
    for module in (ahead, signatures):
        monkeypatch.setattr(module, "listed", lambda: two)
    store.folders.cache_clear()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    namlcp.warmup(processes=2)
    monkeypatch.undo()
    store.folders.cache_clear()
    out = capsys.readouterr().out
    assert "] 2 of 2" in out
    assert str(tmp_path) in out
    kept = {path.name.rpartition("-")[0] for path in tmp_path.rglob("*.kernel")}
    assert kept == {line.partition("(")[0] for line in two}


def test_warmup_says_what_is_wrong(monkeypatch):
    with pytest.raises(TypeError, match="progress must be True or False, got 3"):
        namlcp.warmup(3)
    with pytest.raises(ValueError, match="processes must be >= 1, got 0"):
        namlcp.warmup(processes=0)
    monkeypatch.setattr(ahead, "START", "input()")
    with pytest.raises(RuntimeError, match="ended at lcp"):
        namlcp.warmup(progress=False, processes=2)
