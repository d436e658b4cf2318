"""The options of a QP solve, and checks of option values."""

import math
import numbers
import sys
from collections.abc import Collection, Mapping
from dataclasses import dataclass, fields
from difflib import SequenceMatcher
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from namlcp.limits import Deadline, Limits
from namlcp.status import Progress

SIDES = "h", "b", "lb", "ub"
"""The sides of the constraints: the names of the weights of a `Relaxation`."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of `solve_qp`.

    A point is a solution when primal residual, dual residual and duality gap are each
    at most eps_abs + eps_rel * (size of their terms); `namlcp.residuals` defines the
    residuals and these sizes.

    Attributes
    ----------
    eps_abs, eps_rel : float
        Absolute and relative tolerance, >= 0, not both zero.
    max_iter : int
        Limit on the iterations of any one loop, >= 1.
    time_limit : float
        Limit on the whole solve [s], > 0; the best point so far is returned. It is
        checked between iterations, so that one factorisation more may pass.
    verbose : bool
        Print a table of the progress on standard output.
    threads : int
        Threads that the solve may use, >= 1. More than one help dense QPs of 600
        variables and rows or more, and sparse ones whose factorisations take 20 ms or
        more, on an idle machine.
    infeasible : str or Relaxation
        What comes back if no x is feasible. "certificate": a proof alone. "closest",
        "elastic" or a `Relaxation`: also `QPResult.closest`, the solution of the
        nearest feasible problem, with shifts of h and b of least 2-norm, of least
        1-norm (few rows are shifted), or as the Relaxation says.

    Examples
    --------
    Options are passed by their names:

    >>> import numpy as np
    >>> import namlcp
    >>> namlcp.solve_qp(np.eye(1), np.ones(1), eps_abs=1e-6, time_limit=1.0).x
    array([-1.])
    >>> namlcp.solve_qp(np.eye(1), np.ones(1), eps=1e-6)
    Traceback (most recent call last):
    TypeError: unknown option 'eps'; did you mean 'eps_abs'?
    >>> namlcp.Options(max_iter=50).eps_abs
    1e-09
    """

    eps_abs: float = 1e-9
    eps_rel: float = 1e-10
    max_iter: int = 1000
    time_limit: float = math.inf
    verbose: bool = False
    threads: int = 1
    infeasible: "str | Relaxation" = "certificate"

    def __post_init__(self) -> None:
        check_number("eps_abs", self.eps_abs, closed=True, finite=True)
        check_number("eps_rel", self.eps_rel, closed=True, finite=True)
        if self.eps_abs == 0.0 and self.eps_rel == 0.0:
            raise ValueError("eps_abs and eps_rel must not both be 0")
        check_count("max_iter", self.max_iter)
        check_number("time_limit", self.time_limit)
        check_flag("verbose", self.verbose)
        check_count("threads", self.threads)
        relaxation_of(self.infeasible)

    @cached_property
    def relaxation(self) -> "Relaxation | None":
        """What `infeasible` asks for beyond a certificate, None if nothing."""
        return relaxation_of(self.infeasible)

    @cached_property
    def settings(self) -> tuple[float, float, int, float]:
        """The tolerances and limits, for compiled code."""
        return self.eps_abs, self.eps_rel, self.max_iter, self.time_limit

    @cached_property
    def is_plain(self) -> bool:
        return not (self.verbose or self.relaxation)

    @classmethod
    def from_names(cls, settings: Mapping[str, Any]) -> "Options":
        """Return options from a mapping; raise a TypeError for an unknown name.

        The last ones are remembered, so that asking again costs nothing.

        Examples
        --------
        >>> import namlcp
        >>> namlcp.Options.from_names({"max_iter": 50}).max_iter
        50
        """
        try:
            return remembered(**settings)
        except TypeError:  # of a name, of a value, or one without a hash
            check_names(settings)
            return cls(**settings)

    def limits(
        self, start: float = math.inf, progress: Progress | None = None
    ) -> Limits:
        """Return the limits of a solve; without its `start` no time is over."""
        deadline = Deadline(start + self.time_limit)
        report = None if progress is None else progress.row
        return Limits(self.eps_abs, self.eps_rel, self.max_iter, deadline, report)


