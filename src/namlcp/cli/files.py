"""Readers of problem files, which are not trusted.

Nothing is unpickled, evaluated or extracted, and the size that a file claims is checked
before it is unpacked. Every fault is an exception whose text names it.
"""

import gzip
import math
import os
import re
import struct
import zipfile
import zlib
from typing import Any

import numpy as np
import qpsolvers
import scipy.sparse as sp
from scipy.io import loadmat, whosmat

from namlcp.checks import INFINITE, checked_order
from namlcp.cli.mps import mps_problem, two_sided
from namlcp.qp import QP

MOST_BYTES = 2**31
"""Largest size of all arrays of a file together [bytes]."""

MAT_NAMES = ("P", "q", "A", "l", "u")

SAVED_NONE = re.compile(rb"\](\x94|q.)Nat(\x94|q.)b\.$", re.DOTALL)
"""The end of a pickled array that holds None alone: NumPy's for an absent part."""


def read_problem(path: str) -> Any:
    """Read a qpsolvers.Problem, or A, q and the bounds of an LCP."""
    name = path.lower().removesuffix(".gz")
    if name.endswith(".mat"):
        return mat_problem(path)
    if name.endswith((".mps", ".qps")):
        opened: Any = gzip.open if path.lower().endswith(".gz") else open
        with opened(path, "rb") as stream:
            text = stream.read(MOST_BYTES + 1)
        bound(len(text))
        return mps_problem(text.decode("latin-1").splitlines())
    return npz_problem(path)


def npz_problem(path: str) -> Any:
    """Read what qpsolvers.Problem.save wrote, or an LCP: A, q, and lower and upper."""
    with zipfile.ZipFile(path) as archive, np.load(path, allow_pickle=False) as arrays:
        if "P" not in arrays and {"A", "q"} <= {*arrays}:
            found = [name for name in ("A", "q", "lower", "upper") if name in arrays]
            bound(sum(archive.getinfo(f"{name}.npy").file_size for name in found))
            lcp = {name: read_array(archive, arrays, name) for name in found}
            return lcp["A"], lcp["q"], lcp.get("lower"), lcp.get("upper")
        for name in ("P", "q"):
            if name not in arrays:
                raise ValueError(f"it holds no {name}: not a qpsolvers problem")
        names = [name for name in QP._fields if name in arrays]
        bound(sum(archive.getinfo(f"{name}.npy").file_size for name in names))
        data = {name: read_array(archive, arrays, name) for name in names}
    return qpsolvers.Problem(**data)


def read_array(archive: zipfile.ZipFile, arrays: Any, name: str) -> np.ndarray | None:
    """Return an array, None where it is a saved None."""
    try:
        array = arrays[name]
    except ValueError as error:
        if SAVED_NONE.search(archive.read(f"{name}.npy")):
            return None
        raise ValueError(
            f"{name} cannot be read (a sparse matrix? save it as a dense one): {error}"
        ) from None
    refuse_kind(name, array.dtype)
    return array


def mat_problem(path: str) -> qpsolvers.Problem:
    """Read a Maros-Meszaros problem l <= A x <= u, its last n rows being the bounds."""
    data = read_mat(path)
    P, C = sp.csc_matrix(data["P"]), sp.csr_matrix(data["A"])
    q, low, high = data["q"], data["l"], data["u"]
    m = C.shape[0] - q.size
    if m < 0 or low.size != C.shape[0] or high.size != C.shape[0]:
        raise ValueError(
            "A, l, u must have as many rows, at least one for each entry of "
            f"q, got {C.shape[0]}, {low.size}, {high.size} for {q.size}"
        )
    low[low <= -INFINITE], high[high >= INFINITE] = -np.inf, np.inf
    return two_sided(P, q, C[:m], low[:m], high[:m], low[m:], high[m:])


def read_mat(path: str) -> dict[str, Any]:
    """Return P, q, A, l and u of a Maros-Meszaros file, q, l, u as vectors."""
    bound(unpacked_size(path))
    listed = whosmat(path)
    found = {name: (s, kind) for name, s, kind in listed if name in MAT_NAMES}
    for name in MAT_NAMES:
        if name not in found:
            raise ValueError(f"it holds no {name}: not a Maros-Meszaros problem")
    dense = [s for n, (s, kind) in found.items() if n in "qlu" or kind != "sparse"]
    bound(sum(8 * math.prod(shape) for shape in dense))
    bound(sum(8 * sum(s) for s, kind in found.values() if kind == "sparse"))
    for name in MAT_NAMES:
        if found[name][1] in ("cell", "struct", "object", "char", "function", "opaque"):
            raise ValueError(f"{name} must hold real numbers, got a {found[name][1]}")
    data = loadmat(path, variable_names=MAT_NAMES, spmatrix=False)
    for name in MAT_NAMES:
        refuse_kind(name, data[name].dtype)
        if sp.issparse(data[name]):
            checked_order(name, data[name])
    for name in ("q", "l", "u"):
        vector = data[name].toarray() if sp.issparse(data[name]) else data[name]
        data[name] = np.array(vector, dtype=float).ravel()
    return {name: data[name] for name in MAT_NAMES}


def unpacked_size(path: str) -> int:
    """Return the unpacked size [bytes] of a .mat file, counted up to MOST_BYTES."""
    size = os.path.getsize(path)
    with open(path, "rb") as stream:
        order = "<" if stream.read(128)[126:128] == b"IM" else ">"
        while len(tag := stream.read(8)) == 8 and size <= MOST_BYTES:
            kind, length = struct.unpack(f"{order}II", tag)
            end = stream.tell() + length
            if kind == 15:  # miCOMPRESSED
                engine = zlib.decompressobj()
                packed = stream.read(length)
                while packed and size <= MOST_BYTES:
                    size += len(engine.decompress(packed, 2**20))
                    packed = engine.unconsumed_tail
            stream.seek(end)
    return size


def bound(size: int) -> None:
    """Raise where arrays of more than MOST_BYTES are claimed."""
    if size > MOST_BYTES:
        raise ValueError(f"its arrays claim {size:.1e} bytes, allowed are {MOST_BYTES}")


def refuse_kind(name: str, dtype: np.dtype) -> None:
    if dtype.kind not in "biuf":
        raise ValueError(f"{name} must hold real numbers, got dtype {dtype}")
