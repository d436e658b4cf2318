"""The rooms of the validation: one door each, imports downwards, sizes to be read."""

import ast

from sizes import assert_folders_and_modules_are_small, functions, parameters

from validation.harness import cli

HOUSE = cli.ROOT / "validation"

# From the top down; the rooms of one line do not import each other.
FLOORS = (
    {"report"},
    {"page"},
    {
        "claims",
        "oracles",
        "stress",
        "peers",
        "repeated",
        "general",
        "paper",
        "environment",
    },
    {"applications", "derivatives"},
    {"problems"},
    {"harness"},
)


def name_of(path):
    return ".".join(path.relative_to(cli.ROOT).with_suffix("").parts)


def imports():
    """Yield (module, what it imports from, the names) for imports of our own."""
    for path in sorted(HOUSE.rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                assert node.level == 0, path
                if node.module.split(".")[0] == "validation":
                    names = [alias.name for alias in node.names]
                    yield name_of(path), node.module, names
            elif isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
                assert not any(n.startswith("validation") for n in names), path


def room_of(module):
    return module.split(".")[1]


def floor(module):
    return next(k for k, rooms in enumerate(FLOORS) if room_of(module) in rooms)


def test_imports_point_downwards():
    for module, other, _ in imports():
        if module.endswith("__init__") and other == "validation":
            continue
        assert other != "validation", module
        same = room_of(module) == room_of(other)
        assert same or floor(other) > floor(module), f"{module} imports {other}"


def names_at(folder):
    """Return what a door offers: the room's modules, what it imports and defines."""
    names = {path.stem for path in folder.iterdir()}
    for node in ast.walk(ast.parse((folder / "__init__.py").read_text())):
        if isinstance(node, ast.ImportFrom):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.Name):
            names.add(node.id)
    return names


def test_rooms_are_entered_by_their_door():
    for module, other, names in imports():
        if room_of(module) != room_of(other):
            folder = cli.ROOT / other.replace(".", "/")
            assert folder.is_dir(), f"{module} imports {other} past the door"
            missing = set(names) - names_at(folder)
            assert not missing, f"{module}: {missing} not at the door of {other}"


def test_rooms_modules_and_functions_can_be_taken_in():
    assert_folders_and_modules_are_small(HOUSE)
    for path, node in functions(HOUSE):
        assert parameters(node) <= 8, f"{path}: {node.name}"
