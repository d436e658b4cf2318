"""Classes of the campaign that ask for one answer in two ways, which must agree.

- sequences: a `Solver` through some changes of a fuzzed QP; every step beside a fresh
  solve.
- batches: fuzzed QPs of one size by `solve_batch`, on one thread and on two, with a
  malformed item among some; every item beside a single solve.
- derivatives: beside differences, on problems around planted solutions
  (`derivatives.differences`), and one-sided ones of fuzzed QPs.
- closest: the closest feasible problem of infeasible QPs, by the definition.

What the fresh or single solve has proved, by the judge's definition, is true of a QP;
the other answer is judged by the definition, and by that. At the edge of the tolerances
(P with eigenvalues of 1e-8, nearly feasible rows) a solution and a proof that there is
none may both hold by the definition: where the two answers differ so, one is refused.
"""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import scipy.sparse as sp

import namlcp
from namlcp.qp.problem import QP
from validation.derivatives import cases as planted
from validation.derivatives import differences
from validation.problems.fuzzed import cases, draw, qps
from validation.stress import campaign_judge as judge
from validation.stress.campaign_answers import clean, qp_answer
from validation.stress.campaign_judge import NAM, Answer, Verdict

STEPS = 6  # solves of a sequence
ITEMS = 5  # QPs of a batch
MALFORMED = 0.3  # share of the batches with such an item
DIFFERENCE = 1e-4  # relative error of a one-sided difference
LENGTHS = 1e-2, 1e-4, 1e-6  # by which x moves for it: x is piecewise linear, and rounds
SOFT = namlcp.Relaxation(lb=1.0, ub=1.0)
CHOICES = ("closest", 2, True), ("elastic", 1, True), (SOFT, 2, False)
"""What is asked for, the norm of the shifts, and whether bounds stay."""
Check = Callable[[int, int], Verdict]
RIGHT = "right", ""


def answer_of(solve: Callable[[], namlcp.QPResult]) -> Answer:
    try:
        return qp_answer(solve())
    except Exception as error:
        return Answer("error", words=f"{type(error).__name__}: {error}")


def agreement(qp: QP, alone: Answer, other: Answer) -> Verdict:
    """Return the outcome of `other`, beside the answer of a solve of this QP alone."""
    if alone.said == "error":  # not convex by rounding
        silent = other.said in ("error", "refused")
        return RIGHT if silent else ("wrong", f"{other.said}, alone: {alone.words}")
    outcome, why = judge.judge_qp(clean(qp), "near", alone, NAM, proofs=True)
    if outcome == "wrong":
        return outcome, f"alone: {why}"
    truth = "near"
    if outcome == "right":
        truth = "solvable" if alone.said == "solved" else "both"
    outcome, why = judge.judge_qp(clean(qp), truth, other, NAM, proofs=True)
    if outcome == "refused" and truth == "near":
        return RIGHT
    if outcome == "wrong" and why == f"called {other.said}":
        return "refused", f"alone {alone.said}, here {other.said}: both hold"
    return outcome, why


def sequence(maker: cases.Maker, d: draw.Draw) -> Verdict:
    old, (qp, _) = None, maker(d)
    wrap = sp.csc_array if d.chance(0.4) else np.asarray
    given: dict[str, Any] = {}
    for step in range(STEPS + 1):
        given |= {
            name: wrap(value) if value.ndim == 2 else value
            for name, value in qp._asdict().items()
            if value is not getattr(old, name, None)
        }
        alone = partial(namlcp.solve_qp, **given)
        try:
            if step == 0:
                solver = namlcp.Solver(**given)
            else:
                solver.update(**given)
        except ValueError as error:
            return agreement(qp, answer_of(alone), Answer("error", words=str(error)))
        if step < STEPS:
            outcome, why = agreement(qp, answer_of(alone), answer_of(solver.solve))
            if outcome != "right":
                return outcome, f"step {step}: {why}"
            old, qp = qp, qps.changed(d, qp)
    return RIGHT


def batch(maker: cases.Maker, d: draw.Draw) -> Verdict:
    """Solve QPs of one size at once; what all share is passed once, or N times."""
    items = [maker(d)[0]]
    change = qps.changed if d.chance(0.5) else qps.moved_vectors
    items += [change(d, items[0]) for _ in range(ITEMS - 1)]
    arguments, stacked = {}, False
    for name, values in zip(QP._fields, zip(*items, strict=True), strict=True):
        same = all(value is values[0] for value in values)
        once = same and d.chance(0.7)
        arguments[name] = values[0] if once else np.stack(values)
        stacked = stacked or not once
    bad = int(d.rng.integers(ITEMS)) if d.chance(MALFORMED) else None
    if bad is not None or not stacked:  # one argument at least has a batch axis
        arguments["q"] = np.stack([item.q for item in items])
    if bad is not None:
        arguments["q"][bad, -1] = np.nan
    singles = [answer_of(partial(namlcp.solve_qp, *item)) for item in items]
    try:
        one, two = (namlcp.solve_batch(**arguments, threads=k) for k in (1, 2))
    except ValueError as error:
        shared = all(alone.said == "error" for alone in singles)
        return RIGHT if shared else ("raised", str(error))
    for name in ("codes", "x", "y", "z", "z_box", "obj"):
        if getattr(one, name).tobytes() != getattr(two, name).tobytes():
            return "wrong", f"{name} of two runs, on one thread and on two, differ"
    for k, (item, alone) in enumerate(zip(items, singles, strict=True)):
        if k == bad:
            said = one[k].status
            known = said is namlcp.Status.INVALID
            outcome, why = RIGHT if known else ("wrong", f"malformed: {said.value}")
        else:
            outcome, why = agreement(item, alone, qp_answer(one[k]))
        if outcome != "right":
            return outcome, f"item {k}: {why}"
    return RIGHT


