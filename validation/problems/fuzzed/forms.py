"""The ways in which arrays reach a solver, and the ways in which they are malformed.

`sparse_form`, `dense_form` and `vector_form` return the same numbers in another
representation; `spoil` makes one argument wrong.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import scipy.sparse as sp

Rng = np.random.Generator
Arguments = dict[str, Any]
Form = Callable[[Rng, np.ndarray], Any]

LAYOUTS = ("csc", "csr", "coo", "bsr", "lil", "dok", "dia")
NARROW = (np.int64, np.int32, np.int16, np.float32, np.float16, bool)
WIDE = (">f8", np.longdouble)


def kept_by(values: np.ndarray, kind: Any) -> bool:
    with np.errstate(invalid="ignore", over="ignore"):
        return bool(np.array_equal(values.astype(kind).astype(float), values))


def strided(values: np.ndarray) -> np.ndarray:
    """Return a view with gaps, in which NaN stands."""
    wide = np.full([2 * k for k in values.shape], np.nan)
    view = wide[tuple(slice(None, None, 2) for _ in values.shape)]
    view[...] = values
    return view


def read_only(values: np.ndarray) -> np.ndarray:
    copy = values.copy()
    copy.setflags(write=False)
    return copy


def other_type(rng: Rng, values: np.ndarray) -> np.ndarray:
    kinds = (*NARROW, *WIDE)
    kind = kinds[int(rng.integers(len(kinds)))]
    return values.astype(kind) if kept_by(values, kind) else values.astype(">f8")


# What an absent argument stands for.
ABSENT = {"lb": -np.inf, "ub": np.inf, "lower": 0.0, "upper": np.inf}

DENSE: tuple[Form, ...] = (
    lambda rng, values: values,
    lambda rng, values: np.asfortranarray(values),
    lambda rng, values: read_only(values),
    lambda rng, values: strided(values),
    lambda rng, values: values[..., ::-1].copy()[..., ::-1],
    lambda rng, values: values.tolist() if values.size else values,
    other_type,
    other_type,
)


def sparse_form(rng: Rng, values: np.ndarray) -> Any:
    """Return a sparse array or matrix of any layout, canonical or not."""
    layout = LAYOUTS[int(rng.choice(7, p=[0.3, 0.2, 0.2, 0.1, 0.08, 0.06, 0.06]))]
    kind = "matrix" if rng.random() < 0.4 else "array"
    wrap = getattr(sp, f"{layout}_{kind}")
    if layout in ("csc", "csr", "coo") and rng.random() < 0.6:
        return wrap_loose(rng, values, layout, wrap)
    if layout in ("bsr", "dia") and not 0 < values.size <= 100:  # empty, or slow
        wrap = getattr(sp, f"csc_{kind}")
    if rng.random() < 0.7:
        return wrap(values)
    number = (np.int64, np.int32, np.float32, bool)[int(rng.integers(4))]
    return wrap(values.astype(number) if kept_by(values, number) else values)


def wrap_loose(rng: Rng, values: np.ndarray, layout: str, wrap: Any) -> Any:
    """Return a matrix with entries out of order, in two parts, or zeros stored."""
    zeros = (rng.random(values.shape) < 0.05 * rng.integers(0, 2)) & (values == 0.0)
    i, j = np.hstack((np.nonzero(values), np.nonzero(zeros)))
    data = values[i, j]
    twice = rng.random(i.size) < 0.3 * rng.integers(0, 2)
    data = np.concatenate((np.where(twice, data / 2.0, data), data[twice] / 2.0))
    i, j = np.concatenate((i, i[twice])), np.concatenate((j, j[twice]))
    order = rng.permutation(i.size)
    i, j, data = i[order], j[order], data[order]
    kind = np.int64 if rng.random() < 0.5 else np.int32
    if layout == "coo":
        return wrap((data, (i.astype(kind), j.astype(kind))), shape=values.shape)
    major, minor = (i, j) if layout == "csr" else (j, i)
    sorting = np.argsort(major, kind="stable")
    count = np.bincount(major, minlength=values.shape[layout == "csc"])
    indptr = np.concatenate(([0], np.cumsum(count))).astype(kind)
    data, indices = data[sorting], minor[sorting].astype(kind)
    if rng.random() < 0.2:
        data, indices, indptr = (read_only(v) for v in (data, indices, indptr))
    return wrap((data, indices, indptr), shape=values.shape)


def dense_form(rng: Rng, values: np.ndarray) -> Any:
    return DENSE[int(rng.integers(len(DENSE)))](rng, values)


def vector_form(rng: Rng, values: np.ndarray) -> Any:
    """Return a vector in a random form: array, list, column, row, sparse column."""
    how = int(rng.integers(10))
    if how == 0:
        return values[:, None]
    if how == 1:
        return values[None, :]
    if how == 2 and values.size and np.isfinite(values).all():
        return sp.csc_array(values[:, None])
    return tuple(values.tolist()) if how == 3 else dense_form(rng, values)


# A fault takes the argument as a clean array and returns it spoiled, None if it cannot.
def with_entry(value: float) -> Form:

    def fault(rng: Rng, values: np.ndarray) -> Any:
        if not values.size:
            return None
        spoiled = values.copy()
        spoiled.flat[int(rng.integers(values.size))] = value
        sparse = values.ndim == 2 and rng.random() < 0.5
        return sp.csc_array(spoiled) if sparse else spoiled

    return fault


def corrupt(rng: Rng, values: np.ndarray) -> Any:
    if values.ndim < 2 or not values.any():
        return None
    C = sp.csc_array(values) if rng.random() < 0.5 else sp.csr_array(values)
    C.indices[int(rng.integers(C.indices.size))] = rng.choice([-1, 10**6])
    return C


NUMBERS: tuple[Form, ...] = (
    with_entry(np.nan),
    lambda rng, values: values.astype(complex),
    lambda rng, values: values.astype(str),
    lambda rng, values: np.append(values, [None]),
    lambda rng, values: [[1.0], [1.0, 2.0]],
    lambda rng, values: "text",
    lambda rng, values: np.ma.masked_array(values, mask=True) if values.size else None,
    lambda rng, values: np.zeros((2, *values.shape, 3)),
    lambda rng, values: values.astype("M8[s]") if np.isfinite(values).all() else None,
    corrupt,
)
INFINITE = (with_entry(np.inf), with_entry(-np.inf))
LENGTH: tuple[Form, ...] = (
    lambda rng, values: np.append(values, 0.0),
    lambda rng, values: values[:-1] if values.size else None,
    lambda rng, values: np.ones((2, values.size + 2)),
)


def unsymmetric(rng: Rng, values: np.ndarray) -> Any:
    """Return P with one entry off by a thousandth of the largest."""
    if values.shape[0] < 2:
        return None
    spoiled = values.copy()
    i, j = rng.choice(values.shape[0], 2, replace=False)
    spoiled[i, j] += 1e-3 * max(np.abs(values).max(), 1.0)
    return sp.csr_matrix(spoiled) if rng.random() < 0.5 else spoiled


def wider(rng: Rng, values: np.ndarray) -> Any:
    return np.hstack((values, np.ones((values.shape[0], 1))))


# What may be wrong with each argument. A QP's sides may be infinite.
SIDES = (*NUMBERS, *LENGTH)
VECTOR, MATRIX = (*SIDES, *INFINITE), (*NUMBERS, *INFINITE, wider)
QP_FAULTS: dict[str, tuple[Form, ...]] = {
    "P": (*NUMBERS, *INFINITE, unsymmetric, wider), "q": VECTOR,
    "G": MATRIX, "h": SIDES, "A": MATRIX, "b": VECTOR, "lb": SIDES, "ub": SIDES,
}  # fmt: skip
LCP_FAULTS = {
    "A": MATRIX,
    "q": VECTOR,
    "lower": (*SIDES, lambda rng, values: np.full(values.size, np.inf)),
    "upper": (*SIDES, lambda rng, values: np.full(values.size, -np.inf)),
}


def spoil(rng: Rng, arguments: Arguments) -> tuple[Arguments, str]:
    """Return the arguments, clean arrays, with one made wrong, and its name."""
    faults: Any = QP_FAULTS if "P" in arguments else LCP_FAULTS
    while True:
        name = str(rng.choice(list(faults)))
        choice = faults[name]
        spoiled = choice[int(rng.integers(len(choice)))](rng, arguments[name])
        if spoiled is not None:
            return {**arguments, name: spoiled}, name


def dress(rng: Rng, arguments: Arguments) -> Arguments:
    """Return the arguments, clean arrays, each in a random representation."""
    sparse = bool(rng.random() < 0.4)
    mixed = bool(rng.random() < 0.1)
    dressed: Arguments = {}
    for name, values in arguments.items():
        if values.ndim == 2:
            this = bool(rng.random() < 0.5) if mixed else sparse
            dressed[name] = (sparse_form if this else dense_form)(rng, values)
        else:
            dressed[name] = vector_form(rng, values)
    for names in (("G", "h"), ("A", "b")):
        gone = all(name in arguments for name in names) and not arguments[names[1]].size
        if gone and "P" in arguments and rng.random() < 0.5:
            dressed |= dict.fromkeys(names)
    for name, none in ABSENT.items():
        values = arguments.get(name)
        if values is not None and (values == none).all() and rng.random() < 0.5:
            dressed[name] = None
    return dressed
