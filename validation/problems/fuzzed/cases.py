"""Problem number i of the campaign: its class, the arguments, and what is true of it.

Problem i of a seed is made from (seed, i) alone. Its class is that in place i mod their
number of a cycle in CYCLES, so that every class gets its share of any run.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from validation.problems.fuzzed import lcps, qps
from validation.problems.fuzzed.draw import Draw
from validation.problems.fuzzed.forms import dress, spoil

Maker = Callable[[Draw], tuple[Any, str]]


class Case(NamedTuple):
    """A QP or LCP, clean and dense, and as it is passed, with what is true of it.

    truth: as `qps` and `lcps` have it; of malformed input the name of the argument.
    """

    group: str
    truth: str
    problem: Any
    arguments: dict[str, Any]


# The classes that peers are asked, of these the ones with a definite P (quadprog wants
# that), and those that nam alone is asked.
CONVEX: tuple[Maker, ...] = (
    qps.strictly_convex, qps.semidefinite_cost, qps.linear_program, qps.condition_1e8,
    qps.nearly_singular_cost, qps.diagonal_cost, qps.bounds_alone, qps.degenerate,
    qps.redundant, qps.modelled, qps.large_sparse, qps.scaled, qps.extreme_scales,
    qps.infeasible, qps.unbounded, qps.both, qps.wild,
)  # fmt: skip
DEFINITE = (qps.strictly_convex, qps.condition_1e8)
OTHER_QPS: tuple[Maker, ...] = (
    qps.huge_sides, qps.empty, qps.infinite_side, qps.nearly_feasible,
    qps.rounded_cost, qps.not_convex,
)  # fmt: skip
LCPS: tuple[Maker, ...] = (
    lcps.positive_definite, lcps.positive_semidefinite, lcps.degenerate_pairs,
    lcps.h_plus, lcps.m_matrix, lcps.singular_z, lcps.other_z, lcps.quotient,
    lcps.triangular, lcps.skew_and_definite, lcps.optimality, lcps.zero_or_diagonal,
    lcps.tridiagonal, lcps.strictly_copositive, lcps.general, lcps.general_box,
    lcps.anything, lcps.scaled, lcps.extreme_scales, lcps.unsolvable,
    lcps.unsolvable_skew, lcps.empty,
)  # fmt: skip
MALFORMED = ("malformed QP", "malformed LCP")
OFTEN = (qps.strictly_convex, qps.semidefinite_cost, qps.infeasible, qps.unbounded)
CLASSES = (*CONVEX, *OFTEN, *OTHER_QPS, *LCPS, *MALFORMED)

CYCLES: dict[str, tuple[Maker | str, ...]] = {
    "every": CLASSES,
    "general": (lcps.friction, lcps.game, lcps.strictly_copositive, lcps.copositive,
                lcps.unsolvable_general),
    "values": (qps.at_bounds, qps.far_scales, qps.single_precision, lcps.far_scales),
}  # fmt: skip
"""The classes of a run by name: those of every kind; LCPs that are neither P nor
semidefinite; and those of values: at bounds, far apart, of single precision."""


def kind_of(i: int, cycle: str = "every") -> Maker | str:
    return CYCLES[cycle][i % len(CYCLES[cycle])]


def group_of(i: int, cycle: str = "every") -> str:
    kind = kind_of(i, cycle)
    if isinstance(kind, str):
        return kind
    is_lcp = kind in LCPS or cycle == "general" or kind is lcps.far_scales
    return f"{'LCP' if is_lcp else 'QP'} {kind.__name__.replace('_', ' ')}"


def make(seed: int, i: int, cycle: str = "every") -> Case:
    rng = np.random.default_rng([seed, i])
    draw = Draw(rng)
    kind, group = kind_of(i, cycle), group_of(i, cycle)
    if isinstance(kind, str):
        maker = qps.strictly_convex if kind == MALFORMED[0] else lcps.positive_definite
        problem, _ = maker(draw)
        arguments, truth = spoil(rng, problem._asdict())
        return Case(group, truth, problem, arguments)
    with np.errstate(invalid="ignore", over="ignore"):
        problem, truth = kind(draw)
    return Case(group, truth, problem, dress(rng, problem._asdict()))
