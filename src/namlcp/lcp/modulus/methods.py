"""The table of the sweep methods, and the checks of their parameters.

See `sweeps` for the formulas and for the numbers G and H that define a method.
"""

import math
import numbers
from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import refuse_number
from namlcp.lcp.data import spread_number


class Method(NamedTuple):
    """A sweep method.

    `takes`: its parameters among alpha, beta, omega, shift. `beta`: its beta if that is
    fixed; None: beta = alpha unless given. G = beta/alpha + `own` and H = `reflected`.
    Factored methods have M = A, the others a triangular M.
    """

    takes: tuple[str, ...]
    own: float = 0.0
    reflected: float = 0.0
    beta: float | None = None
    factored: bool = False


METHODS = {
    # Bai's splittings, the paper's equation (2), and the accelerated form of the paper,
    # Method 3.1 or equation (4): its variants 3, 4, 5 and 6.
    "mgs": Method(("omega",)),
    "msor": Method(("alpha", "omega")),
    "maor": Method(("alpha", "beta", "omega")),
    "namj": Method(("omega", "shift"), own=1.0, beta=0.0),
    "namgs": Method(("omega", "shift"), own=1.0),
    "namsor": Method(("alpha", "omega", "shift"), own=1.0),
    "namaor": Method(("alpha", "beta", "omega", "shift"), own=1.0),
    # Zheng and Yin's, and those with Omega = D/alpha, which are projected SOR.
    "amgs": Method(("omega",), own=-1.0, reflected=2.0),
    "amsor": Method(("alpha", "omega"), own=-1.0, reflected=2.0),
    "pgs": Method((), own=-1.0, reflected=2.0),
    "psor": Method(("alpha",), own=-1.0, reflected=2.0),
    # Bai's with M = A, and the variants 1 and 2 of Method 3.1.
    "modulus": Method(("omega",), factored=True),
    "nam": Method(("omega", "shift"), own=1.0, factored=True),
    "modified-nam": Method(("alpha", "omega", "shift"), own=1.0, factored=True),
}


SOLVERS = {"auto": Method(()), "multigrid": Method(()), "lemke": Method(("cover",))}
"""Methods of `solve_lcp` that are not sweep methods."""

KNOWN = SOLVERS | METHODS


class Parameters(NamedTuple):
    """Parameters of a sweep method as `solve_lcp` takes them, None where not given.

    alpha, beta: relaxation parameters, alpha in (0, 2), 1 by default; beta in [0, 2),
    alpha by default. (Projected SOR cannot converge for other alpha.) "modified-nam"
    has Omega = alpha I for any alpha > 0.

    omega: diagonal of Omega, positive. Default: D/(2 alpha^2) for mgs, msor, maor and
    namj, namgs, namsor, namaor (as in the paper's tables), D/alpha for amgs and amsor,
    D for "modulus", I for "nam". pgs and psor always have D/alpha.

    shift: diagonal of E, not negative. Default: D for namj, namgs, namsor, namaor (the
    paper has I), so that they do not depend on the scaling; I for "nam" and
    "modified-nam", or D if alpha or omega is "auto".

    alpha, omega = "auto": chosen during the run, see `adaptive`; omega is then c D.
    """

    alpha: Any = None
    beta: Any = None
    omega: Any = None
    shift: Any = None

    def beta_for(self, chosen: Method, alpha: float) -> float:
        """Return beta: the user's, else the method's, else alpha."""
        if self.beta is not None:
            return self.beta
        return alpha if chosen.beta is None else chosen.beta


def find_method(method: str, **given: Any) -> Method:
    """Return a method; raise if it is unknown or lacks a parameter that is given."""
    if not isinstance(method, str):
        raise TypeError(f"method must be a string, got {method!r}")
    if method not in KNOWN:
        raise ValueError(f"method must be one of {list(KNOWN)}, got {method!r}")
    chosen = KNOWN[method]
    for name, value in given.items():
        if value is not None and name not in chosen.takes:
            takers = [key for key, other in KNOWN.items() if name in other.takes]
            raise ValueError(
                f"{name} is not a parameter of method {method!r}, "
                f"only of {', '.join(takers)}"
            )
    both = given.get("alpha") is not None and given.get("omega") is not None
    if chosen.factored and both:
        raise ValueError(
            f"method {method!r} has Omega = alpha I: give alpha or omega, not both"
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


def number(name: str, value: object, interval: str) -> float:
    """Return `value` as a float; raise unless it is in an interval like "(0, 2)"."""
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
    """Return a checked (n,) diagonal from an array, a number or None (the default)."""
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


def is_adaptive(method: str, given: Parameters) -> bool:
    """Tell whether alpha or omega is "auto"; raise if either is another string."""
    interval = "(0, inf)" if method == "modified-nam" else "(0, 2)"
    wanted = {
        "omega": "a positive number, an array",
        "alpha": f"a number in {interval}",
    }
    texts = [name for name in wanted if isinstance(getattr(given, name), str)]
    for name in texts:
        if getattr(given, name) != "auto":
            value = getattr(given, name)
            raise TypeError(f"{name} must be {wanted[name]} or 'auto', got {value!r}")
    return bool(texts)


def checked_parameters(A: Any, method: str, given: Parameters) -> Parameters:
    """Return the parameters checked, with defaults; the diagonals are arrays.

    shift = None: the method has no E.
    """
    chosen = METHODS[method]
    n = A.shape[0]
    if chosen.factored:
        omega = factored_omega(A, method, given)
        shift = spread("shift", given.shift, n, np.ones(n)) if chosen.own else None
        return Parameters(1.0, math.nan, omega, shift)
    alpha = 1.0 if given.alpha is None else number("alpha", given.alpha, "(0, 2)")
    if given.beta is not None:
        given = given._replace(beta=number("beta", given.beta, "[0, 2)"))
    beta = given.beta_for(chosen, alpha)
    D = positive_diagonal(A, method)
    default = D / alpha if chosen.reflected else D / (2.0 * alpha * alpha)
    omega = spread("omega", given.omega, n, default, positive=True)
    shift = spread("shift", given.shift, n, D) if "shift" in chosen.takes else None
    return Parameters(alpha, beta, omega, shift)


def factored_omega(A: Any, method: str, given: Parameters) -> np.ndarray:
    """Return the diagonal of Omega for a factored method."""
    n = A.shape[0]
    if given.alpha is not None:
        return np.full(n, number("alpha", given.alpha, "(0, inf)"))
    if given.omega is None and method == "modulus":
        return positive_diagonal(A, method)
    return spread("omega", given.omega, n, np.ones(n), positive=True)
