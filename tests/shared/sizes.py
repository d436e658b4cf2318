"""What can be taken in: sizes of folders, modules and parameter lists."""

import ast
from collections.abc import Iterator
from pathlib import Path


def assert_folders_and_modules_are_small(tree: Path) -> None:
    """At most 14 modules in a folder, 450 lines in a module."""
    for folder in {path.parent for path in tree.rglob("*.py")}:
        assert len(list(folder.glob("*.py"))) <= 14, folder
    for path in tree.rglob("*.py"):
        assert len(path.read_text().splitlines()) <= 450, path


def functions(tree: Path) -> Iterator[tuple[Path, ast.FunctionDef]]:
    """Yield all functions, with the file of each."""
    for path in sorted(tree.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                yield path, node


def parameters(function: ast.FunctionDef) -> int:
    """Count the parameters, without self and cls."""
    a = function.args
    count = len(a.posonlyargs) + len(a.args) + len(a.kwonlyargs)
    count += (a.vararg is not None) + (a.kwarg is not None)
    return count - (bool(a.args) and a.args[0].arg in ("self", "cls"))
