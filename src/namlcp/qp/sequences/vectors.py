"""The vectors of a QP in one array, as `QP.joined` makes it."""

from typing import Any

import numpy as np

from namlcp.checks import refuse_number, without_huge
from namlcp.qp.problem import QP, refuse_steep_rows

Places = dict[str, tuple[slice, tuple[int]]]

SIZED_LIKE = {"q": "P", "h": "G", "b": "A", "lb": "P", "ub": "P"}
"""The argument that sets the size of a vector; in the order of `QP.joined`."""

INFINITIES = {"q": 0, "h": 1, "b": 0, "lb": -1, "ub": 1}
"""The sign of the infinity that means "no bound", 0 where all entries are finite."""


def places_of(qp: QP) -> Places:
    """Return where each vector is, and its shape."""
    places: Places = {}
    end = 0
    for name in SIZED_LIKE:
        size = getattr(qp, name).size
        places[name] = slice(end, end + size), (size,)
        end += size
    return places


def clean(vectors: np.ndarray, places: Places, G: Any) -> None:
    """Make huge sides infinite; raise where a number is not allowed."""
    refuse_steep_rows(G, vectors[places["h"][0]])
    for name, (place, _) in places.items():
        infinity = INFINITIES[name]
        refuse_number(name, vectors[place], infinity != 0)
        if infinity:
            vectors[place] = without_huge(vectors[place], infinity)
