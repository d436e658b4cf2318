"""Whether the machine is quiet enough for a timing.

With the environment variable QUIET set, as `report --full` does, every request to a
child process (`processes.Bench`) waits until other processes keep less than `MOST_BUSY`
of a core busy, and raises BusyError if that does not happen.
"""

import os
import time
from pathlib import Path

QUIET = "NAMLCP_QUIET"
MOST_BUSY = 0.3  # cores that others may keep busy
SAMPLE = 0.2  # [s] over which the load is measured; this process sleeps meanwhile
PATIENCE = 900.0  # [s] to wait for a quiet machine


class BusyError(RuntimeError):
    """The machine stayed busy."""


def busy_seconds() -> float:
    """Return the time [s] that all cores together have been busy since the start."""
    fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]
    ticks = [int(field) for field in fields[:8]]
    idle = ticks[3] + ticks[4]  # idle, and waiting for a disk
    return (sum(ticks) - idle) / os.sysconf("SC_CLK_TCK")


def busy_cores(sample: float = SAMPLE) -> float:
    """Return how many cores were busy while this process slept.

    Where there is no /proc, the load average of the last minute.
    """
    try:
        before, start = busy_seconds(), time.perf_counter()
        time.sleep(sample)
        return (busy_seconds() - before) / (time.perf_counter() - start)
    except OSError:
        return os.getloadavg()[0]


def wait_until_quiet(patience: float = PATIENCE) -> None:
    """Return once the machine is quiet, at once unless QUIET is set."""
    if QUIET not in os.environ:
        return
    end = time.monotonic() + patience
    while (busy := busy_cores()) > MOST_BUSY:
        if time.monotonic() > end:
            raise BusyError(f"others keep {busy:.1f} cores busy; limit {MOST_BUSY}")
        time.sleep(1.0)
