"""What is translated in place in compiled functions: Python and NumPy define it."""

import itertools
import math
from typing import NamedTuple

import numba
import numpy as np
import pytest

from namlcp.compiled import internals

pytestmark = pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")


def compiled(function):
    """Return the function, compiled as kernels are."""
    return internals.dispatcher_of(function, function.__name__, False, False)


def same(a, b):
    """Tell whether two numbers agree, in type, sign of zero and NaN too."""
    return type(a) is type(b) and (
        (a == b and math.copysign(1.0, a) == math.copysign(1.0, b))
        or (a != a and b != b)
    )


@pytest.mark.parametrize("function", [max, min])
def test_extremes_follow_python_for_nan_and_negative_zero(function):
    of_two = compiled(lambda a, b: function(a, b))
    of_three = compiled(lambda a, b, c: function(a, b, c))
    values = 0.0, -0.0, 1.5, -2.0, math.nan, math.inf, -math.inf
    for pair in itertools.product(values, repeat=2):
        assert same(of_two(*pair), function(pair))
    for triple in itertools.product(values, repeat=3):
        assert same(of_three(*triple), function(triple))


@pytest.mark.parametrize("function", [max, min])
def test_extremes_of_integers_and_of_mixed_numbers(function):
    of_two = compiled(lambda a, b: function(a, b))
    for pair in itertools.product((-(2**62), -1, 0, 3, 2**62), repeat=2):
        assert same(of_two(*pair), function(pair))
    assert same(of_two(np.int32(-3), 2), function(-3, 2))
    assert same(of_two(2, 3.5), float(function(2, 3.5)))
    assert same(of_two(3.5, 2), float(function(3.5, 2)))
    pair = 4, 7
    assert compiled(lambda a: function(a))(pair) == function(pair)  # by numba
    assert compiled(lambda a: function(*a))(pair) == function(pair)


@pytest.mark.parametrize("kind", [np.int8, np.int32, np.int64, np.uint8, np.uint64])
def test_ranges_are_those_of_python(kind):
    @compiled
    def up_to(stop):
        count, last = 0, -9
        for i in range(stop):
            count, last = count + 1, i
        return count, last

    @compiled
    def between(start, stop, step):
        """Add the numbers, weighted by their place, of both kinds of range."""
        count, total, numbers = 0, 0, range(start, stop)
        for i in numbers:
            count += 1
            total += count * i
        for i in range(start, stop, step):
            count += 1
            total += count * i
        return count, total

    signs = (1, -1) if np.iinfo(kind).min < 0 else (1,)
    for size, sign in itertools.product(range(5), signs):
        numbers = list(range(size * sign))
        assert up_to(kind(size * sign)) == (len(numbers), max(numbers, default=-9))
    if len(signs) == 2:
        for start, stop in itertools.product(range(-3, 4), repeat=2):
            for step in (1, 2, -1, -3):
                both = [*range(start, stop), *range(start, stop, step)]
                total = sum((k + 1) * i for k, i in enumerate(both))
                found = between(kind(start), kind(stop), kind(step))
                assert found == (len(both), total)


def test_a_range_may_widen_and_be_left():
    @compiled
    def doubled(n, most):
        """Return the sum of range(left), for left = n, 2 n, ..., up to `most`."""
        left, total = n, 0
        while left <= most:
            for i in range(left):
                if i == 100:
                    break
                total += i
            left = np.int64(left) * 2
        return total

    expected = sum(sum(range(min(3 << k, 100))) for k in range(8))
    assert doubled(np.int32(3), 3 << 7) == expected


class Pair(NamedTuple):
    """Two vectors and a number."""

    first: np.ndarray
    second: np.ndarray
    number: int


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
        first, second, number, total, shape = parts(4)
        np.testing.assert_array_equal(first, np.full(4, 1.0))
        np.testing.assert_array_equal(second, np.full(4, 2.0))
        assert (number, total, shape) == (4, 24.0, (4,))


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int8, np.int32, np.int64])
def test_new_arrays_have_the_shape_and_type_of_numpys(kind):
    vector = compiled(lambda n: np.empty(n, dtype=kind))
    matrix = compiled(lambda m, n: np.zeros((m, n), kind))
    alike = compiled(lambda a: np.zeros(a.size, a.dtype))
    np.testing.assert_array_equal(
        alike(np.ones(2, kind)), np.zeros(2, kind), strict=True
    )
    for n in range(3):
        assert vector(n).shape == (n,)
        assert vector(n).dtype == kind
        for m in range(3):
            np.testing.assert_array_equal(
                matrix(m, n), np.zeros((m, n), kind), strict=True
            )


def test_new_arrays_are_of_float64_unless_told():
    found = compiled(lambda n: (np.empty(n), np.zeros(n), np.zeros((n, 2))))(
        np.int32(3)
    )
    assert [(one.dtype, one.shape) for one in found] == [
        (np.float64, (3,)), (np.float64, (3,)), (np.float64, (3, 2))
    ]  # fmt: skip
    assert not found[1].any()
    assert not found[2].any()


def test_impossible_sizes_are_refused():
    vector = compiled(lambda n: np.empty(n))
    with pytest.raises(ValueError, match="negative dimensions"):
        vector(-1)
    with pytest.raises(ValueError, match="array is too big"):
        vector(2**62)
