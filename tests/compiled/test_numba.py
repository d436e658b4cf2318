"""What depends on numba: its private parts, its version, its compiler's events."""

import ast
import sys
from pathlib import Path

import numba
import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

import namlcp
from namlcp import residuals
from namlcp.checks import transposed
from namlcp.compiled import decorators, internals, views

PACKAGE = Path(namlcp.__file__).parent
V3 = internals.BASELINE_FEATURES["x86-64-v3"]


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_no_reference_stays_behind():
    """Neither of what a kernel is given, nor of the arrays that it makes."""
    indptr, indices = np.array([0, 1, 3], np.int32), np.array([1, 0, 1], np.int32)
    data = np.array([1.0, 2.0, 3.0])
    given = [sys.getrefcount(one) for one in (indptr, indices, data)]
    _nrt_python.memsys_enable_stats()
    before = rtsys.get_allocation_stats()
    made = transposed(indptr, indices, data, 2)
    assert made[2].tolist() == [2.0, 1.0, 3.0]
    assert rtsys.get_allocation_stats().free < rtsys.get_allocation_stats().alloc
    del made
    after = rtsys.get_allocation_stats()
    assert after.alloc - before.alloc == after.free - before.free > 0
    assert [sys.getrefcount(one) for one in (indptr, indices, data)] == given


def test_private_parts_of_numba_are_used_in_few_modules():
    """A new version that moves them must not stop the import of the package."""
    public = {"numba", "numba.extending"}
    known = "compiler.py functions.py internals.py lowering.py passes.py".split()
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            taken = []
            if isinstance(node, ast.ImportFrom):
                taken = [node.module or ""]
            elif isinstance(node, ast.Import):
                taken = [alias.name for alias in node.names]
            private = {n for n in taken if n.startswith("numba")} - public
            assert not private or path.name in known, path


def test_this_numba_is_known():
    """Where it is not, these are to be read beside the new version."""
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


def test_compile_time_counts_this_package_alone():
    """That it counts the package's own is asserted where `warm_copy` is made."""
    before = namlcp.compiled.compile_time()
    numba.njit(lambda x: x + 1)(1)
    assert namlcp.compiled.compile_time() == before
    nobodys = {}
    exec("def f(x): return x", nobodys)
    nobodys["f"].__module__ = None
    numba.njit(nobodys["f"])(1)
    assert namlcp.compiled.compile_time() == before
