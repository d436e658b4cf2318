"""What all tests share."""

import os
import signal

import pytest

import namlcp
from namlcp.compiled import signatures


@pytest.fixture(autouse=True, scope="session")
def own_handler():
    """Let Ctrl-C mean what it means in a terminal: a shell's background jobs ignore it.

    Child processes inherit what their parent ignores.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_sessionstart(session):
    """Compile all kernels once, on all cores, before two workers (-n 2) share them.

    The workers keep the cores busy: more threads of BLAS would only wait, busily.
    """
    if session.config.getoption("numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
        namlcp.warmup(progress=False)


MISSING = pytest.StashKey[set[str]]()


def pytest_sessionfinish(session):
    """Fail on a kernel that the tests have used and `kernels.txt` does not list.

    `namlcp.warmup` would lack it. A worker (-n 2) tells the process that started it, by
    `workeroutput`.
    """
    config = session.config
    missing = config.stash.setdefault(MISSING, set())
    missing |= set(signatures.used()) - set(signatures.listed())
    if hasattr(config, "workeroutput"):
        config.workeroutput["missing"] = sorted(missing)
    elif missing and session.exitstatus == 0:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


@pytest.hookimpl(optionalhook=True)
def pytest_testnodedown(node):
    """Take over what a worker, which ends now, has found missing."""
    found = getattr(node, "workeroutput", {}).get("missing", [])
    node.config.stash.setdefault(MISSING, set()).update(found)


def pytest_terminal_summary(terminalreporter, config):
    missing = sorted(config.stash.get(MISSING, ()))
    if missing:
        terminalreporter.section("kernels that compiled/kernels.txt does not list")
        for line in missing:
            terminalreporter.write_line(line)
