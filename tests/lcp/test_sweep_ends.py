"""How runs of the sweep methods end, and which parameters they refuse."""

import math

import numpy as np
import pytest
from sweeping import sweep
from test_sweeps import KINDS, TRIANGULAR, paper_example, random_problem

from namlcp.lcp.modulus.methods import find_method
from namlcp.limits import Deadline
from namlcp.residuals import natural_residual
from namlcp.status import Status


def halfline(n):
    return np.zeros(n), np.full(n, np.inf)


@pytest.mark.parametrize("kind", KINDS)
def test_growth_is_called_divergence(kind):
    """Gauss-Seidel without bounds on [[1, -2], [2, 1]]: spectral radius 4."""
    A = KINDS[kind](np.array([[1.0, -2.0], [2.0, 1.0]]))
    q, free = np.array([1.0, 1.0]), np.full(2, np.inf)
    result = sweep(A, q, -free, free, "pgs", eps_abs=1e-9, max_iter=10_000)
    assert result.status is Status.DIVERGED
    assert result.iterations < 100
    assert np.isfinite(result.z).all()
    assert result.residual <= np.linalg.norm(q)


def test_growth_of_the_first_sweeps_is_not():
    """Far from normal: Res grows from 10^2 to 10^14, then falls (NAM, Omega = I)."""
    A, q, lower, upper = paper_example(2, 40, delta=0.0)
    result = sweep(
        A, q, lower, upper, "nam", s0=np.tile([1.0, 0.0], 800), eps_abs=1e-4,
        max_iter=500,
    )  # fmt: skip
    assert result.history["residual"][1] > 1e6
    assert result.status is Status.SOLVED


def test_a_cycle_is_called_divergence():
    """A cyclic P-matrix with which projected Gauss-Seidel runs round in circles."""
    A = np.array([[1.0, 2.0, 0.0], [0.0, 1.0, 2.0], [2.0, 0.0, 1.0]])
    result = sweep(A, -np.ones(3), *halfline(3), "pgs", eps_abs=1e-9, max_iter=10_000)
    assert result.status is Status.DIVERGED
    assert result.iterations < 100
    w = A @ result.z - 1.0
    assert result.residual == pytest.approx(natural_residual(result.z, w, *halfline(3)))


@pytest.mark.parametrize("method", ["mgs", "modulus"])
def test_overflow_is_called_divergence(method):
    A = np.array([[1.0, 1e200], [-1e200, 1.0]])
    with np.errstate(all="raise"):
        result = sweep(
            A, np.array([-1.0, 1e150]), *halfline(2), method, eps_abs=1e-9,
            max_iter=1000, omega=1e-100,
        )  # fmt: skip
    assert result.status is Status.DIVERGED
    assert np.isfinite(result.z).all()


def test_repetition_by_rounding_is_called_stalled():
    A, q, lower, upper = paper_example(1, 10)
    result = sweep(A, q, lower, upper, "pgs", eps_abs=1e-300, max_iter=10_000)
    assert result.status in (Status.STALLED, Status.SOLVED)
    assert result.residual < 1e-12


def test_limits():
    A, q, lower, upper = paper_example(1, 10)
    result = sweep(A, q, lower, upper, "mgs", eps_abs=1e-9, max_iter=3)
    assert result.status is Status.MAX_ITER
    assert result.iterations == 3
    late = sweep(
        A, q, lower, upper, "mgs", eps_abs=1e-9, max_iter=3, deadline=Deadline(0.0)
    )
    assert late.status is Status.TIME_LIMIT
    assert late.iterations == 0


def test_best_point_is_kept():
    """The residuals of a diverging run go down, then up."""
    A, q, lower, upper, s = random_problem(0)
    A[0, 1:] *= 9.0
    result = sweep(A, q, lower, upper, "mgs", s0=s, eps_abs=1e-300, max_iter=60)
    assert result.residual == np.nanmin(result.history["residual"])
    w = A @ result.z + q
    assert result.residual == pytest.approx(
        natural_residual(result.z, w, lower, upper), rel=1e-12
    )


@pytest.mark.parametrize("kind", KINDS)
def test_no_factorisation_is_a_numerical_error(kind):
    A = KINDS[kind](np.array([[-2.0, 0.0], [0.0, 3.0]]))
    result = sweep(A, np.ones(2), *halfline(2), "nam", eps_abs=1e-9, max_iter=9)
    assert result.status is Status.NUMERICAL_ERROR
    assert np.isnan(result.z).all()


