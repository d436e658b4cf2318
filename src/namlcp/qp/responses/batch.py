"""Many dense QPs of the same sizes in few compiled calls, each from nothing.

An item's answer has the same bits whichever items are solved before it, and by whatever
thread: it starts without active rows, and responses depend on the matrices alone.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from namlcp.compiled import address_of
from namlcp.options import Options
from namlcp.qp.problem import QP
from namlcp.qp.responses.active import DONE
from namlcp.qp.responses.judgement import NUMBERS
from namlcp.qp.responses.run import run
from namlcp.qp.responses.solve import MOST_ORDER, NO_NUMBERS, DenseResponses

# Operations of one call at most, about: until its end Ctrl-C is not seen.
MOST_WORK = 1e8


class Solutions(NamedTuple):
    """What `run` has found for some items of a stack: one row of each array an item.

    `numbers` are those of `Residuals`. An item that is not `solved` is left to other
    methods, and its rows mean nothing.
    """

    solved: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    numbers: np.ndarray
    pivots: np.ndarray


class Stack:
    """Items of a batch; several threads may solve some of them each."""

    def __init__(self, shared: QP, stacked: Mapping[str, np.ndarray]):
        """Take clean arrays, those in `stacked` instead of the shared.

        The former have one more axis, in front. Numbers are checked by the solve.
        """
        self.arrays = {**shared._asdict(), **stacked}
        self.stacked = stacked
        self.first = tuple(
            stacked[name][0] if name in stacked else getattr(shared, name)
            for name in "PGA"
        )
        n, m, p = (M.shape[0] for M in self.first)
        self.ends = np.cumsum((n, p, m, n))  # of x, y, z and z_box in a row of `out`
        work = 4.0 * (n + m) * n * (2 * n + m + p)  # as many pivots as rows
        self.most_items = max(int(MOST_WORK / work), 1)  # of one call

    @staticmethod
    def takes(shared: QP) -> bool:
        """Tell whether QPs like this one are solved by responses."""
        return (
            shared.is_dense
            and sum(v.size for v in (shared.q, shared.h, shared.b)) <= MOST_ORDER
        )

    def solve(self, start: int, end: int, options: Options) -> Solutions:
        """Solve items start to end - 1, in work space of their own."""
        out = np.empty((end - start, self.ends[-1] + NUMBERS))
        ended = np.empty((end - start, 2), dtype=np.int64)
        space = DenseResponses(*self.first)
        now = space.now
        now.is_single = True
        for name, array in self.arrays.items():
            step = array.strides[0] if name in self.stacked else 0
            setattr(now, f"{name}_step", step)
            setattr(now, name, address_of(array) + start * step)
        now.out, now.out_step = address_of(out), out.strides[0]
        now.codes = address_of(ended)
        space.limit(options.limits())
        for first in range(start, end, self.most_items):
            now.items_left = min(end - first, self.most_items)
            run(space.address, NO_NUMBERS, NO_NUMBERS, 0)
        x, y, z, z_box, numbers = np.hsplit(out, self.ends)
        return Solutions(
            ended[:, 0] == DONE, x, y, z, z_box, numbers, pivots=ended[:, 1]
        )
