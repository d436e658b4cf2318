"""The examples in the docstrings of all modules, compiled ones included."""

import doctest
import pkgutil
from importlib import import_module
from importlib.util import find_spec

import pytest

import namlcp

HOSTS = {
    "namlcp.cvxpy": {"cvxpy"},
    "namlcp.cvxpylayers": {"cvxpylayers", "torch"},
    "namlcp.jax": {"jax"},
    "namlcp.torch": {"torch"},
}
MODULES = {name for _, name, _ in pkgutil.walk_packages(namlcp.__path__, "namlcp.")}
MODULES -= {"namlcp.__main__"}


@pytest.mark.parametrize("name", ["namlcp", *sorted(MODULES)])
def test_examples(name):
    missing = [host for host in HOSTS.get(name, ()) if find_spec(host) is None]
    if missing:
        pytest.skip(f"needs {', '.join(missing)}")
    assert doctest.testmod(import_module(name)).failed == 0


def test_every_module_is_looked_at():
    """Compiled ones, too: `walk_packages` sees what the import system would find."""
    assert {"namlcp.linalg.dense", "namlcp.qp.route", *HOSTS} <= MODULES
