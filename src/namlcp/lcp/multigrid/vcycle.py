"""The V(1,1)-cycle truncated to a face, and Krylov methods that it preconditions."""

from typing import Any, NamedTuple

import numpy as np

from namlcp.lcp.multigrid.kernels import (
    ascend,
    descend,
    mark_dirty,
    next_direction,
    step_along,
    truncate_coarse,
)
from namlcp.linalg.csc import Compressed

# Condition number from which on the coarsest matrix gets a pseudo-inverse.
SINGULAR_CONDITION = 1e13


class Level(NamedTuple):
    """One level of a hierarchy; P, R and C lead to the next, empty on the last.

    A : (n, n). diagonal, d : positions and values of its diagonal entries. P : (n, m),
    interpolation; R = P'; by rows. C : (m,), index of each coarse unknown.
    """

    A: Compressed
    diagonal: np.ndarray
    d: np.ndarray
    P: Compressed
    R: Compressed
    C: np.ndarray


class FaceOnLevel(NamedTuple):
    """The free unknowns F of one level, and what follows from them.

    A: the matrix of the level, truncated by the faces of the finer levels. dinv (n,):
    1 / a_ii on F, 0 elsewhere. touched (n,): rows of A that differ from the matrix of
    the level. dirty (n,): rows that `mark_dirty` marks. b, x (n,): right-hand side and
    solution of a cycle, for the next finer level. position (n,): work of
    `truncate_coarse`, empty while A is the matrix of the level itself.
    """

    A: Compressed
    dinv: np.ndarray
    touched: np.ndarray
    dirty: np.ndarray
    b: np.ndarray
    x: np.ndarray
    position: np.ndarray


class VCycle:
    """Approximate inverses of A_FF on the levels of a hierarchy.

    A caller sets a face in faces[k].dinv and calls `follow_face`, which changes coarser
    levels only; so faces on several levels must be set from the coarsest level up.

    krylov(k, r, goal, steps, x) solves A_FF x = r on the face F of level k, from x = 0,
    which stays 0 outside. It stops at a residual, left in r, of at most `goal`, or
    after `steps` steps: by conjugate gradients for symmetric A, else by
    right-preconditioned BiCGStab (van der Vorst, SIAM J. Sci. Stat. Comput. 13 (1992)
    631-644), two V-cycles a step. (SciPy's conjugate gradients do not end at p'A p <=
    0, and SciPy's methods update vectors one by one.)
    """

    def __init__(self, levels: list[Level], symmetric: bool):
        self.levels = levels
        self.symmetric = symmetric
        self.krylov = self.conjugate_gradients if symmetric else self.bicgstab
        self.faces = []
        for level in levels:  # all unknowns are free
            n = level.d.size
            marks, vectors = np.zeros((2, n), np.uint8), np.empty((2, n))
            parts = *marks, *vectors, np.empty(0, np.int32)
            self.faces.append(FaceOnLevel(level.A, 1.0 / level.d, *parts))
        self.invert_coarsest()

    def follow_face(self, k: int) -> None:
        """Truncate the levels coarser than k after a change of faces[k].dinv."""
        for fine in range(k, len(self.levels) - 1):
            level, coarse = self.levels[fine], self.levels[fine + 1]
            face, below = self.faces[fine], self.faces[fine + 1]
            if not below.position.size:  # its matrix is still that of the level
                copy = below.A._replace(data=below.A.data.copy())
                position = np.zeros(below.dinv.size, dtype=np.int32)
                below = self.faces[fine + 1] = below._replace(A=copy, position=position)
            mark_dirty(face.A, face.dinv, face.touched, face.dirty)
            transfer = level.P, level.R, level.C
            truncate_coarse(face, *transfer, coarse.A, coarse.d, below)
        self.invert_coarsest()

    def invert_coarsest(self) -> None:
        """Invert the free block of the last level."""
        face = self.faces[-1]
        free = np.flatnonzero(face.dinv)
        n = face.dinv.size
        indptr, indices, data = face.A
        dense, self.inverse = np.zeros((n, n)), np.zeros((n, n))
        dense[np.repeat(np.arange(n), np.diff(indptr)), indices] = data
        self.inverse[np.ix_(free, free)] = inverse(
            dense[np.ix_(free, free)], self.symmetric
        )

    def solve(self, k: int, b: np.ndarray, x: np.ndarray) -> float:
        """Write to x the V-cycle from level k on applied to b; return b'x."""
        if k == len(self.levels) - 1:
            np.dot(self.inverse, b, out=x)
            return float(b @ x)
        level, face, below = self.levels[k], self.faces[k], self.faces[k + 1]
        A, P, dinv, diagonal = face.A, level.P, face.dinv, level.diagonal
        descend(A, diagonal, P, dinv, b, x, below.b)
        self.solve(k + 1, below.b, below.x)
        return ascend(A, diagonal, P, dinv, b, below.x, x)

    def conjugate_gradients(
        self, k: int, r: np.ndarray, goal: float, steps: int, x: np.ndarray
    ) -> None:
        A, dinv = self.levels[k].A, self.faces[k].dinv
        y, p, Ap = np.empty_like(r), np.zeros_like(r), np.empty_like(r)
        rho, beta = self.solve(k, r, y), 0.0
        for step in range(1, steps + 1):
            curvature = next_direction(A, dinv, beta, y, p, Ap)
            if not (curvature > 0.0 and rho > 0.0):
                return
            if step_along(rho / curvature, p, Ap, x, r) <= goal or step == steps:
                return
            before, rho = rho, self.solve(k, r, y)
            beta = rho / before

    def bicgstab(
        self, k: int, r: np.ndarray, goal: float, steps: int, x: np.ndarray
    ) -> None:
        A, dinv = self.levels[k].A, self.faces[k].dinv
        shadow, p = r.copy(), r.copy()
        y, Ay, t = np.empty_like(r), np.empty_like(r), np.empty_like(r)
        rho = float(shadow @ r)
        for _ in range(steps):
            self.solve(k, p, y)
            next_direction(A, dinv, 0.0, y, y, Ay)
            below = float(shadow @ Ay)
            if rho == 0.0 or below == 0.0:
                return
            alpha = rho / below
            if step_along(alpha, y, Ay, x, r) <= goal:
                return
            self.solve(k, r, y)
            next_direction(A, dinv, 0.0, y, y, t)
            product = float(t @ t)
            if product == 0.0:
                return
            omega = float(t @ r) / product
            if step_along(omega, y, t, x, r) <= goal or omega == 0.0:
                return
            before, rho = rho, float(shadow @ r)
            p -= omega * Ay
            p *= rho / before * alpha / omega
            p += r


def inverse(B: np.ndarray, symmetric: bool) -> Any:
    """Return the inverse of a small dense matrix, the pseudo-inverse if singular."""
    try:
        X = np.linalg.inv(B)
        if np.linalg.norm(B) * np.linalg.norm(X) < SINGULAR_CONDITION:
            return X
    except np.linalg.LinAlgError:
        pass
    return np.linalg.pinv(B, rcond=1.0 / SINGULAR_CONDITION, hermitian=symmetric)
