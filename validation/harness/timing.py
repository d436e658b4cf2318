"""Times and memory of calls, and their means."""

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

Call = Callable[[], Any]
SLOW = 1.0  # [s] a first call that takes longer is not repeated
REPEATS = 3  # calls at most, unless they are quick
REPEAT_TIME = 0.3  # [s] of calls after which no further one begins
QUICK_TIME = 0.05  # [s] of calls at least, however many they are


def median_time(
    call: Call, clock: Call = time.perf_counter
) -> tuple[Any, float, float]:
    """Return the first result, its time and the median of others, if it is not slow."""
    start = clock()
    first = call()
    cold = clock() - start
    times: list[float] = []
    while cold < SLOW and sum(times) < REPEAT_TIME:
        start = clock()
        call()
        times.append(clock() - start)
        if len(times) >= REPEATS and sum(times) >= QUICK_TIME:
            break
    return first, cold, statistics.median(times or [cold])


def resident_memory(reset_peak: bool = False) -> float:
    """Return the peak resident memory of this process in bytes (Linux), else NaN."""
    status = Path("/proc/self/status")
    if not status.exists():
        return np.nan
    if reset_peak:
        Path("/proc/self/clear_refs").write_text("5")
    lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
    return 1024.0 * float(lines["VmHWM"].split()[0])


def geometric_mean(values: list[float]) -> float:
    return float(np.exp(np.mean(np.log(values)))) if values else np.nan
