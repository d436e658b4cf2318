"""The house: one door a folder, arrows downwards, sizes that can be read."""

import ast
from importlib import import_module
from pathlib import Path

import pytest
from sizes import assert_folders_and_modules_are_small, functions, parameters

import namlcp

SOURCE = Path(namlcp.__file__).parent
TREES = SOURCE, Path(__file__).parent
HOSTS = ("qpsolvers", "cvxpy", "cvxpylayers", "jax", "torch")
# From the top down; what stands in one row may import each other.
FLOORS = (
    {"__main__"},
    {"cli"},
    {"__init__", "scenes"},
    {"qpsolvers", "cvxpy", "many", "layers"},
    {"derivatives"},
    {"qp"},
    {"theory"},
    {"lcp"},
    {"residuals", "result", "unfolding"},
    {"linalg"},
    {"first_use", "limits", "progress", "checks", "options", "status"},
    {"compiled"},
)
# The imports that point upwards: methods of results open this room when called.
UPWARDS = {
    ("result", "derivatives"),
    ("qp.closest.point", "derivatives"),
    ("qp.sequences.batch", "derivatives"),
}


def name_of(path: Path) -> str:
    return ".".join(path.relative_to(SOURCE).with_suffix("").parts)


def room_of(name: str) -> str:
    """Return the dotted folder of a module; "" for the package itself."""
    return name.rpartition(".")[0]


def imports():
    """Yield (module, what it imports, names taken) for imports of our own."""
    for path in sorted(SOURCE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom) and node.module:
                head, _, rest = node.module.partition(".")
                if head == "namlcp":
                    yield name_of(path), rest, [alias.name for alias in node.names]


IMPORTS = list(imports())


def floor(name: str) -> int:
    top = name.partition(".")[0]
    return next(k for k, names in enumerate(FLOORS) if top in names)


def is_room(name: str) -> bool:
    return (SOURCE / name.replace(".", "/")).is_dir()


def door(room: str) -> set[str]:
    """Return what others may import: what a door lists, else what it imports."""
    listed = getattr(import_module(f"namlcp.{room}"), "__all__", ())
    taken = [names for module, _, names in IMPORTS if module == f"{room}.__init__"]
    return set(listed) or set().union(*taken)


def test_every_module_has_its_floor():
    for path in SOURCE.rglob("*.py"):
        assert floor(name_of(path)) >= 0


def test_imports_point_downwards():
    for module, other, _ in IMPORTS:
        if other and (module, other) not in UPWARDS:
            assert floor(other) >= floor(module), f"{module} imports {other}"


def test_other_rooms_are_entered_by_their_door():
    """A module may import its own room and those around it, and doors of others."""
    for module, other, names in IMPORTS:
        if not other:
            continue
        if is_room(other):
            own = module.startswith(f"{other}.")
            missing = set() if own else set(names) - door(other)
            assert not missing, f"{module}: {missing} not at the door of {other}"
        else:
            room = room_of(other)
            inside = not room or f"{module}.".startswith(f"{room}.")
            assert inside, f"{module} imports {other} past the door of {room}"


def test_inner_rooms_are_for_their_own_wing():
    """`namlcp.lcp.pivoting` is entered from within `namlcp.lcp` alone."""
    for module, other, _ in IMPORTS:
        wing = room_of(other)
        if is_room(other) and wing:
            assert module.startswith(f"{wing}."), f"{module} imports {other}"


def test_every_name_at_a_door_is_used_outside():
    for path in SOURCE.rglob("*/__init__.py"):
        room = name_of(path.parent / "x").rpartition(".")[0]
        for name in door(room):
            outside = any(
                other == room and name in names
                for module, other, names in IMPORTS
                if not module.startswith(f"{room}.")
            )
            assert outside, f"{name} at the door of {room}"


def test_the_core_imports_no_host():
    for path in SOURCE.rglob("*.py"):
        name = name_of(path)
        if name.partition(".")[0] in (*HOSTS, "cli", "layers", "scenes"):
            continue
        for node in ast.walk(ast.parse(path.read_text())):
            hosts: set[str] = set()
            if isinstance(node, ast.Import):
                hosts = {alias.name.partition(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom):
                hosts = {(node.module or "").partition(".")[0]}
            assert not hosts.intersection(HOSTS), name


@pytest.mark.parametrize("tree", TREES, ids=["src", "tests"])
def test_rooms_and_modules_can_be_taken_in(tree):
    assert_folders_and_modules_are_small(tree)


def test_functions_take_at_most_eight_parameters():
    """Public ones may have more, and so may the methods of public classes."""
    public = {*namlcp.__all__, "nam_solve_qp", "solve_qp", "solve_via_data"}
    methods = {
        (path, method.lineno)
        for path in SOURCE.rglob("*.py")
        for node in ast.parse(path.read_text()).body
        if isinstance(node, ast.ClassDef) and node.name in namlcp.__all__
        for method in node.body
    }
    for path, node in functions(SOURCE):
        if node.name not in public and (path, node.lineno) not in methods:
            assert parameters(node) <= 8, f"{name_of(path)}.{node.name}"
