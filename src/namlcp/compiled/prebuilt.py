"""Compile every kernel for a baseline processor, for a wheel with machine code."""

import os
import platform
import shutil
import tempfile
from pathlib import Path

import numba

from namlcp.compiled.ahead import compile_all
from namlcp.compiled.decorators import is_known
from namlcp.compiled.sources import stamp


def fill(folder: str) -> None:
    """Write the files that `store.prebuilt` reads; prebuild.py calls this."""
    if not is_known():
        raise RuntimeError(f"machine code of numba {numba.__version__} cannot be kept")
    from namlcp.compiled.internals import baseline

    goal = Path(folder) / stamp()
    processor = baseline(platform.machine())
    with tempfile.TemporaryDirectory() as cache:
        os.environ["NUMBA_CACHE_DIR"] = cache
        os.environ["NUMBA_CPU_NAME"] = processor
        os.environ["NUMBA_CPU_FEATURES"] = ""
        # Two or more, because only child processes read the variables.
        for _ in compile_all(max(2, os.cpu_count() or 1)):
            pass
        shutil.copytree(Path(cache) / "namlcp" / stamp(), goal)
    print(f"{len(list(goal.iterdir()))} kernels compiled for {processor}")