def one_sided(qp: QP, direction: planted.Kept) -> Verdict:
    """Compare the one-sided derivative of x, which is unique, with differences."""
    result = namlcp.solve_qp(*qp)
    if result.status is not namlcp.Status.SOLVED:
        return "refused", result.status.value
    try:
        found = result.directional(**{f"d{k}": v for k, v in direction.items()}).x
    except ValueError as error:  # "the solution has no derivative along this ..."
        return "refused", str(error)
    size = 1.0 + np.abs(found).max()
    errors = []
    for length in LENGTHS:
        t = length / size
        moved = namlcp.solve_qp(*planted.moved(qp, direction, t))
        errors.append(np.abs((moved.x - result.x) / t - found).max() / size)
    if min(errors) <= DIFFERENCE:
        return RIGHT
    return "wrong", f"off by {min(errors):.1e}"


def derivative(maker: cases.Maker, d: draw.Draw) -> Verdict:
    qp, _ = maker(d)
    return one_sided(qp, {"q": d.numbers(qp.q.size)})


def at_kink(family: Callable[[int], QP], seed: int, number: int) -> Verdict:
    number, names = 10**7 * seed + number, planted.KINKS[family]
    qp = family(number)
    return one_sided(qp, planted.direction(qp, number, names[number % len(names)]))


def regular(about: tuple[str, str], seed: int, number: int) -> Verdict:
    function, right = differences.FAMILIES[about]
    error, gap = function(10**7 * seed + number)
    if error <= right and gap <= differences.ADJOINT:
        return RIGHT
    return "wrong", f"off by {error:.1e}, adjoint by {gap:.1e}"


def closest(maker: cases.Maker, d: draw.Draw) -> Verdict:
    """Judge a closest point; nothing if the QP is feasible."""
    qp, _ = maker(d)
    choice, norm, bounds_stay = CHOICES[int(d.rng.integers(len(CHOICES)))]
    wrap = sp.csc_array if d.chance(0.5) else np.asarray
    given = {k: wrap(v) if v.ndim == 2 else v for k, v in qp._asdict().items()}
    result = namlcp.solve_qp(**given, infeasible=choice)
    if result.closest is None:
        return RIGHT
    verdict = judge.judge_qp(clean(qp), "both", qp_answer(result), NAM, proofs=True)
    if verdict != RIGHT:
        return verdict
    return judge.judge_closest(clean(qp), norm, bounds_stay, result.closest)


def drawn(check: Any, maker: cases.Maker, seed: int, number: int) -> Verdict:
    with np.errstate(invalid="ignore", over="ignore"):
        return check(maker, draw.Draw(np.random.default_rng([seed, number, 1])))


def of_fuzzed(check: Any, makers: tuple[cases.Maker, ...]) -> dict[str, Check]:
    kinds = {maker.__name__.replace("_", " "): maker for maker in makers}
    name = check.__name__
    return {f"{name} {kind}": partial(drawn, check, kinds[kind]) for kind in kinds}


RELATIONS: dict[str, dict[str, Check]] = {
    "sequences": of_fuzzed(sequence, cases.CONVEX),
    "batches": of_fuzzed(batch, cases.CONVEX),
    "derivatives": {
        "derivative QP": partial(regular, ("QP", "all")),
        "derivative LCP": partial(regular, ("LCP", "all")),
        "derivative weak lcp": partial(regular, ("weak_lcp", "A, q")),
        **{
            f"derivative {family.__name__.replace('_', ' ')}": partial(at_kink, family)
            for family in planted.KINKS
        },
        **of_fuzzed(derivative, (qps.strictly_convex, qps.condition_1e8)),
    },
    "closest": of_fuzzed(closest, (qps.infeasible, qps.both, qps.wild)),
}
"""The classes by the name of their set, each a check by its name; problem i of a set is
of its class number i modulo their number."""


def class_of(i: int, name: str) -> str:
    return list(RELATIONS[name])[i % len(RELATIONS[name])]


def examine(seed: int, i: int, name: str) -> Verdict:
    return RELATIONS[name][class_of(i, name)](seed, i // len(RELATIONS[name]))
