"""The numbers and vectors of the active-set method on faces, by name.

As in the `state` of the room around: compiled functions take one record `m` of numbers
and addresses.
"""

import ctypes

import numpy as np

from namlcp.compiled import address_of, fields, record_at
from namlcp.linalg import FACTORS

# Addresses of vectors: those of the problem and the result; the KKT matrix.
GIVEN = "q h b lb ub out indptr indices base data"
# Vectors in the memory of the record, by size. u = (x, y, z) is the point, kept_u the
# last solved one, best_u the one before the last correction; rest = goal - K u. Rows
# are numbered as in `active`, and side is 1 where one is active at h or ub, -1 at lb,
# else 0; likewise of the next face, of the last solved QP and of the factors.
VECTORS = {
    "u kept_u best_u rest unit": "size",
    "Px Gtz Aty": "n",
    "Gx": "m",
    "Ax": "p",
    "side next_side kept_side factored_side": "rows",
}
NUMBERS = (
    # Sizes: rows = m + n, size = n + p + m. Whether there are factors of the pattern,
    # and whether they are those of `factored_side` and the present matrices.
    "n m p rows size is_ready is_factored "
    # Faces tried after the first one.
    "pivots max_iter"
)
REALS = (
    # Largest moduli of the terms of the rows of the system, in equilibrated units; the
    # largest residual, and the largest violation of a side or a sign over these.
    "primal_size dual_size residual violation "
    # Operations of a factorisation and some solves.
    "face_work eps_abs eps_rel"
)


class FaceState(ctypes.Structure):
    """Numbers and addresses: attributes in Python, fields in compiled code."""

    _fields_ = fields(
        (GIVEN, int),
        (" ".join(VECTORS), int),
        (FACTORS, int),
        (NUMBERS, int),
        (REALS, float),
    )


face_at = record_at(FaceState)


def allocate(now: FaceState) -> tuple[np.ndarray, np.ndarray]:
    """Return memory for all `VECTORS`, zeros, and `unit`; note their addresses."""
    sizes = {
        name: getattr(now, size)
        for names, size in VECTORS.items()
        for name in names.split()
    }
    memory = np.zeros(sum(sizes.values()))
    start, end = address_of(memory), 0
    for name, size in sizes.items():
        setattr(now, name, start + 8 * end)
        end += size
    first = (now.unit - start) // 8
    return memory, memory[first : first + now.size]
