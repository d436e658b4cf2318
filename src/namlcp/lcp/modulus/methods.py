"""The named methods as a table, and the checks of their parameters.

`sweeps` has the formulas; the numbers G and H of a method are its place in the family.
"""

import numbers
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import refuse_number
from namlcp.lcp.data import spread_number


class Method(NamedTuple):
    """What a name stands for.

    `takes` are its parameters among alpha, beta, omega, shift; `beta` is its beta where
    that is neither free nor alpha; G = beta/alpha + `own` and H = `reflected`.
    """

    takes: tuple[str, ...]
    own: float = 0.0
    reflected: float = 0.0
    beta: float | None = None
    factored: bool = False


METHODS = {
    "mgs": Method(("omega",)),
    "msor": Method(("alpha", "omega")),
    "maor": Method(("alpha", "beta", "omega")),
    "namj": Method(("omega", "shift"), own=1.0, beta=0.0),
    "namgs": Method(("omega", "shift"), own=1.0),
    "namsor": Method(("alpha", "omega", "shift"), own=1.0),
    "namaor": Method(("alpha", "beta", "omega", "shift"), own=1.0),
    "amgs": Method(("omega",), own=-1.0, reflected=2.0),
    "amsor": Method(("alpha", "omega"), own=-1.0, reflected=2.0),
    "pgs": Method((), own=-1.0, reflected=2.0),
    "psor": Method(("alpha",), own=-1.0, reflected=2.0),
    "modulus": Method(("omega",), factored=True),
    "nam": Method(("omega", "shift"), own=1.0, factored=True),
    "modified-nam": Method(("alpha", "omega", "shift"), own=1.0, factored=True),
}


EXACT = {"auto": Method(()), "multigrid": Method(())}
KNOWN = EXACT | METHODS


def find_method(method: str, **given: Any) -> Method:
    """Return the method of that name; raise for a parameter that it does not have."""
    if not isinstance(method, str):
        raise TypeError(f"method must be a string, got {method!r}")
    if method not in KNOWN:
        raise ValueError(f"method must be one of {list(KNOWN)}, got {method!r}")
    chosen = KNOWN[method]
    for name, value in given.items():
        if value is not None and name not in chosen.takes:
            takers = [key for key, other in METHODS.items() if name in other.takes]
            raise ValueError(
                f"{name} is not a parameter of method {method!r}, "
                f"only of {', '.join(takers)}"
            )
    return chosen


def positive_diagonal(A: Any, method: str) -> np.ndarray:
    """Return D = diag(A); raise if it is not positive."""
    D = np.array(A.diagonal())
    wrong = np.flatnonzero(~(D > 0.0))
    if wrong.size:
        i = wrong[0]
        raise ValueError(
            f"A must have a positive diagonal for method {method!r}, "
            f"got A[{i}, {i}] = {D[i]:g}"
        )
    return D


def is_auto(name: str, value: object, wanted: str) -> bool:
    """Tell whether a parameter is "auto"; raise if it is another string."""
    if isinstance(value, str) and value != "auto":
        raise TypeError(f"{name} must be {wanted} or 'auto', got {value!r}")
    return isinstance(value, str)


def number(name: str, value: object, interval: str) -> float:
    """Return `value` as a float; raise unless it lies in (0, 2), [0, 2), (0, inf)."""
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, numbers.Real):
        raise TypeError(f"{name} must be a number, got {value!r}")
    x = float(value)
    below = x >= 0.0 if interval[0] == "[" else x > 0.0
    if not (below and x < float(interval[1:-1].split(",")[1])):
        raise ValueError(f"{name} must lie in {interval}, got {value!r}")
    return x


def spread(
    name: str, value: Any, n: int, default: np.ndarray, positive: bool = False
) -> np.ndarray:
    """Return a diagonal given as None, a number or an (n,) array, checked."""
    if value is None:
        return default
    diagonal = spread_number(name, value, n)
    refuse_number(name, diagonal, False)
    wrong = np.flatnonzero(diagonal <= 0.0 if positive else diagonal < 0.0)
    if wrong.size:
        i = wrong[0]
        wanted = "be positive" if positive else "not be negative"
        raise ValueError(f"{name} must {wanted}, got {diagonal[i]:g} at ({i})")
    return diagonal
