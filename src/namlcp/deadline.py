"""When to stop: a time limit, or Ctrl-C, told to every loop in the same way."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from namlcp.status import Status


class Deadline(float):
    """A value of time.perf_counter() that counts as reached after Ctrl-C, too.

    Loops compare, time.perf_counter() >= deadline, between two iterations: where they
    stop for the time they stop for the user, with whole arrays and the best point.
    """

    interrupted = False

    # Python asks the subclass of float first: now >= deadline is deadline <= now.
    def __le__(self, now: float) -> bool:
        """Tell whether the time has come."""
        return self.interrupted or float(self) <= now

    def __lt__(self, now: float) -> bool:
        """Tell whether the time is over."""
        return self.interrupted or float(self) < now

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Let the first Ctrl-C in the block set `interrupted`; the next one raises.

        Only Python's own handler is replaced, and only where it runs: in the main
        thread.
        """
        ours = threading.current_thread() is threading.main_thread()
        if not ours or signal.getsignal(signal.SIGINT) != signal.default_int_handler:
            yield
            return
        signal.signal(signal.SIGINT, self.interrupt)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, signal.default_int_handler)

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal."""
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True

    def verdict(self, status: Status) -> Status:
        """Return INTERRUPTED where Ctrl-C, not the time, ended the solve.

        A solve that ended by itself has nothing to hand over before its time: there
        Ctrl-C means what it always means, so that a loop over small problems can be
        left.
        """
        if not self.interrupted:
            return status
        if status is Status.TIME_LIMIT:
            return Status.INTERRUPTED
        raise KeyboardInterrupt