@pytest.mark.parametrize(
    ("method", "given", "message"),
    [
        ("sor", {}, "method must be one of"),
        ("pgs", {"alpha": 1.0}, "alpha is not a parameter of method 'pgs'"),
        ("psor", {"omega": 1.0}, "omega is not a parameter of method 'psor'"),
        ("msor", {"beta": 1.0}, "beta is not a parameter of method 'msor'"),
        ("mgs", {"shift": 1.0}, "shift is not a parameter of method 'mgs'"),
        ("modulus", {"alpha": 1.0}, "alpha is not a parameter of method 'modulus'"),
        ("psor", {"alpha": 2.0}, r"alpha must lie in \(0, 2\), got 2.0"),
        ("psor", {"alpha": 0}, r"alpha must lie in \(0, 2\), got 0"),
        ("psor", {"alpha": math.nan}, r"alpha must lie in \(0, 2\), got nan"),
        ("maor", {"beta": -0.1}, r"beta must lie in \[0, 2\), got -0.1"),
        ("modified-nam", {"alpha": 0.0}, r"alpha must lie in \(0, inf\), got 0.0"),
        ("modified-nam", {"alpha": 1.0, "omega": 1.0}, "alpha or omega, not both"),
        ("mgs", {"omega": 0.0}, r"omega must be positive, got 0 at \(0\)"),
        ("mgs", {"omega": [1.0, -1.0]}, r"omega must be positive, got -1 at \(1\)"),
        ("mgs", {"omega": np.ones(3)}, r"omega must have shape \(2,\) to match A"),
        ("mgs", {"omega": np.inf}, "omega must be finite"),
        ("namgs", {"shift": -1.0}, r"shift must not be negative, got -1 at \(0\)"),
        ("namgs", {"shift": np.nan}, "shift must be finite, got nan"),
        ("pgs", {"s0": np.ones(3)}, r"s0 must have shape \(2,\) to match A"),
        ("pgs", {"s0": [1.0, np.nan]}, r"s0 must be finite, got nan at \(1\)"),
        ("pgs", {"z0": [np.inf, 1.0]}, r"z0 must be finite, got inf at \(0\)"),
        ("pgs", {"z0": [1, 1], "s0": [1, 1]}, "s0 and z0 must not both be given"),
    ],
)
def test_bad_values_are_named(method, given, message):
    with pytest.raises(ValueError, match=message):
        sweep(
            np.eye(2), np.ones(2), *halfline(2), method, eps_abs=1e-8, max_iter=9,
            **given,
        )  # fmt: skip


@pytest.mark.parametrize(
    ("method", "given", "message"),
    [
        ("psor", {"alpha": "1"}, "alpha must be a number in .*'auto', got '1'"),
        ("psor", {"alpha": True}, "alpha must be a number, got True"),
        ("maor", {"beta": [1.0]}, r"beta must be a number, got \[1.0\]"),
        (
            "mgs",
            {"omega": "D"},
            "omega must be a positive number, an array or 'auto', got 'D'",
        ),
        ("pgs", {"s0": [1j, 0]}, "s0 must be an array of real numbers"),
    ],
)
def test_bad_types_are_named(method, given, message):
    with pytest.raises(TypeError, match=message):
        sweep(
            np.eye(2), np.ones(2), *halfline(2), method, eps_abs=1e-8, max_iter=9,
            **given,
        )  # fmt: skip


@pytest.mark.parametrize("entry", [0.0, -1.0])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", [*TRIANGULAR, "modulus"])
def test_diagonal_must_be_positive(method, kind, entry):
    A = KINDS[kind](np.array([[1.0, 0.5, 0], [0.5, 2.0, 0], [0, 0.5, entry]]))
    message = rf"positive diagonal for method '{method}', got A\[2, 2\] = {entry:g}"
    with pytest.raises(ValueError, match=message):
        sweep(A, np.ones(3), *halfline(3), method, eps_abs=1e-8, max_iter=9)


def test_find_method_lists_who_takes_a_parameter():
    with pytest.raises(ValueError, match="only of maor, namaor"):
        find_method("pgs", beta=1.0)


def test_empty_problem():
    empty = np.empty(0)
    result = sweep(
        np.empty((0, 0)), empty, empty, empty, "pgs", eps_abs=1e-8, max_iter=9
    )
    assert result.status is Status.SOLVED
    assert result.z.shape == (0,)
