"""The compiled modules as plain Python, with checked pointers: the text is the same.

`module("namlcp.qp.active.dense")` executes that file of the checkout. What it imports
of Cython comes from here: pointers know their bounds and begin as NaN, fields of
classes as 0. Of a .pxd the constants, the structs and the imports are read; C alone has
types.
"""

import ast
import builtins
import contextlib
import functools
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np

SOURCES = Path(__file__).parents[2] / "src"


class Pointer:
    """What `double *` or `Py_ssize_t *` is: an array, and a place in it."""

    def __init__(self, array, at=0):
        self.array, self.at = array, at

    def __add__(self, places):
        return Pointer(self.array, self.at + places)

    def part(self, count):
        """Return the next entries, all of which must be there."""
        if count > 0 and not 0 <= self.at <= self.at + count <= len(self.array):
            raise IndexError(f"{self.at} to {self.at + count} of {len(self.array)}")
        return self.array[self.at : self.at + max(count, 0)]

    def __getitem__(self, i):
        (value,) = (self + i).part(1)
        return value.item() if isinstance(value, np.generic) else value

    def __setitem__(self, i, value):
        (self + i).part(1)[0] = value


class Struct:
    """A struct, or the fields of an object: 0 until set."""

    def __getattr__(self, name):
        if name.startswith("__"):
            raise AttributeError(name)
        return 0


class Kind:
    """A type of numbers and what is in memory that was not set."""

    def __init__(self, unset, convert=lambda value: value):
        self.unset, self.convert = unset, convert

    def __call__(self):
        return self.unset

    def __getitem__(self, count):
        return lambda: Pointer(np.full(count, self.unset))


class Cython:
    """The module `cython`; types without a meaning here are those of any object."""

    NULL = 0
    double, Py_ssize_t = Kind(math.nan, float), Kind(10**9, int)
    gil = nogil = contextlib.nullcontext()

    def __getattr__(self, name):
        return Kind(None)

    def declare(self, kind, *value):
        return value[0] if value else kind()

    def cast(self, kind, value):
        return kind.convert(value) if isinstance(kind, Kind) else value

    def address(self, value):
        return value


def four_dots(row, a, b, c, d, n, out):
    out.part(4)[:] = [dot(row, one, n) for one in (a, b, c, d)]


def dot(a, b, n):
    return float(a.part(n) @ b.part(n))


def add_scaled(scale, a, out, n):
    out.part(n)[:] += scale * a.part(n)


def add_four(fa, a, fb, b, fc, c, fd, d, out, n):
    for factor, one in ((fa, a), (fb, b), (fc, c), (fd, d)):
        add_scaled(factor, one, out, n)


def copy(a, out, n):
    out.part(n)[:] = a.part(n).copy()


def fill(out, value, n):
    out.part(n)[:] = value


def largest_entry(v, n):
    return float(np.abs(v.part(n)).max(initial=0.0))


def times_line(total, values, places, count, x):
    return total + sum(values[t] * x[places[t]] for t in range(count))


def add_line(total, values, places, count, x, scale, out):
    for t in range(count):
        out[places[t]] += values[t] * scale
    return times_line(total, values, places, count, x)


def reals(m, count):
    return Pointer(np.full(max(count, 1), math.nan))


def indices(m, count):
    return Pointer(np.full(max(count, 1), 10**9))


def c_root(x):
    return math.sqrt(x) if x >= 0.0 else math.nan


GIVEN = {
    "cython": Cython(),
    "libc.math": SimpleNamespace(
        **(vars(math) | {"sqrt": c_root, "INFINITY": math.inf, "NAN": math.nan})
    ),
    "libc.stdlib": SimpleNamespace(
        malloc=lambda size: object(), calloc=None, free=lambda place: 0
    ),
    "namlcp.linalg.vectors": SimpleNamespace(
        dot=dot, four_dots=four_dots, add_scaled=add_scaled, add_four=add_four,
        copy=copy, fill=fill, largest_entry=largest_entry, times_line=times_line,
        add_line=add_line,
    ),
    "namlcp.box": SimpleNamespace(clip=None, deviation=None),
    "namlcp.arrays": SimpleNamespace(
        are_places=None, data_of=None, fits=None, indices=None, new_vector=None,
        numbers=None, places=None,
    ),
    "namlcp.linalg.sparse_ldl": SimpleNamespace(Factors=object, as_array=None),
    "namlcp.linalg.blas": SimpleNamespace(
        blas_dot=dot, blas_times=None, cholesky=None, invert_lower=None,
        times_lower=None, add_gram=None,
    ),
}  # fmt: skip
INSTEAD = {"namlcp.qp.active.engine": {"reals": reals, "indices": indices}}


def plain_import(name, space=None, local=None, names=(), level=0):
    """Import what is Cython's from here, the rest as always."""
    if name == "cython" or name.startswith("cython.cimports."):
        return module(name.removeprefix("cython.cimports."))
    return builtins.__import__(name, space, local, names, level)


class Declarations(ast.NodeTransformer):
    """Turns `x: type` into `x = type()`, as C has the struct or array then."""

    def visit_AnnAssign(self, node):
        if node.value is not None:
            return node
        value = ast.Call(node.annotation, [], [])
        return ast.copy_location(ast.Assign([node.target], value), node)


def declared(text):
    """Return the constants and structs of a .pxd, and what it imports."""
    found = {}
    for body in re.findall(r"^cp?def enum.*:\n((?:    .*\n|\n)+)", text, re.M):
        value = -1
        for name, given in re.findall(r"^    (\w+)(?: = (\w+))?", body, re.M):
            found[name] = value = int(given) if given else value + 1
    for name in re.findall(r"^cdef struct (\w+)", text, re.M):
        found[name] = type(name, (Struct,), {})
    for name, names in re.findall(r"^from (namlcp\S+) cimport (.+)", text, re.M):
        for one in names.split(", "):
            if hasattr(module(name), one):
                found[one] = getattr(module(name), one)
    return found


def made(kind):
    """Return a new object of a cdef class, with its structs."""
    self = object.__new__(kind)
    for base in reversed(kind.__mro__):
        vars(self).update({name: one() for name, one in vars(base).get("STRUCTS", ())})
        if "__cinit__" in vars(base):
            base.__cinit__(self)
    return self


@functools.cache
def module(name):
    """Return a module, executed as plain Python."""
    if name in GIVEN:
        return GIVEN[name]
    path = SOURCES / f"{name.replace('.', '/')}.py"
    header = path.with_suffix(".pxd").read_text()
    known = declared(header)
    space = known | {"__name__": name, "Py_ssize_t": Cython.Py_ssize_t}
    space["__builtins__"] = vars(builtins) | {"__import__": plain_import}
    tree = Declarations().visit(ast.parse(path.read_text()))
    exec(compile(ast.fix_missing_locations(tree), path, "exec"), space)
    for one in re.findall(r"^cdef class (\w+)", header, re.M):
        kind = space[one]
        fields = re.findall(r"^        (\w+) (\w+)$", header, re.M)
        kind.STRUCTS = [(f, known[t]) for t, f in fields if t in known]
        kind.__getattr__, kind.__new__ = Struct.__getattr__, made
    space.update(INSTEAD.get(name, {}))
    return SimpleNamespace(**space)
