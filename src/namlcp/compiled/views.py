"""Views of arrays without a reference count, where numba is known, see `decorators`."""

from typing import Any

import numba
from numba import config

from namlcp.compiled.decorators import is_known


def itself(array: Any) -> Any:
    """Return the array."""
    return array


def chosen_view() -> Any:
    """Return the function `uncounted` of `internals`, or one that does nothing."""
    if config.DISABLE_JIT:
        return itself
    if is_known():
        from namlcp.compiled import internals

        return internals.uncounted
    return numba.njit(itself)


uncounted = chosen_view()
