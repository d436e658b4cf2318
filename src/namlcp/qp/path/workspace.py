"""The numbers and vectors of one solve by the interior-point method, by name.

Compiled functions take them as one record `m` of numbers and addresses, since every
array that is passed from one to another costs time to compile and to run:
``floats(m.x, m.n)`` is the vector x. In Python, `Workspace` has the same names.
"""

import ctypes

import numpy as np

from namlcp.compiled import address_of, fields, kernel, new_record, record_of
from namlcp.limits import Limits
from namlcp.qp.path.advance import (
    FACTOR,
    KRYLOV,
    OPERATIONS,
    PRODUCTS,
    READY,
    SOLVE,
    advance,
)
from namlcp.qp.path.krylov import KRYLOV_STEPS, step_krylov
from namlcp.qp.transforms import ScaledQP

# Vectors of the problem (`ScaledQP`, `KKT`); `cost`, `goal_b` and `goal_c` are those of
# the active-set systems.
GIVEN = "indptr indices base data factored place sign unit q b c cost goal_b goal_c"
# Vectors of the workspace, by size: n variables, p equations, m one-sided constraints,
# size = order of K. One-sided constraints are sign * t[place] + W = c with slacks
# W >= 0 and multipliers Z >= 0; t = (x, Ax, Gx) and v = (net z_box, y, net z) have the
# layout of K.
VECTORS = {
    # The iterate and the best one; the residuals, and the products P x and C'v;
    # the target rc of W dZ + Z dW, tau and omega of `steps`.
    "x best_x rd Px Ctv": "n",
    "y best_y rp": "p",
    "W Z best_Z rw rc tau omega": "m",
    "v t": "size",
    # The step; the one before the last corrector; P dx, C'dv and C dx of it.
    "dW dZ other_dW other_dZ": "m",
    "du other_du dv dt": "size",
    "Pdx Ctdv": "n",
    # Linear solves (`newton`): sums of omega, max(1, |K~_ii|), the right-hand side, the
    # residual and the solution of the last solve, another solution and its residual.
    "weight row_size rhs r answer trial trial_r": "size",
    # Relative residuals of the candidates for certificates, now and at the last test.
    "ratios tested": "candidates",
    # The active-set system (`refinement`).
    "set_x kept_x": "n",
    "set_y": "p",
    "set_Z": "m",
    "set_v kept_v goal": "size",
}
# Vectors of int32, as flags: constraints with Z > W now and one iteration before; those
# in the active-set system and in the next one; rows and variables that it holds.
FLAGS = {"active was_active set_active next_active": "m", "held": "size"}
KINDS = "n p m size candidates".split()
# Vectors of GMRES (`krylov`), which has memory once it is needed.
KRYLOV_NAMES = "basis corrections H rotations g".split()


def expanded(table: dict[str, str]) -> dict[str, str]:
    """Return the size of each of the names in a table."""
    return {name: size for names, size in table.items() for name in names.split()}


# The size of each vector, in the order of their addresses in a record.
PLACED = expanded(VECTORS) | expanded(FLAGS)
FLAG_NAMES = frozenset(expanded(FLAGS))
SIZES = np.array([KINDS.index(kind) for kind in PLACED.values()])


class PathState(ctypes.Structure):
    """Numbers and addresses: attributes in Python, fields in compiled code."""

    _fields_ = fields(
        # Sizes, then addresses, with those of PLACED one after another.
        (" ".join((*KINDS, *PLACED, *KRYLOV_NAMES)), int),
        (GIVEN, int),
        # Where the loop is (`advance`): the stage, the stages after the linear solve or
        # factorisation under way and after its refinement.
        ("stage after then", int),
        # What the caller has to do; operations since the last look at the clock, and in
        # one iteration.
        ("wants", int),
        ("operations iteration_work", float),
        # Tolerances, the larger one, and the relative residual that ends a refinement.
        ("eps_abs eps_rel tol accuracy", float),
        # The residual at which refinement last came to a halt.
        ("attained", float),
        # Iterations, most of them; whether each one is reported.
        ("iterations max_iter", int),
        ("reports", bool),
        # The mean of W Z, norms of the scaled residuals rd, rp and rw, then the first
        # six numbers of `Residuals`, and the first three over their tolerances; |x'rd|
        # and |y'rp + Z'rw|, the shares of the residuals in the gap.
        ("mu dual_norm row_norm slack_norm", float),
        ("dual_share primal_share", float),
        ("primal dual gap primal_size dual_size gap_size", float),
        ("primal_ratio dual_ratio gap_ratio", float),
        # The largest of the three, inf for NaN; the least one since the last restart.
        ("worst best", float),
        # Longest steps, W'Z after them; the target of W Z; LIFT or 0, see `advance`.
        ("primal_step dual_step product target lift", float),
        # The step before the last corrector: its lengths and relative residual.
        ("other_primal_step other_dual_step other_error", float),
        # Largest change of x, and of y and Z, by the last step.
        ("change_x change_yz", float),
        # Regularisation, and iterations left without lowering it.
        ("rho delta", float),
        ("wait", int),
        # Factorisations for this step; whether the last one succeeded; whether K~ is
        # factored by the caller.
        ("attempts", int),
        ("is_factored", bool),
        # Norm of the right-hand side, relative residual of the solution, that of the
        # predictor, and solves made.
        ("rhs_norm error predicted_error", float),
        ("solves", int),
        # Whether GMRES halved the residual when it was last tried.
        ("krylov_pays", bool),
        # Steps of GMRES, -1 before it begins, and the norm of its first residual.
        ("krylov_step", int),
        ("krylov_size", float),
        # Worst ratio that must be halved, iterations since it was, some counted as
        # `advance.IDLE` ones; the primal residual one iteration before; patience.
        ("reference", float),
        ("since", int),
        ("old_primal", float),
        ("patience", int),
        # Worst ratio at the last active-set refinement, to be reduced to `drop` of it.
        ("last_refined drop", float),
        # Whether the residuals that a certificate forbids to vanish do not fall; their
        # norms one iteration before.
        ("primal_stuck dual_stuck", bool),
        ("old_dual_norm old_primal_norm", float),
        # The active-set system: its regularisation, most proximal steps, the first and
        # the least residual, steps in a row that did not halve it; whether it fell
        # tenfold; whether the next active set is another; the largest violation of a
        # slack or multiplier, unscaled.
        ("regularisation", float),
        ("most_solves", int),
        ("first_error least_error", float),
        ("failures", int),
        ("converged set_changed", bool),
        ("set_violation", float),
    )


