"""The doctests of hosts that are not installed are not collected."""

from importlib.util import find_spec

NEEDS = {
    "cvxpy.py": {"cvxpy"},
    "layers/cvxpylayers.py": {"cvxpylayers", "torch"},
    "layers/jax.py": {"jax"},
    "layers/torch.py": {"torch"},
}
collect_ignore = [
    f"src/namlcp/{module}"
    for module, hosts in NEEDS.items()
    if not all(map(find_spec, hosts))
]
