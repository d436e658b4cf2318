"""The text of compiled modules: run as plain Python, and declared as it is written."""

import ast
import re
from importlib import import_module
from time import perf_counter

import numpy as np
import plain
import pytest

from namlcp.qp.active.solve import OUTCOMES, solve_small
from namlcp.result_base import ResultBase

INF = np.inf
HEADERS = {
    ".".join(path.relative_to(plain.SOURCES).with_suffix("").parts): path
    for path in sorted(plain.SOURCES.rglob("*.pxd"))
    if path.with_suffix(".py").exists()
}
FUNCTION = re.compile(
    r"^( *)(cp?def) (?!extern|class|struct|enum)(?:\([^)]*\))?"
    r"[^()=\n]*?(\w+)\(([^)]*)\)",
    re.M,
)


# ---- as plain Python


def random_qp(seed):
    """A QP with any of singular P, dependent equations, bounds, no solution."""
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 9), rng.integers(0, 7), rng.integers(0, 3)
    root = rng.standard_normal((n, n)) * (rng.random(n) < (1.0, 0.6)[seed % 2])
    G, A, x = rng.standard_normal((m, n)), rng.standard_normal((p, n)), rng.random(n)
    if p == 2 and seed % 3 == 0:
        A[1] = 2.0 * A[0]
    h = G @ x + rng.random(m) * (rng.random(m) < 0.7)
    lb = np.where(rng.random(n) < 0.6, x - rng.random(n), -INF)
    ub = np.where(rng.random(n) < 0.6, x + rng.random(n), INF)
    if m > 1 and seed % 5 == 0:
        G[1], h[1] = -G[0], -h[0] - 1.0
    q = 5.0 * rng.standard_normal(n)
    return root @ root.T, q, G, h, A, A @ x, lb, ub


def of_arrays(kind, P, q, G, h, A, b, lb, ub):
    """Return a plain object with a QP, whose arrays it must not write to."""
    m = kind()
    m.n, m.m, m.p = len(q), len(h), len(b)
    given = {"P": P, "q": q, "G": G, "h": h, "A": A, "b": b, "lb": lb, "ub": ub}
    for name, array in given.items():
        flat = np.ascontiguousarray(array).ravel()
        flat.flags.writeable = False
        setattr(m, name, plain.Pointer(flat))
    for name, size in (("x", m.n), ("y", m.p), ("z", m.m), ("z_box", m.n)):
        setattr(m, name, plain.reals(m, size))
    m.most_operations = INF
    m.is_single, m.max_iter, m.eps_abs, m.eps_rel = True, 1000, 1e-9, 1e-10
    return m


@pytest.mark.parametrize("seed", range(40))
def test_the_text_gives_the_answers_of_the_machine_code(seed):
    """Every pointer is checked, and what was never set would show as NaN."""
    qp = random_qp(seed)
    m = of_arrays(plain.module("namlcp.qp.active.dense").DenseActiveSet, *qp)
    plain.module("namlcp.qp.active.engine").make_room(m)
    code = m.decide()
    settings = 1e-9, 1e-10, 1000, INF
    found = solve_small(ResultBase, settings, perf_counter(), False, qp)
    is_decided = isinstance(found, ResultBase)
    assert is_decided == (code in OUTCOMES)
    if not is_decided:
        assert code == found.code
        return
    assert found.status is OUTCOMES[code]
    for name in ("x", "y", "z", "z_box"):
        expected = getattr(found, name)
        mine = getattr(m, name).part(expected.size)
        np.testing.assert_allclose(mine, expected, rtol=1e-9, atol=1e-9)


def test_pointers_are_checked():
    values = plain.Pointer(np.arange(3.0))
    assert (values + 1)[1] == 2.0
    for i in (-1, 3):
        with pytest.raises(IndexError):
            values[i]
    with pytest.raises(IndexError):
        plain.dot(values, values + 1, 3)


# ---- as declared


def declared(header):
    """Yield of each function its kind, cdef or cpdef, its name and parameters."""
    for indent, kind, name, rest in FUNCTION.findall(header.read_text()):
        yield indent + kind, name, re.findall(r"(\w+)(?:=\*)? *(?:,|$)", rest.strip())


METHODS = {
    n: p
    for header in HEADERS.values()
    for kind, n, p in declared(header)
    if kind[0] == " "
}


def written(header):
    """Yield the name of the class, if any, and the definition of each function."""
    for node in ast.parse(header.with_suffix(".py").read_text()).body:
        for one in node.body if isinstance(node, ast.ClassDef) else [node]:
            if isinstance(one, ast.FunctionDef):
                yield (None if one is node else node.name), one


@pytest.mark.parametrize("name", HEADERS)
def test_every_declared_function_is_written(name):
    """By the name and the parameters of the .pxd; Python sees exactly the others."""
    header, module = HEADERS[name], import_module(name)
    expected = {name: parameters for _, name, parameters in declared(header)}
    shown = {name for kind, name, _ in declared(header) if kind == "cpdef"}
    missing = set(expected)
    for kind, function in written(header):
        known = expected if kind is None else METHODS
        own, parameters = function.name, [one.arg for one in function.args.args]
        if own not in ("__cinit__", "__dealloc__"):
            place = module if kind is None else getattr(module, kind)
            assert hasattr(place, own) == (own in shown or own not in known), own
            assert known.get(own, parameters) == parameters
            missing.discard(own)
    assert not missing
