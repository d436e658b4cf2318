"""The list of all kernels and the types that each is called with, `kernels.txt`.

One line is one kernel for one set of argument types, in numba's notation:
``checks.index_order(int32[::1], int32[::1], int64, int64)``. A NamedTuple is written by
the name of its class, and so is a record, which is a ctypes structure in Python. The
list is kept by hand: the tests fail on a kernel that they call and that is not listed,
and print the missing line.
"""

import ctypes
import functools
import pkgutil
from collections.abc import Iterator
from importlib import import_module
from importlib.resources import files
from typing import Any

import numpy as np
from numba import from_dtype, types

from namlcp.compiled.decorators import KERNELS

WITHOUT_KERNELS = (
    "namlcp.__main__", "namlcp.cvxpy", "namlcp.layers.", "namlcp.compiled.",
)  # fmt: skip
"""Beginnings of names of modules that are not imported: the first runs the command
line, the next two need other packages, some of the last need a known numba."""


def listed() -> list[str]:
    """Return the lines of the list."""
    text = files(__package__).joinpath("kernels.txt").read_text("utf-8")
    return [line for line in text.splitlines() if line and not line.startswith("#")]


def used() -> Iterator[str]:
    """Yield a line for each kernel and set of types that this process has called."""
    for name, dispatcher in list(KERNELS.items()):
        for arguments in dispatcher.overloads:
            yield f"{name}({', '.join(map(spelled, arguments))})"


def spelled(given: types.Type) -> str:
    """Return a type in numba's notation."""
    given = types.unliteral(given)
    if isinstance(given, types.Array):
        sizes = [":"] * given.ndim
        if given.layout != "A":
            sizes[-1 if given.layout == "C" else 0] = "::1"
        entry = str(given.dtype)
        for name, record in records().items():
            if record == given.dtype:
                entry = name
        text = f"{entry}[{', '.join(sizes)}]"
        return text if given.mutable else f"readonly({text})"
    if isinstance(given, types.BaseTuple):
        inside = ", ".join(map(spelled, given.types))
        kind = getattr(given, "instance_class", None)
        return f"{kind.__name__ if kind else 'Tuple'}({inside})"
    return str(given)


def read(line: str) -> tuple[Any, tuple]:
    """Return the kernel and the argument types of a line of the list."""
    name, _, arguments = line.partition("(")
    words = {"readonly": readonly, "bool": types.boolean, **named_tuples(), **records()}
    words["Tuple"] = functools.partial(tuple_of, None)
    numbers = types.int8, types.int32, types.int64, types.float32, types.float64
    words |= {str(t): t for t in numbers}
    given = eval(f"({arguments[:-1]},)" if arguments != ")" else "()", words)
    return KERNELS[name], given


def readonly(array: types.Array) -> types.Array:
    """Return the type of an array that may not be written to."""
    return array.copy(readonly=True)


@functools.cache
def named_tuples() -> dict[str, Any]:
    """Return, by name, what makes the numba type of each NamedTuple of the package."""
    found: dict[str, type] = {}
    for kind in own_classes():
        if hasattr(kind, "_fields"):
            ambiguous = kind.__name__ in found  # then no kernel may take it
            found[kind.__name__] = type(None) if ambiguous else kind
    return {name: functools.partial(tuple_of, kind) for name, kind in found.items()}


@functools.cache
def records() -> dict[str, types.Record]:
    """Return, by name, the numba type of each ctypes structure of the package."""
    return {
        kind.__name__: from_dtype(np.dtype(kind))
        for kind in own_classes()
        if issubclass(kind, ctypes.Structure)
    }


def own_classes() -> Iterator[type]:
    """Yield every class that a module of the package defines."""
    for module in all_modules():
        for value in vars(module).values():
            if isinstance(value, type) and value.__module__ == module.__name__:
                yield value


def tuple_of(kind: type | None, *inside: types.Type) -> types.BaseTuple:
    """Return the type of a NamedTuple, or of a plain tuple (None)."""
    return types.BaseTuple.from_types(inside, kind)


def all_modules() -> list[Any]:
    """Import every module that may have kernels."""
    package = import_module("namlcp")
    names = [
        name
        for _, name, _ in pkgutil.walk_packages(package.__path__, "namlcp.")
        if not name.startswith(WITHOUT_KERNELS)
    ]
    return [import_module(name) for name in names]