@dataclass(frozen=True, eq=False, kw_only=True)
class Relaxation:
    """Which constraints of an infeasible QP are shifted, and how shifts are measured.

    The shifts r minimise 1/2 sum w_i r_i^2 (norm 2) or sum w_i |r_i| (norm 1), in the
    units of the constraints as they are given.

    Attributes
    ----------
    norm : int
        2: shifts spread, and are unique. 1: few constraints are shifted.
    h, b, lb, ub : float or array
        Weights w > 0 of shifts of these, one number for all or one for each entry;
        inf: not shifted. By default the bounds stay.

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> rows, sides = np.array([[1.0], [-1.0]]), np.array([0.0, -3.0])  # x <= 0, x >= 3
    >>> soft = namlcp.Relaxation(h=[2.0, 1.0])
    >>> result = namlcp.solve_qp(np.eye(1), np.zeros(1), rows, sides, infeasible=soft)
    >>> result.status.value, result.closest.x, result.closest.shift_h
    ('primal_infeasible', array([1.]), array([1., 2.]))
    """

    norm: int = 2
    h: Any = 1.0
    b: Any = 1.0
    lb: Any = math.inf
    ub: Any = math.inf

    def __post_init__(self) -> None:
        if self.norm not in (1, 2):
            raise ValueError(f"Relaxation.norm must be 1 or 2, got {self.norm!r}")
        for side in SIDES:
            name, weights = f"Relaxation.{side}", getattr(self, side)
            for weight in np.ravel(weights).tolist():
                check_number(name, weight)


def relaxation_of(infeasible: object) -> Relaxation | None:
    """Return what `Options.infeasible` asks for, None for a certificate alone."""
    if isinstance(infeasible, Relaxation):
        return infeasible
    if not isinstance(infeasible, str):
        raise TypeError(
            f"infeasible must be a string or a Relaxation, got {infeasible!r:.60}"
        )
    if infeasible not in RELAXATIONS:
        raise ValueError(
            f"infeasible must be one of {[*RELAXATIONS]}, got {infeasible!r}"
        )
    return RELAXATIONS[infeasible]


def check_names(settings: Mapping[str, Any]) -> None:
    known = sorted(field.name for field in fields(Options))
    for name in settings:
        if name in ("l", "u"):
            raise TypeError(
                f"unknown option {name!r}; rows l <= C x <= u are given as G = [C; -C],"
                " h = [u; -l], those with l = u as A = C, b = u"
            )
        if name not in known:
            near = nearest(name, [k for k in (*known, "warm_start") if k != name])
            hint = f"did you mean {near!r}?" if near else f"known: {known}"
            raise TypeError(f"unknown option {name!r}; {hint}")


def nearest(name: str, known: Collection[str]) -> str | None:
    close = {k: SequenceMatcher(None, name, k).ratio() for k in known}
    best = max(close, key=lambda k: close[k])
    return best if close[best] >= 0.5 else None


def check_number(
    name: str, value: Any, closed: bool = False, finite: bool = False
) -> None:
    """Raise unless `value` is a real number > 0 (>= 0 if `closed`)."""
    check_kind(name, value, numbers.Real, "a number")
    try:
        number = float(value)
    except OverflowError:
        raise ValueError(f"{name} must be at most {sys.float_info.max:g}") from None
    if finite and number == math.inf:
        raise ValueError(f"{name} must be finite, got {value!r}")
    if not (number > 0.0 or (closed and number == 0.0)):
        raise ValueError(f"{name} must be {'>=' if closed else '>'} 0, got {value!r}")


def check_count(name: str, value: Any) -> None:
    check_kind(name, value, numbers.Integral, "an integer")
    if value < 1:
        raise ValueError(f"{name} must be >= 1, got {value!r}")
    if value > sys.maxsize:
        raise ValueError(f"{name} must be at most {sys.maxsize}")


def check_kind(name: str, value: Any, kind: type, what: str) -> None:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, kind):
        raise TypeError(f"{name} must be {what}, got {value!r}")


def check_flag(name: str, value: Any) -> None:
    if not isinstance(value, (bool, np.bool_)):
        raise TypeError(f"{name} must be True or False, got {value!r}")


remembered = lru_cache(maxsize=32, typed=True)(Options)  # True is not 1
RELAXATIONS = {
    "certificate": None,
    "closest": Relaxation(norm=2),
    "elastic": Relaxation(norm=1),
}
"""The strings that `Options.infeasible` may be, and what they ask for."""
DEFAULT_OPTIONS = Options()
