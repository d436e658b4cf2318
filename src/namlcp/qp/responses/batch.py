"""Many dense QPs of the same sizes in few compiled calls, each from nothing.

An item's answer has the same bits whichever items are solved before it, and by whatever
thread: it starts without active rows, and responses depend on the matrices alone.
"""

from collections.abc import Mapping

import numpy as np

from namlcp.options import Options
from namlcp.qp.problem import QP
from namlcp.qp.responses.active import DONE
from namlcp.qp.responses.judgement import NUMBERS
from namlcp.qp.responses.run import run
from namlcp.qp.responses.solve import MOST_ORDER, NO_NUMBERS, DenseResponses

# Operations of one call at most, about: until its end Ctrl-C is not seen.
MOST_WORK = 1e8


class Stack:
    """Items of a batch, and room for their results.

    ``x``, ``y``, ``z``, ``z_box``, ``numbers`` (those of `Residuals`) and ``pivots``
    have one row for each item; they hold a solution where `is_solved`.
    """

    def __init__(self, shared: QP, stacked: Mapping[str, np.ndarray], size: int):
        """Take `size` items: clean arrays, those in `stacked` instead of the shared.

        The former have one more axis, in front. Numbers are checked by the solve.
        """
        self.arrays = {**shared._asdict(), **stacked}
        self.stacked = stacked
        self.first = tuple(
            stacked[name][0] if name in stacked else getattr(shared, name)
            for name in "PGA"
        )
        n, m, p = (M.shape[0] for M in self.first)
        self.out = np.empty((size, 2 * n + m + p + NUMBERS))
        self.ended = np.empty((size, 2), dtype=np.int64)
        ends = np.cumsum((n, p, m, n))
        self.x, self.y, self.z, self.z_box, self.numbers = np.hsplit(self.out, ends)
        self.pivots = self.ended[:, 1]
        work = 4.0 * (n + m) * n * (2 * n + m + p)  # as many pivots as rows
        self.length = max(int(MOST_WORK / work), 1)

    @staticmethod
    def takes(shared: QP) -> bool:
        """Tell whether QPs like this one are solved by responses."""
        return (
            shared.is_dense
            and sum(v.size for v in (shared.q, shared.h, shared.b)) <= MOST_ORDER
        )

    def solve(self, start: int, end: int, options: Options) -> None:
        """Solve items start to end - 1, in work space of their own."""
        space = DenseResponses(*self.first)
        space.now.is_single = True
        now, arrays = space.now, {**self.arrays, "out": self.out}
        for name, array in arrays.items():
            is_stacked = name in self.stacked or name == "out"
            step = array.strides[0] if is_stacked else 0
            setattr(now, f"{name}_step", step)
            setattr(now, name, address_of(array) + start * step)
        now.codes = address_of(self.ended) + start * self.ended.strides[0]
        space.limit(options.limits())
        while start < end:
            now.items_left = min(end - start, self.length)
            start += now.items_left
            run(space.address, NO_NUMBERS, self.out.ravel(), 0)

    def is_solved(self) -> np.ndarray:
        """Tell which items are solved; all others are left to other methods."""
        return self.ended[:, 0] == DONE


def address_of(array: np.ndarray) -> int:
    """Return where the entries of an array begin."""
    return array.__array_interface__["data"][0]
