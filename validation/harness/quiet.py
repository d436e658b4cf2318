"""Whether the machine is quiet enough for a timing.

The environment variable LOAD says what else may run, as `report --full` sets it. Every
request to a child process then waits until other processes keep no more of the cores
busy than `ALLOWED`. Without the variable nothing is looked at.
"""

import os
import time
from pathlib import Path

LOAD = "NAMLCP_LOAD"
QUIET, BESIDE = "quiet", "beside"  # values of LOAD: nothing else, one process more
MOST_BUSY = 0.3  # cores that others may keep busy on a quiet machine
ALLOWED = {QUIET: MOST_BUSY, BESIDE: 1.0 + MOST_BUSY}
SAMPLE = 0.2  # [s] over which the load is measured; this process sleeps meanwhile
LOOK_EVERY = 10.0  # [s] for which what was seen counts
PATIENCE = 3600.0  # [s] to wait for a quiet machine
last_look = -LOOK_EVERY  # when this process has seen that it was quiet


class BusyError(RuntimeError):
    """The machine stayed busy."""


def said() -> str:
    words = {
        QUIET: f"others kept less than {MOST_BUSY} of a core busy",
        BESIDE: "beside another process on the other core (--busy)",
    }
    return words.get(os.environ.get(LOAD, ""), "not looked at")


def busy_seconds() -> float:
    """Return the time [s] that all cores together have been busy since the start."""
    fields = Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]
    ticks = [int(field) for field in fields[:8]]
    idle = ticks[3] + ticks[4]  # idle, and waiting for a disk
    return (sum(ticks) - idle) / os.sysconf("SC_CLK_TCK")


def busy_cores() -> float:
    """Return how many cores were busy while this process slept."""
    try:
        before, start = busy_seconds(), time.perf_counter()
        time.sleep(SAMPLE)
        return (busy_seconds() - before) / (time.perf_counter() - start)
    except OSError:
        return os.getloadavg()[0]


def wait_until_quiet(patience: float = PATIENCE) -> None:
    """Return once others keep no more busy than LOAD allows; say so before a wait."""
    global last_look
    start = time.monotonic()
    if LOAD not in os.environ or start - last_look < LOOK_EVERY:
        return
    most, told = ALLOWED[os.environ[LOAD]], False
    while (busy := busy_cores()) > most:
        if time.monotonic() - start > patience:
            raise BusyError(f"others keep {busy:.1f} cores busy; limit {most}")
        if not told:
            print(f"waiting: others keep {busy:.1f} cores busy", flush=True)
            told = True
        time.sleep(1.0)
    last_look = time.monotonic()
