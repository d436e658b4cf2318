"""What all tests share."""

import signal

import pytest
from numba.core import event

from namlcp.compiled import decorators, signatures


@pytest.fixture(autouse=True, scope="session")
def own_handler():
    """Let Ctrl-C mean what it means in a terminal: a shell's background jobs ignore it.

    Child processes inherit what their parent ignores.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser):
    parser.addoption(
        "--forbid-compiling",
        action="store_true",
        help="fail where a kernel has to be compiled: for a wheel with machine code",
    )


class Forbidding(event.Listener):
    """Raises where numba begins to compile a kernel; some tests have parts compiled."""

    def on_start(self, event):
        if event.data["dispatcher"] in decorators.KERNELS.values():
            raise AssertionError(f"compiled: {event.data['dispatcher']}")

    def on_end(self, event):
        pass


def pytest_configure(config):
    if config.getoption("--forbid-compiling"):
        event.register("numba:compile", Forbidding())


def pytest_sessionfinish(session):
    """Fail on a kernel that the tests have used and `kernels.txt` does not list.

    A wheel with machine code and `namlcp.warmup` would lack it.
    """
    missing = sorted(set(signatures.used()) - set(signatures.listed()))
    if missing and session.exitstatus == 0:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
    session.config.stash[MISSING] = missing


MISSING = pytest.StashKey()


def pytest_terminal_summary(terminalreporter, config):
    missing = config.stash.get(MISSING, [])
    if missing:
        terminalreporter.section("kernels that compiled/kernels.txt does not list")
        for line in missing:
            terminalreporter.write_line(line)
