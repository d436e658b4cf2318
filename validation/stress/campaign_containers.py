"""A class of the campaign: the containers in which people bring their numbers.

Every public function must solve the problem, or prove that there is no solution, where
they hold the numbers exactly; others are refused in a line that names the argument.
"""

from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
import qpsolvers

import namlcp
from namlcp.qpsolvers import nam_solve_problem
from validation.problems.fuzzed import cases, draw
from validation.stress.campaign_answers import (
    NAM,
    NAM_LCP,
    SAID,
    clean,
    lcp_answer,
    qp_answer,
)
from validation.stress.campaign_judge import Answer, judge_lcp, judge_qp

REFUSED = 0.3  # share of the problems with an argument that is to be refused
DRESSED = 0.7  # share of the arguments in an odd container
LONGEST = 300  # letters of a message
Arguments = dict[str, Any]


class Like:
    """What numpy.asarray takes, and nothing else does."""

    def __init__(self, values: np.ndarray, **attributes: Any) -> None:
        self.values, self.ndim, self.shape = values, values.ndim, values.shape
        vars(self).update(attributes)

    def __array__(self, *_: Any, **__: Any) -> np.ndarray:
        """Return a new array."""
        return self.values.copy()


def objects(values: np.ndarray, kind: Callable[[float], Any]) -> np.ndarray:
    """Return an array of objects, of this kind where they are finite."""
    parts = [kind(v) if np.isfinite(v) else v for v in values.ravel().tolist()]
    return np.array(parts, object).reshape(values.shape)


def whole(value: float) -> Any:
    """Return a number as an int if it is one."""
    return int(value) if value.is_integer() else Fraction(value)


try:
    import pandas as pd
except ImportError:
    framed: tuple[Callable[[np.ndarray], Any], ...] = ()
else:  # of the type that knows absent values
    framed = (
        lambda values: (pd.DataFrame if values.ndim == 2 else pd.Series)(
            values, dtype="Float64"
        ),
    )

EXACT: tuple[Callable[[np.ndarray], Any], ...] = (
    np.ma.array,
    lambda values: np.ma.array(values, mask=np.zeros(values.shape, bool)),
    lambda values: objects(values, Fraction),
    lambda values: objects(values, Decimal),
    lambda values: objects(values, whole),
    lambda values: Like(objects(values, whole)),
    Like,
    memoryview,
    *framed,
)
"""Containers of all the numbers."""


def one_of(values: np.ndarray, entry: Any) -> Any:
    """Return the values as objects with another first entry."""
    spoiled = objects(values, float)
    spoiled.flat[0] = entry
    return spoiled


LOSSY: tuple[Callable[[np.ndarray], Any], ...] = (
    lambda values: (
        np.ma.array(values, mask=np.arange(values.size) == 0)
        if values.ndim == 1
        else np.ma.masked_less_equal(values, values.max())
    ),
    *(
        partial(one_of, entry=entry)
        for entry in (Fraction(1, 3), Decimal("0.1"), 10**400, None, "1.0", 1j)
    ),
    lambda values: Like(values, requires_grad=True),
)
"""Containers that have not all of them, as float64."""


def dressed(d: draw.Draw, arguments: Arguments) -> Arguments:
    """Return the arguments, some of them in containers."""
    chosen = dict(arguments)
    for name, values in arguments.items():
        if d.chance(DRESSED) and values.size:
            chosen[name] = EXACT[int(d.rng.integers(len(EXACT)))](values)
    for name in chosen.keys() & {"lb", "ub", "lower", "upper"}:
        values = arguments[name]
        if values.size and (values == values[0]).all() and d.chance(0.5):
            chosen[name] = float(values[0])
    return chosen


def spoiled(d: draw.Draw, arguments: Arguments) -> tuple[Arguments, str]:
    """Return the arguments with one that is to be refused, and its name."""
    names = [name for name, values in arguments.items() if values.size]
    name = str(d.rng.choice(names))
    kind = LOSSY[int(d.rng.integers(len(LOSSY)))]
    return dressed(d, arguments) | {name: kind(arguments[name])}, name


def by_solver(**arguments: Any) -> namlcp.QPResult:
    """Solve by a `Solver` that has been updated."""
    solver = namlcp.Solver(**arguments)
    names = ("q", "h", "b", "lb", "ub")
    solver.update(**{name: arguments[name] for name in names})
    return solver.solve()


def by_qpsolvers(**arguments: Any) -> Answer:
    """Solve through qpsolvers, which asks every argument for its `ndim`."""
    arrays = {
        name: value if hasattr(value, "ndim") else np.asarray(value)
        for name, value in arguments.items()
    }
    found = nam_solve_problem(qpsolvers.Problem(**arrays))
    said = SAID.get(found.extras["status"], "refused")
    proof = found.extras.get("certificate", {})
    x, y, z, z_box = (proof.get(k, getattr(found, k)) for k in ("x", "y", "z", "z_box"))
    if np.size(z_box) == 0:  # no bounds came
        z_box = np.zeros(arrays["q"].size)
    return Answer(said, x, y, z, z_box, found.extras["status"])


QP_DOORS: tuple[Callable[..., Any], ...] = (
    namlcp.solve_qp,
    by_solver,
    lambda **arguments: namlcp.solve_batch(**arguments)[0],
    by_qpsolvers,
)
LCP_DOORS: tuple[Callable[..., Any], ...] = (
    namlcp.solve_lcp,
    lambda A, **arguments: namlcp.solve_lcp(namlcp.Prepared(A), **arguments),
)


def told(
    d: draw.Draw, doors: tuple[Callable[..., Any], ...], arguments: Arguments
) -> tuple[Answer, str]:
    """Return the answer of some function, and the argument that it must refuse."""
    door = doors[int(d.rng.integers(len(doors)))]
    wrong = ""
    if d.chance(REFUSED):
        arguments, wrong = spoiled(d, arguments)
    else:
        arguments = dressed(d, arguments)
    try:
        found = door(**arguments)
    except Exception as error:
        return Answer("error", words=str(error), kind=type(error)), wrong
    if isinstance(found, namlcp.LCPResult):
        return lcp_answer(found), wrong
    return found if isinstance(found, Answer) else qp_answer(found), wrong


def refusal(answer: Answer, name: str) -> tuple[str, str]:
    """Return the outcome where an argument is to be refused, and why."""
    if answer.said != "error":
        return "wrong", f"{name} not refused: {answer.said}"
    short = "\n" not in answer.words and len(answer.words) <= LONGEST
    if short and answer.words.startswith(f"{name} "):
        return "right", ""
    return "raised", f"{name}: {answer.words}"


def containers(maker: cases.Maker, d: draw.Draw) -> tuple[str, str]:
    """Return the outcome for a QP, and why it is not right."""
    qp, truth = maker(d)
    answer, wrong = told(d, QP_DOORS, qp._asdict())
    if wrong:
        return refusal(answer, wrong)
    judge = partial(judge_qp, clean(qp), truth, tolerance=NAM, proofs=True)
    outcome = judge(answer=answer)
    if outcome[0] != "right":  # what clean arrays do, too, other classes judge
        alone = judge(answer=qp_answer(namlcp.solve_qp(*qp)))
        return ("right", "") if alone == outcome else outcome
    return outcome


def lcp_containers(maker: cases.Maker, d: draw.Draw) -> tuple[str, str]:
    """Return the outcome for an LCP, and why it is not right."""
    lcp, truth = maker(d)
    answer, wrong = told(d, LCP_DOORS, lcp._asdict())
    return refusal(answer, wrong) if wrong else judge_lcp(lcp, truth, answer, NAM_LCP)
