"""Names, layering and errors that every user may meet."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import namlcp

SOURCE = Path(namlcp.__file__).parent
# Who may import whom: adapters, qp, lcp, and what both share, downwards only.
LAYERS = ["__main__", "__init__", "cvxpy", "qpsolvers", "scenes", "qp", "lcp"]


def test_public_names():
    assert namlcp.__all__ == sorted(namlcp.__all__)
    assert all(getattr(namlcp, name).__doc__ for name in namlcp.__all__)


def modules():
    """Yield (dotted name, names of namlcp modules it imports)."""
    for path in sorted(SOURCE.rglob("*.py")):
        name = ".".join(path.relative_to(SOURCE).with_suffix("").parts)
        imports = set()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith(
                "namlcp"
            ):
                imports.add((node.module or "").removeprefix("namlcp").lstrip("."))
                imports |= {
                    f"{node.module}.{a.name}".removeprefix("namlcp.")
                    for a in node.names
                }
        yield name, imports


def layer(name: str) -> int:
    """Return the depth of a module: the shared ones lie below all."""
    top = name.split(".")[0]
    return LAYERS.index(top) if top in LAYERS else len(LAYERS)


def test_imports_point_downwards():
    for name, imports in modules():
        for other in imports:
            if other and (SOURCE / (other.replace(".", "/") + ".py")).exists():
                assert layer(other) >= layer(name), f"{name} imports {other}"


def test_core_imports_no_host():
    for name, _ in modules():
        if name in ("qpsolvers", "cvxpy", "__main__", "scenes"):
            continue
        text = (SOURCE / (name.replace(".", "/") + ".py")).read_text()
        for host in (
            "import qpsolvers",
            "import cvxpy",
            "from qpsolvers",
            "from cvxpy",
        ):
            assert host not in text, name


def test_import_prints_nothing_and_warns_of_nothing():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "import namlcp.qp.path"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_multigrid_is_imported_only_where_it_is_used():
    code = "import namlcp, sys; sys.exit('pyamg' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_results_can_be_compared_without_an_error():
    result = namlcp.solve_qp(np.eye(2), np.ones(2))
    assert result == result
    assert result != namlcp.solve_qp(np.eye(2), np.ones(2))


@pytest.mark.parametrize("status", namlcp.Status)
def test_every_status_explains_itself(status):
    assert status.value == status.name.lower()
    assert status.explanation.endswith(".")
