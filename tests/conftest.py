"""What all tests share."""

import signal

import pytest


@pytest.fixture(autouse=True, scope="session")
def own_handler():
    """Let Ctrl-C mean what it means in a terminal: a shell's background jobs ignore it.

    Child processes inherit what their parent ignores.
    """
    signal.signal(signal.SIGINT, signal.default_int_handler)