ENDS = np.array((0, len(KINDS), len(PLACED), len(KRYLOV_NAMES))).cumsum()
"""Where the sizes of a record, the addresses of PLACED and of KRYLOV_NAMES end."""


class Workspace:
    """The state of a solve; `now` has the numbers, and vectors are attributes.

    A vector is a view of the memory that compiled code uses. `now.du` and the like are
    addresses, which compiled code exchanges: ask for the attribute again after a call.
    """

    def __init__(self, problem: ScaledQP, limits: Limits) -> None:
        """Allocate for a scaled problem."""
        self.problem, self.kkt = problem, problem.kkt
        now, self.state = new_record(PathState)
        self.now = now
        self.fields = np.frombuffer(memoryview(now).cast("B"), np.int64, ENDS[-1])
        sizes = np.array((problem.n, problem.p, problem.c.size, self.kkt.size, 4))
        self.fields[: ENDS[1]] = sizes
        self.memory = place_vectors(self.fields[ENDS[1] : ENDS[2]], sizes[SIZES])
        self.begin = address_of(self.memory)
        now.eps_abs, now.eps_rel = limits.tolerances
        self.attach()

    def attach(self) -> None:
        """Take the vectors of the problem, which a restart replaces."""
        problem, kkt = self.problem, self.kkt
        q, b, c = problem.q, problem.b, problem.c
        triangle = kkt.indptr, kkt.indices, kkt.base, kkt.data, kkt.factored
        self.given = triangle, (problem.place, problem.sign, problem.unit, q, b, c)
        attach_problem(self.state, *self.given)
        self.now.iteration_work = OPERATIONS

    def run(self, stage: int) -> int:
        """Go on from this stage; return LOOK, READY or FAILED, see `advance`."""
        self.now.stage = stage
        return self.resume()

    def perform(self, task: int) -> None:
        """Do a task apart from the loop, which goes on later from where it was."""
        stage = self.now.stage
        self.run(task)
        self.now.stage = stage

    def resume(self) -> int:
        """Go on from where the last call stopped."""
        now, kkt = self.now, self.kkt
        while True:
            found = advance(self.state)
            if found == FACTOR:
                now.is_factored = kkt.factor()
            elif found == SOLVE:
                self.answer[:] = kkt.plan().solve(self.r)
            elif found == KRYLOV:
                if now.basis == 0:
                    self.place_krylov()
                step_krylov(self.state)
            else:
                return found

    def factor(self) -> bool:
        """Factor the matrix `data`; tell whether that succeeds."""
        self.now.after = READY
        self.perform(FACTOR)
        return self.now.is_factored

    def solve_once(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution of K~ u = rhs, without refinement."""
        self.r[:] = rhs
        self.now.after = READY
        self.perform(SOLVE)
        return self.answer

    def multiply(
        self, x: np.ndarray, v: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return P x, C'v and (x, C x) for scaled x and v."""
        self.set_x[:] = x
        self.set_v[:] = v
        self.perform(PRODUCTS)
        return self.Pdx, self.Ctdv, self.dv

    def place_krylov(self) -> None:
        """Give GMRES its vectors."""
        size, k = self.now.size, KRYLOV_STEPS
        sizes = np.array(((k + 1) * size, k * size, k * (k + 1), 2 * k, k + 1))
        self.krylov_memory = place_vectors(self.fields[ENDS[2] :], sizes)

    def __getattr__(self, name: str) -> np.ndarray:
        """Return the vector of this name."""
        if name not in PLACED:
            raise AttributeError(f"the workspace has no vector {name!r}")
        start = (getattr(self.now, name) - self.begin) // self.memory.itemsize
        count = getattr(self.now, PLACED[name])
        part = self.memory[start : start + count]
        return part.view(np.int32)[:count] if name in FLAG_NAMES else part


def place_vectors(addresses: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Set the addresses of vectors of these sizes, in the memory returned, which is 0.

    There is room for a float64 for each entry, of flags too.
    """
    ends = sizes.cumsum()
    memory = np.zeros(ends[-1])
    addresses[:] = address_of(memory) + memory.itemsize * (ends - sizes)
    return memory


@kernel
def attach_problem(state, triangle, vectors):
    """Set the addresses of GIVEN."""
    m = record_of(state)
    indptr, indices, base, data, factored = triangle
    place, sign, unit, q, b, c = vectors
    m.indptr, m.indices = indptr.ctypes.data, indices.ctypes.data
    m.base, m.data, m.factored = (
        base.ctypes.data,
        data.ctypes.data,
        factored.ctypes.data,
    )
    m.place, m.sign, m.unit = place.ctypes.data, sign.ctypes.data, unit.ctypes.data
    m.q, m.b, m.c = q.ctypes.data, b.ctypes.data, c.ctypes.data
    m.cost, m.goal_b, m.goal_c = m.q, m.b, m.c
