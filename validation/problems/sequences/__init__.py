"""Sequences of QPs with the same matrices, as a loop meets them; nothing here solves.

`SCENES` has a maker of each by name: make(size, level) with one of its `sizes` and of
LEVELS, which says how far the active set moves from a step to the next.
"""

from validation.problems.sequences.control import (
    LEVELS,
    Scene,
    Sequence,
    condensed,
    single,
    stagewise,
    stagewise_definite,
)
from validation.problems.sequences.scenes import penalty_path, rebalancing, shaken_heap

SCENES = {
    "condensed MPC": Scene(condensed, (5, 10, 25), "stages"),
    "sparse MPC": Scene(stagewise, (10, 30, 60), "stages"),
    "sparse MPC, definite": Scene(stagewise_definite, (10, 30, 60), "stages"),
    "portfolio": Scene(rebalancing, (50, 200, 500), "assets"),
    "lasso path": Scene(penalty_path, (10, 50, 200), "features"),
    "contact": Scene(shaken_heap, (30, 120, 500), "contacts"),
}
