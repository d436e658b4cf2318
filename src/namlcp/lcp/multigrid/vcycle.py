"""The V(1,1)-cycle truncated to a face, and the Krylov method that it preconditions."""

from typing import Any, NamedTuple

import numpy as np
from scipy.linalg.blas import daxpy, dnrm2

from namlcp.lcp.multigrid.kernels import ascend, descend, truncate_coarse

# Condition number from which on the coarsest matrix gets a pseudo-inverse.
SINGULAR_CONDITION = 1e13


class Level(NamedTuple):
    """One level of a hierarchy; P, R and C lead to the next, empty on the last.

    A : (n, n). diagonal, d : positions and values of its diagonal entries. P : (n, m),
    interpolation; R = P'; all csr_arrays. C : (m,), index of each coarse unknown.
    """

    A: Any
    diagonal: np.ndarray
    d: np.ndarray
    P: Any
    R: Any
    C: np.ndarray


class FaceOnLevel(NamedTuple):
    """The free unknowns F of one level, and what follows from them.

    A: the matrix of the level, truncated by the faces of the finer levels. dinv (n,):
    1 / a_ii on F, 0 elsewhere. touched (n,): rows of A that differ from the matrix of
    the level. position (n,): work of `truncate_coarse`, empty while A is the matrix of
    the level itself.
    """

    A: Any
    dinv: np.ndarray
    touched: np.ndarray
    position: np.ndarray


class VCycle:
    """Approximate inverses of A_FF on the levels of a hierarchy.

    A caller sets a face in faces[k].dinv and calls `follow_face`, which changes coarser
    levels only; so faces on several levels must be set from the coarsest level up.
    """

    def __init__(self, levels: list[Level], symmetric: bool):
        self.levels = levels
        self.symmetric = symmetric
        self.faces = []
        for level in levels:  # all unknowns are free
            touched, position = np.zeros(level.d.size, np.uint8), np.empty(0, np.int32)
            self.faces.append(FaceOnLevel(level.A, 1.0 / level.d, touched, position))
        self.invert_coarsest()

    def follow_face(self, k: int) -> None:
        """Truncate the levels coarser than k after a change of faces[k].dinv."""
        for fine in range(k, len(self.levels) - 1):
            level, coarse = self.levels[fine], self.levels[fine + 1]
            face, below = self.faces[fine], self.faces[fine + 1]
            if not below.position.size:  # its matrix is still that of the level
                position = np.zeros(below.dinv.size, dtype=np.int32)
                below = below._replace(A=below.A.copy(), position=position)
                self.faces[fine + 1] = below
            truncate_coarse(level, face, coarse, below)
        self.invert_coarsest()

    def invert_coarsest(self) -> None:
        """Invert the free block of the last level."""
        face = self.faces[-1]
        free = np.flatnonzero(face.dinv)
        self.inverse, block = np.zeros(face.A.shape), np.ix_(free, free)
        self.inverse[block] = inverse(face.A.toarray()[block], self.symmetric)

    def solve(self, k: int, b: np.ndarray) -> np.ndarray:
        """Return the V-cycle from level k on applied to b."""
        if k == len(self.levels) - 1:
            return self.inverse @ b
        level, face = self.levels[k], self.faces[k]
        A, P, dinv, diagonal = face.A, level.P, face.dinv, level.diagonal
        x, coarse = np.empty_like(b), np.empty(level.C.size)
        descend(A, diagonal, P, dinv, b, x, coarse)
        ascend(A, diagonal, P, dinv, b, self.solve(k + 1, coarse), x)
        return x

    def krylov(self, k: int, r: np.ndarray, goal: float, steps: int) -> np.ndarray:
        """Solve A_FF x = r on the face F of level k; return x, 0 outside F.

        Each step makes the residual least along the image of the V-cycle, which is made
        orthogonal to the image before (Orthomin(1): Vinsome, SPE 5729, 1976). It ends
        at a residual of at most `goal`, or after `steps` steps. On these matrices it
        takes as many V-cycles as conjugate gradients, or as BiCGStab where A is not
        symmetric.
        """
        A, free = self.levels[k].A, self.faces[k].dinv != 0.0
        x, p, Ap = np.zeros((3, r.size))
        square = 1.0
        for _ in range(steps):
            if dnrm2(r) <= goal:
                break
            y = self.solve(k, r)
            Ay = np.where(free, A @ y, 0.0)
            overlap = float(Ay @ Ap) / square
            p, Ap = daxpy(p, y, a=-overlap), daxpy(Ap, Ay, a=-overlap)
            square = float(Ap @ Ap)
            if not square > 0.0:
                break
            step = float(r @ Ap) / square
            x, r = daxpy(p, x, a=step), daxpy(Ap, r, a=-step)
        return x


def inverse(B: np.ndarray, symmetric: bool) -> Any:
    """Return the inverse of a small dense matrix, the pseudo-inverse if singular."""
    try:
        X = np.linalg.inv(B)
        if np.linalg.norm(B) * np.linalg.norm(X) < SINGULAR_CONDITION:
            return X
    except np.linalg.LinAlgError:
        pass
    return np.linalg.pinv(B, rcond=1.0 / SINGULAR_CONDITION, hermitian=symmetric)
