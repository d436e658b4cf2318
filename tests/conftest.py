"""What all tests share."""

import os
import signal

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_handler():
    """Let Ctrl-C mean what it means in a terminal: a shell's background jobs ignore it.

    Child processes inherit what their parent ignores.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config):
    """Let workers (-n 2), which keep the cores busy, have one thread of BLAS each."""
    if config.getoption("numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
