"""The choice of compiler and cache: those of the package, or those of numba.

Those of the package use private parts of numba (`internals`, `compiler`, `passes`,
`lowering`, `functions`), which every new version may change. With an unknown version,
functions get numba's own compiler and cache, in a folder named by the stamp: they load
more slowly, and are never out of date.
"""

import os
from collections.abc import Callable
from typing import Any

import numba
from numba import config

from namlcp.compiled.store import folders

KNOWN_VERSIONS = (0, 59), (0, 68)
"""First and last version of numba that both were written for."""

KERNELS: dict[str, Any] = {}
"""Dispatchers of the kernels of all imported modules, by `name_of`."""


def is_known() -> bool:
    """Tell whether our compiler and cache were written for this version of numba."""
    return KNOWN_VERSIONS[0] <= tuple(numba.version_info[:2]) <= KNOWN_VERSIONS[1]


def compiled(
    function: Callable[..., Any], is_part: bool = False, **options: Any
) -> Any:
    """Return a function's numba dispatcher; with NUMBA_DISABLE_JIT the function."""
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
    """Return module and name of a function, without the leading "namlcp."."""
    module = function.__module__.removeprefix("namlcp.")
    return f"{module}.{function.__qualname__}"


def use_numbas_cache(dispatcher: Any) -> None:
    """Enable numba's own cache for a dispatcher, in the first folder that allows it."""
    before = config.CACHE_DIR
    for folder in folders():
        try:
            if folder.prepare():
                os.chmod(folder.path, 0o700)  # numba does not check who may write
                config.CACHE_DIR = str(folder.path)
                dispatcher.enable_caching()
                return
        except Exception:  # not writeable, or numba has changed
            continue
        finally:
            config.CACHE_DIR = before


def is_at_hand(dispatcher: Any) -> bool:
    """Tell whether a kernel has machine code, in memory or in a file, or needs none.

    True with an unknown numba, so that no compilation is announced by mistake.
    """
    if getattr(dispatcher, "signatures", True) or not is_known():
        return True
    return dispatcher._cache.is_at_hand()


def compile_time() -> float:
    """Return the seconds this process has spent compiling; 0 with an unknown numba."""
    if not is_known():
        return 0.0
    from namlcp.compiled.internals import CLOCK

    return CLOCK.total
