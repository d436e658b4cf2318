"""max, min and new arrays in compiled functions: Python and NumPy define them."""

import itertools
import math

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
