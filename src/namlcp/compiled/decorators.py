"""Which compiler and which cache a function gets: ours, or numba's own.

Ours uses inner parts of numba (`internals`), which every new version may change. With
an unknown version, functions get numba's own compiler and cache, in a folder with the
package's stamp in its name: they load more slowly, and are never out of date.
"""

import os
from collections.abc import Callable
from typing import Any

import numba
from numba import config

from namlcp.compiled.store import folders

KNOWN_VERSIONS = (0, 59), (0, 68)
"""First and last version of numba whose inner parts are those of `internals`."""

KERNELS: dict[str, Any] = {}
"""All kernels by name, as far as their modules were imported."""


def is_known() -> bool:
    """Tell whether the inner parts of this version of numba are known."""
    return KNOWN_VERSIONS[0] <= tuple(numba.version_info[:2]) <= KNOWN_VERSIONS[1]


def compiled(
    function: Callable[..., Any], is_part: bool = False, **options: Any
) -> Any:
    """Return the numba dispatcher of a function."""
    if config.DISABLE_JIT:
        return function
    if is_part:
        options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    is_kernel = not (is_part or options.get("inline"))
    name = name_of(function)
    if is_known():
        from namlcp.compiled.internals import dispatcher_of

        dispatcher = dispatcher_of(function, name, is_part, is_kernel, **options)
    else:
        dispatcher = numba.njit(**options)(function)
        if is_kernel:
            use_numbas_cache(dispatcher)
    if is_kernel:
        KERNELS[name] = dispatcher
    return dispatcher


def name_of(function: Callable[..., Any]) -> str:
    """Return the name of a function: its module's within the package, and its own."""
    module = function.__module__.removeprefix("namlcp.")
    return f"{module}.{function.__qualname__}"


def use_numbas_cache(dispatcher: Any) -> None:
    """Give a dispatcher numba's own cache, in a folder of this stamp."""
    before = config.CACHE_DIR
    for folder in folders():
        try:
            if folder.prepare():
                os.chmod(folder.path, 0o700)  # numba looks at no permissions
                config.CACHE_DIR = str(folder.path)
                dispatcher.enable_caching()
                return
        except Exception:  # nowhere to write, or no such cache: compiled each time
            continue
        finally:
            config.CACHE_DIR = before


def is_at_hand(dispatcher: Any) -> bool:
    """Tell whether a kernel has machine code, in memory or in a file, or needs none.

    With a numba that is not known nobody can tell: True, so that nothing is announced.
    """
    if getattr(dispatcher, "signatures", True) or not is_known():
        return True
    return dispatcher._cache.is_at_hand()


def compile_time() -> float:
    """Return the seconds this process has spent compiling the package's functions.

    0 where this version of numba is not known.
    """
    if not is_known():
        return 0.0
    from namlcp.compiled.internals import CLOCK

    return CLOCK.total
