"""Every method on every LCP of the table CASES, judged by the definition."""

import re
from itertools import groupby
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np
import pytest
from lcp_cases import all_cases
from lcp_definition import (
    CANCELS,
    RELATIVE,
    assert_consistent,
    assert_proves_unsolvable,
    relative_residual,
)
from plain_sweeps import TAKES, auto
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator

from namlcp import Prepared, Status, solve_lcp

CASES = all_cases()
BRIEF = {"max_iter": 100}
"""Of methods that promise nothing."""

EPS = 1e-10
"""Res that is asked of the sweep methods."""

HAVE_SOLUTIONS = "dominant", "P", "semidefinite", "copositive", "general", "hidden"


EXPONENTIAL = "murty 20", "murty 30", "fathi 30"
"""For Lemke's method with d = 1: paths through 2^n bases."""


class Way(NamedTuple):
    """A method, how A is given to it, and the truths for which it must answer."""

    options: dict[str, Any]
    given: Any
    answers: tuple[str, ...]
    largest: int = 10**9

    @property
    def sweeps(self):
        return "eps_abs" in self.options

    def takes(self, case):
        """Tell whether the method is tried: sweep methods do not scale."""
        sizes = np.abs(np.append(case.q, case.A.sum()))
        ordinary = not sizes.any() or 1e-100 < sizes.max() < 1e100
        return case.q.size <= self.largest and (ordinary or not self.sweeps)

    def promises(self, name):
        if self.options["method"] == "lemke" and name in EXPONENTIAL:
            return False
        return CASES[name].truth in self.answers


EVERYTHING = "dominant", "P", "semidefinite", "copositive", "general", "unsolvable"
AUTO, LEMKE = {"method": "auto"}, {"method": "lemke"}


def sweeping(method, **parameters):
    return {"method": method, "eps_abs": EPS} | parameters


METHODS = {
    "auto": Way(AUTO, lambda A: A, EVERYTHING),
    "auto, dense": Way(AUTO, lambda A: A.toarray(), EVERYTHING, 300),
    "auto, csr": Way(AUTO, sparse.csr_array, EVERYTHING),
    "auto, prepared": Way(AUTO, Prepared, EVERYTHING),
    "mprgp": Way(AUTO, aslinearoperator, (), 60),
    "multigrid": Way({"method": "multigrid"}, lambda A: A, (), 60),
    "lemke": Way(LEMKE, lambda A: A, ("dominant", "P", "copositive"), 160),
    "lemke, csr": Way(LEMKE, sparse.csr_array, ("dominant", "P", "copositive"), 40),
} | {
    f"{method}{', auto' * bool(given)}": Way(
        sweeping(method, **given), lambda A: A, ("dominant",), 30
    )
    for method in TAKES
    for given in ([{}, auto(method)] if auto(method) else [{}])
}

REFUSALS = "positive diagonal|does not suit|be regular in|must be symmetric as a Lin"
ALREADY = ("auto, dense", False), ("auto, csr", True)
"""What "auto" does anyway: a way, and whether A is sparse."""


def pairs(promised):
    """Return the names of cases and methods that promise an answer, or that do not."""
    return [
        (name, way)
        for name, case in CASES.items()
        for way in METHODS
        if METHODS[way].takes(case)
        and (way, sparse.issparse(case.A)) not in ALREADY
        and METHODS[way].promises(name) == promised
    ]


OTHERS = {
    name: [way for _, way in ways]
    for name, ways in groupby(pairs(False), key=itemgetter(0))
}


def assert_answer(result, case, way):
    """What is said is true."""
    A, q, lower, upper = case.data
    if result.status is Status.SOLVED and way.sweeps:
        assert result.residual < EPS
    elif result.status is Status.SOLVED:
        assert case.truth != "unsolvable"
        assert relative_residual(A, q, result.z, lower, upper) <= RELATIVE
    elif result.status is Status.UNSOLVABLE:
        assert case.truth not in HAVE_SOLUTIONS
        if result.ray is None:
            assert "enumerated" in result.message
        else:
            # that of a LinearOperator is known by products alone
            cancels = 1e-8 if result.method == "mprgp" else CANCELS
            assert_proves_unsolvable(result.ray, A, q, lower, upper, cancels)
    if result.status is Status.NUMERICAL_ERROR:
        assert np.isnan(result.z).all()
    else:
        assert_consistent(result, A, q, lower, upper)


def solve(case, way):
    return solve_lcp(way.given(case.A), *case.data[1:], **way.options)


@pytest.mark.parametrize(("name", "way"), pairs(True))
def test_promised_answers(name, way):
    case, way = CASES[name], METHODS[way]
    result = solve(case, way)
    assert_answer(result, case, way)
    wanted = Status.UNSOLVABLE if case.truth == "unsolvable" else Status.SOLVED
    assert result.status is wanted, result.message
    assert (result.ray is not None) == (wanted is Status.UNSOLVABLE)
    if name.startswith("friction") and way.options is AUTO:
        assert result.residual < 1e-11 * np.abs(case.q).max()
    if case.z is not None:
        size = 1.0 + np.abs(case.z).max(initial=0.0)
        np.testing.assert_allclose(result.z, case.z, rtol=1e-4, atol=1e-7 * size)


@pytest.mark.parametrize("name", OTHERS)
def test_no_method_says_what_is_not_true(name):
    """Beyond its promises a method may refuse, or leave the LCP undecided."""
    for other in OTHERS[name]:
        way = METHODS[other]
        way = way._replace(options=BRIEF | way.options)
        try:
            result = solve(CASES[name], way)
        except ValueError as error:
            if not re.search(REFUSALS, str(error)):
                raise
        else:
            assert_answer(result, CASES[name], way)
