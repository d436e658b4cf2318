"""Which arguments methods refuse, in which words; tests/test_inputs.py has more."""

import math

import numpy as np
import pytest
from plain_sweeps import ACCELERATED, FACTORED, TAKES, TRIANGULAR, auto
from scipy import sparse

from namlcp import solve_lcp

KINDS = {"dense": np.asarray, "csr": sparse.csr_array}

REFUSED = [
    ("lemke", {"cover": [1.0, 0.0]}, r"cover must be positive, got 0 at \(1\)"),
    ("lemke", {"cover": np.ones(3)}, r"cover must have shape \(2,\)"),
    ("lemke", {"z0": np.ones(2)}, "z0 is not a parameter of method 'lemke'"),
    ("lemke", {"alpha": 1.0}, "alpha is not a parameter of method 'lemke'"),
    ("auto", {"cover": 1.0}, "cover is not a parameter of method 'auto'"),
    ("psor", {"alpha": 0}, r"alpha must lie in \(0, 2\), got 0"),
    ("psor", {"alpha": 10**400}, r"alpha must lie in \(0, 2\), got 1000"),
    ("psor", {"alpha": math.nan}, r"alpha must lie in \(0, 2\), got nan"),
    ("maor", {"beta": -0.1}, r"beta must lie in \[0, 2\), got -0.1"),
    ("maor", {"alpha": "auto", "beta": 2.0}, r"beta must lie in \[0, 2\)"),
    ("modified-nam", {"alpha": 0.0}, r"alpha must lie in \(0, inf\), got 0.0"),
    ("modified-nam", {"alpha": 1.0, "omega": 1.0}, "alpha or omega, not both"),
    ("modified-nam", {"alpha": "auto", "omega": 1.0}, "alpha or omega, not both"),
    ("mgs", {"omega": 0.0}, r"omega must be positive, got 0 at \(0\)"),
    ("mgs", {"omega": [1.0, -1.0]}, r"omega must be positive, got -1 at \(1\)"),
    ("mgs", {"omega": np.ones(3)}, r"omega must have shape \(2,\) to match A"),
    ("mgs", {"omega": np.inf}, "omega must be finite"),
    ("msor", {"alpha": 2.0, "omega": "auto"}, r"alpha must lie in \(0, 2\)"),
    ("msor", {"alpha": "auto", "omega": -1.0}, "omega must be positive"),
    ("namgs", {"shift": -1.0}, r"shift must not be negative, got -1 at \(0\)"),
    ("namgs", {"shift": np.nan}, "shift must be finite, got nan"),
    ("namsor", {"alpha": "auto", "shift": -1.0}, "shift must not be negative"),
    ("pgs", {"s0": np.ones(3)}, r"s0 must have shape \(2,\) to match A"),
    ("pgs", {"s0": [1.0, np.nan]}, r"s0 must be finite, got nan at \(1\)"),
    ("pgs", {"z0": [np.inf, 1.0]}, r"z0 must be finite, got inf at \(0\)"),
    ("auto", {"omega": "auto"}, "omega is not a parameter of method 'auto'"),
]
MISTYPED = [
    ("psor", {"alpha": "1"}, "alpha must be a number in .*'auto', got '1'"),
    ("psor", {"alpha": "best"}, r"alpha must be a number in \(0, 2\) or 'auto', got"),
    ("modified-nam", {"alpha": "1"}, r"a number in \(0, inf\) or 'auto', got '1'"),
    ("psor", {"alpha": True}, "alpha must be a number, got True"),
    ("maor", {"beta": [1.0]}, r"beta must be a number, got \[1.0\]"),
    ("mgs", {"omega": "D"}, "omega must be a positive number, an array or 'auto'"),
    ("pgs", {"s0": [1j, 0]}, "s0 must be an array of real numbers"),
]


@pytest.mark.parametrize(
    ("error", "case"),
    [(ValueError, case) for case in REFUSED] + [(TypeError, case) for case in MISTYPED],
)
def test_bad_parameters_are_named(error, case):
    method, given, message = case
    with pytest.raises(error, match=message):
        solve_lcp(np.eye(2), np.ones(2), method=method, **given)


@pytest.mark.parametrize("method", TAKES)
def test_a_parameter_that_a_method_lacks_is_refused(method):
    """With a list of those that have it; and a diagonal must be positive."""
    lacking = {"alpha", "beta", "omega", "shift"}.difference(TAKES[method].split())
    for name in lacking:
        takers = [other for other in TAKES if name in TAKES[other].split()]
        message = f"{name} is not a parameter.* '{method}', only of {', '.join(takers)}"
        with pytest.raises(ValueError, match=message):
            solve_lcp(np.eye(2), np.ones(2), method=method, **{name: 1.0})
    for entry in (0.0, -1.0):
        A = np.array([[1.0, 0.5, 0], [0.5, 2.0, 0], [0, 0.5, entry]])
        for given in ({}, auto(method)):
            if not given and method in FACTORED[1:]:
                continue  # Omega = I
            for kind in KINDS.values():
                message = rf"diagonal for method '{method}', got A\[2, 2\] = {entry:g}"
                with pytest.raises(ValueError, match=message):
                    solve_lcp(kind(A), np.ones(3), method=method, **given)


def test_every_method_is_in_these_tables():
    with pytest.raises(ValueError, match="method must be one of") as refused:
        solve_lcp(np.eye(2), np.ones(2), method="sor")
    named = str(refused.value).partition("[")[2].partition("]")[0]
    assert set(TAKES) | {"auto", "multigrid", "lemke"} == set(
        named.replace("'", "").split(", ")
    )
    assert set(ACCELERATED) < set(TRIANGULAR)


def test_what_is_too_large_or_singular_is_refused():
    A = sparse.csr_array([[0.0, 1.0], [-1.0, 1.0]])
    with pytest.raises(ValueError, match="regular in the rows and columns"):
        solve_lcp(A, np.ones(2), [-np.inf, 0.0], method="lemke")
    many = sparse.eye_array(5001, format="csr")
    with pytest.raises(ValueError, match=r"order of at most 5000 .* got 5001"):
        solve_lcp(many, np.ones(5001), method="lemke")
