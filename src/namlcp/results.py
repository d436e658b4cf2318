"""What the public functions return; it keeps the problem by reference."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from inspect import get_annotations
from operator import index
from time import perf_counter
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from namlcp.arrays import stamp_of
from namlcp.derivatives.gradients import (
    BatchGradients,
    LCPGradients,
    LCPTangent,
    QPGradients,
    QPTangent,
)
from namlcp.derivatives.lcp import LCPDerivative
from namlcp.derivatives.qp import BatchDerivative, ClosestDerivative, QPDerivative
from namlcp.lcp.data import LCP, Prepared
from namlcp.qp.batch import CHANGED, STATUSES, Items
from namlcp.qp.closest import Nearest
from namlcp.qp.intake import whole
from namlcp.qp.problem import QP, Point
from namlcp.residuals import Residuals
from namlcp.result_base import LCPResultBase, ResultBase
from namlcp.status import OBJECTIVE, Outcome, Status

LOST = (
    "derivatives need the result of the solve itself: a pickled or copied one has lost "
    "the problem"
)
Array = TypeVar("Array")
# What results keep for their derivatives; most entries of an array printed in full.
INNER, SHORT = ("problem", "stages", "stamp"), 8


class Public(type):
    """Classes of which `dir` and `help` show `data_of` and PUBLIC alone."""

    PUBLIC = ()

    def __new__(kind, name: str, bases: Any, parts: dict[str, Any]) -> Any:
        """Let `dir` show of an object what it shows of the class."""
        names = {"__dir__": lambda one: dir(type(one))}
        return super().__new__(kind, name, bases, parts | names)

    def __dir__(cls) -> list[str]:
        names = (name for name in super().__dir__() if name.startswith("__"))
        return sorted({*names, *data_of(cls), *cls.PUBLIC})


def data_of(kind: Any) -> dict[str, None]:
    """Return the names of the attributes of a class of results."""
    names = (name for base in kind.__mro__ for name in get_annotations(base))
    return dict.fromkeys(name for name in names if name not in INNER)


def described(result: Any) -> str:
    """Return a result in some lines: numbers in the first one, then a line an array."""
    head: list[str] = []
    lines: list[str] = []
    for name in data_of(type(result)):
        value = getattr(result, name)
        if isinstance(value, Status):
            head.append(value)
        elif isinstance(value, float):
            head.append(f"{name} = {value:{'.1e' if 'time' in name else '.6g'}}")
        elif isinstance(value, int | str) and name != "message":
            head.append(f"{name} = {value}")
        elif isinstance(value, np.ndarray):
            is_plain = value.ndim == 1 and value.dtype.names is None
            text = f"array of shape {value.shape}"
            if is_plain:
                text = np.array2string(value, 200, 6, threshold=SHORT)
            lines += [f"{name} = {text}"] * (value.size > 0)
        elif isinstance(value, Residuals):
            lines.append("residuals = {:.1e}, {:.1e}, {:.1e}".format(*value))
        elif isinstance(value, dict):
            lines += [f"{name} of {len(value)} items"] * (len(value) > 0)
        elif value not in (None, ""):
            lines.append(f"{name} = {str(value).splitlines()[0]}")
    return "\n    ".join((f"{type(result).__name__}: {', '.join(head)}", *lines))


class Single(metaclass=Public):
    """The result of one problem, kept by reference for the derivatives."""

    __slots__ = ()
    __repr__ = described
    status: Status

    @property
    def found(self) -> bool:
        """Whether the status is SOLVED; ``if result:`` asks the same."""
        return self.status is Status.SOLVED

    def __bool__(self) -> bool:
        return self.status is Status.SOLVED

    def __reduce__(self) -> tuple[Any, ...]:
        """Leave the problem and the factors behind, in a pickle and in a copy."""
        kind = type(self)
        return remade, (kind, {name: getattr(self, name) for name in data_of(kind)})


def remade(kind: Any, data: dict[str, Any]) -> Any:
    return kind(**data)


class LCPResult(Single, LCPResultBase):
    """Result of `solve_lcp`; read `status` first, or `found`, as ``if result:`` does.

    Attributes
    ----------
    status : Status
        How the solve ended.
    z, w : (n,) array
        The solution, else the best point found, and w = A z + q; NaN for
        NUMERICAL_ERROR. z is within its bounds to the last bit; w is what the product
        rounds to, so that the w_i that should be 0 or have a sign miss it by rounding.
    s : (n,) array
        The modulus variable: z = clip(s, lower, upper), w = Omega (z - s), with the
        Omega of a named method, diag(A) for "auto".
    iterations : int
        Sweeps, multigrid cycles, MPRGP iterations, pivots (of the methods of Lemke, and
        Lemke and Howson), cones (enumeration) or else factorisations, by `method`.
    residual : float
        || z - clip(z - w, lower, upper) ||_2, recomputed on the caller's data.
    method : str
        The method that gave the point; for "auto" one of "tridiagonal", "psor",
        "multigrid", "mprgp", "pivoting", and for general matrices "lemke",
        "lemke-howson", "enumeration", "path" (interior), "arc" (smooth homotopy), or
        "start" for a start that one exact step has completed.
    setup_time, solve_time : float
        Seconds.
    ray : (n,) array or None
        With UNSOLVABLE, a vector v that proves it, where one was found: v_i <= 0 where
        u_i is finite, v_i >= 0 where l_i is finite, and q'v + z'A'v <= -1 for all z in
        the box. For the plain LCP: v >= 0, A'v <= 0, q'v = -1. A solution would have
        v'w >= 0, but v'w = q'v + z'A'v < 0.
    message : str
        A sentence that adds to the status, or "".
    history : structured array or None
        The rows of the verbose table, when asked for: one for each iteration, for
        "auto" one for each factorisation or run of sweeps. The residuals are those of
        the iterates; where factorisations are counted, those of the best point so far.

    Notes
    -----
    `backward`, `forward` and `directional` raise ValueError where those of `QPResult`
    do, and where A is a LinearOperator. The formulas stand in `namlcp.derivatives.lcp`:
    the first call factors the matrix of the unknowns between their bounds, or takes the
    multigrid hierarchy of the solve; later calls solve.

    Examples
    --------
    >>> import namlcp
    >>> result = namlcp.solve_lcp([[2.0, 1.0], [0.0, 1.0]], [-4.0, 1.0])
    >>> result.status.value, result.z, result.w + 0.0
    ('solved', array([2., 0.]), array([0., 1.]))
    >>> namlcp.solve_lcp([[0.0]], [-1.0]).ray  # w = -1 whatever z is
    array([1.])
    """

    status: Status
    z: np.ndarray
    w: np.ndarray
    s: np.ndarray
    iterations: int
    residual: float
    method: str
    setup_time: float
    solve_time: float
    ray: np.ndarray | None
    message: str
    history: np.ndarray | None

    PUBLIC = "backward", "derivative", "directional", "forward", "found"
    __slots__ = ()

    def backward(self, dz: Any = None, dw: Any = None) -> LCPGradients:
        """Return the gradients of a scalar in the data of the LCP.

        Parameters
        ----------
        dz, dw : (n,) array, optional
            The gradients of the scalar in z and w, 0 where absent.

        Returns
        -------
        LCPGradients
            In A, q, lower and upper; its `weak` and `singular` tell where the solution
            is not differentiable.

        Examples
        --------
        >>> import namlcp
        >>> A = np.array([[2.0, 1.0], [0.0, 1.0]])
        >>> result = namlcp.solve_lcp(A, np.array([-4.0, 1.0]))  # z = (2, 0)
        >>> gradients = result.backward(dz=[1.0, 0.0])
        >>> gradients.q + 0.0, gradients.A[0] + 0.0
        (array([-0.5,  0. ]), array([-1.,  0.]))
        """
        return self.derivative.backward(dz, dw)

    def forward(
        self, *, dA: Any = None, dq: Any = None, dlower: Any = None, dupper: Any = None
    ) -> LCPTangent:
        """Return the derivative of the solution along a direction of the data.

        Parameters
        ----------
        dA, dq, dlower, dupper : arrays, optional
            The direction, shaped as the data, 0 where absent; dA dense or sparse.

        Returns
        -------
        LCPTangent
            The derivatives of z and w.

        Examples
        --------
        >>> import namlcp
        >>> result = namlcp.solve_lcp([[2.0, 1.0], [0.0, 1.0]], [-4.0, 1.0])
        >>> result.forward(dq=[1.0, 0.0]).z
        array([-0.5,  0. ])
        """
        return self.derivative.forward(dA, dq, dlower, dupper)

    def directional(
        self, *, dA: Any = None, dq: Any = None, dlower: Any = None, dupper: Any = None
    ) -> LCPTangent:
        """Return the one-sided derivative of the solution along a direction.

        It is exact where unknowns are at a bound with w = 0, too, and not linear in the
        direction there; elsewhere it is that of `forward`, whose arguments and result
        it has. Those of an unknown with lower_i = upper_i must be equal. One more LCP
        is solved; ValueError says that it has no solution.

        Examples
        --------
        >>> import namlcp
        >>> result = namlcp.solve_lcp([[1.0]], [0.0])  # z = w = 0
        >>> [float(result.directional(dq=[d]).z[0]) for d in (-1.0, 1.0)]
        [1.0, 0.0]
        """
        return self.derivative.directional(dA, dq, dlower, dupper)

    @property
    def derivative(self) -> LCPDerivative:
        """The fixed unknowns and the factors of `backward` and `forward`."""
        base: Any = self  # its other attributes are those of compiled code
        lcp, given = problem_of(self)
        if base.kept is None:
            base.kept = LCPDerivative(lcp, given, self.z, self.w)
        return base.kept


class QPResult(Single, ResultBase):
    """Result of `solve_qp`; read `status` first, or `found`, as ``if result:`` does.

    Attributes
    ----------
    status : Status
        How the solve ended, and thus what the arrays hold.
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Primal point and multipliers of Ax = b, Gx <= h and the bounds, in qpsolvers'
        signs: P x + q + G'z + A'y + z_box = 0, z >= 0, z_box <= 0 at a lower bound.
        PRIMAL_INFEASIBLE: x is NaN, (y, z, z_box) a Farkas certificate with
        b'y + h'z + lb'z_box^- + ub'z_box^+ = -1; where a bound or a row is proof enough
        (lb > ub, h = -inf), it alone has a multiplier (see `namlcp.qp.certificates`),
        and `message` names it. DUAL_INFEASIBLE: x is a ray with q'x = -1 (it is not
        decided whether any x is feasible), the rest NaN. Otherwise the best point
        found: x is within its bounds to the last bit, and the signs are as above.
    obj : float
        1/2 x'Px + q'x; +inf when infeasible, -inf when unbounded.
    residuals : Residuals
        Recomputed on the user's unscaled data. PRIMAL_INFEASIBLE: `dual` is the largest
        |A'y + G'z + z_box|. DUAL_INFEASIBLE: `dual` is the largest |P x|, `primal` that
        of |A x| and (G x)^+. The rest is NaN then.
    iterations : int
        Pivots, sweeps or interior-point steps of the solver named by `form`.
    form : str
        The solver that gave the point: "bounds" (box LCP), "dual" (pivots) or "path"
        (interior point); "none" if time was over before any began.
    message : str
        A sentence that adds to the status, or "".
    setup_time, solve_time : float
        Seconds.
    history : structured array or None
        The rows of the verbose table, where the form has them.
    closest : ClosestPoint or None
        With PRIMAL_INFEASIBLE, the solution of the nearest feasible problem, if
        `Options.infeasible` asks for it.

    Notes
    -----
    Derivatives read the arrays that were given to the solve. `backward`, `forward` and
    `directional` raise ValueError where the status is not SOLVED, an array was changed
    in place since, or the result was pickled or copied, which leaves the problem
    behind. The formulas stand in `namlcp.derivatives.qp`: the first call factors the
    KKT system of the active constraints; later calls solve.

    Examples
    --------
    >>> import namlcp
    >>> result = namlcp.solve_qp([[2.0]], [-4.0], ub=[1.0])
    >>> result.status.value, result.x, result.z_box, result.obj
    ('solved', array([1.]), array([2.]), -3.0)
    >>> proof = namlcp.solve_qp([[2.0]], [0.0], A=[[2.0]], b=[1.0], lb=[1.0])
    >>> proof.status.value, proof.y, proof.z_box  # y b - 2 lb = -1
    ('primal_infeasible', array([1.]), array([-2.]))
    """

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    obj: float
    residuals: Residuals
    iterations: int
    form: str
    message: str
    setup_time: float
    solve_time: float
    history: np.ndarray | None
    closest: Any

    PUBLIC = LCPResult.PUBLIC
    __slots__ = ()

    def backward(
        self, dx: Any = None, dy: Any = None, dz: Any = None, dz_box: Any = None
    ) -> QPGradients:
        """Return the gradients of a scalar in the data of the QP.

        Parameters
        ----------
        dx, dy, dz, dz_box : (n,), (p,), (m,), (n,) array, optional
            The gradients of the scalar in x, y, z and z_box, 0 where absent.

        Returns
        -------
        QPGradients
            In P, q, G, h, A, b, lb and ub; its `weak` and `singular` tell where the
            solution is not differentiable.

        Examples
        --------
        >>> import namlcp
        >>> result = namlcp.solve_qp(np.diag([1.0, 2.0]), [-1.0, -4.0], ub=[2.0, 1.0])
        >>> gradients = result.backward(dx=[1.0, 1.0])  # of x_1 + x_2, x = (1, 1)
        >>> gradients.q, gradients.ub
        (array([-1.,  0.]), array([0., 1.]))
        """
        return self.derivative.backward(dx, dy, dz, dz_box)

    def forward(
        self,
        *,
        dP: Any = None,
        dq: Any = None,
        dG: Any = None,
        dh: Any = None,
        dA: Any = None,
        db: Any = None,
        dlb: Any = None,
        dub: Any = None,
    ) -> QPTangent:
        """Return the derivative of the solution along a direction of the data.

        Parameters
        ----------
        dP, dq, dG, dh, dA, db, dlb, dub : arrays, optional
            The direction, shaped as the data, 0 where absent; matrices dense or sparse,
            of dP the symmetric part counts.

        Returns
        -------
        QPTangent
            The derivatives of x, y, z and z_box.

        Examples
        --------
        >>> import namlcp
        >>> result = namlcp.solve_qp(np.diag([1.0, 2.0]), [-1.0, -4.0], ub=[2.0, 1.0])
        >>> result.forward(dq=[1.0, 0.0], dub=[0.0, 1.0]).x
        array([-1.,  1.])
        """
        changes = dict(P=dP, q=dq, G=dG, h=dh, A=dA, b=db, lb=dlb, ub=dub)
        return self.derivative.forward(changes)

    def directional(
        self,
        *,
        dP: Any = None,
        dq: Any = None,
        dG: Any = None,
        dh: Any = None,
        dA: Any = None,
        db: Any = None,
        dlb: Any = None,
        dub: Any = None,
    ) -> QPTangent:
        """Return the one-sided derivative of the solution along a direction.

        It is exact where constraints are active with a multiplier 0, too, and not
        linear in the direction there; elsewhere it is that of `forward`, whose
        arguments and result it has. dlb and dub of a pinned variable must be equal. One
        more QP is solved (`namlcp.derivatives.qp`); ValueError says that it
        has no solution.

        Examples
        --------
        >>> import namlcp
        >>> result = namlcp.solve_qp(np.eye(1), [0.0], lb=[0.0])  # x = 0, z_box = 0
        >>> [float(result.directional(dq=[d]).x[0]) for d in (-1.0, 1.0)]
        [1.0, 0.0]
        """
        changes = dict(P=dP, q=dq, G=dG, h=dh, A=dA, b=db, lb=dlb, ub=dub)
        return self.derivative.directional(changes)

    @property
    def derivative(self) -> QPDerivative:
        """The active constraints and factors of `backward` and `forward`."""
        base: Any = self  # its other attributes are those of compiled code
        qp, given = problem_of(self)
        if base.kept is None:
            point = Point(self.x, self.y, self.z, self.z_box)
            base.kept = QPDerivative(qp, point, given, base.factors)
        return base.kept


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class ClosestPoint(Single, Nearest):
    """The solution of the feasible problem nearest to an infeasible QP.

    That problem has the sides h + shift_h, b + shift_b, lb + shift_lb and ub +
    shift_ub, with the least shifts that leave some x feasible; `Relaxation` tells how
    they are measured. x, y, z, z_box and obj are named as in `QPResult`, so that
    ``result.closest or result`` is the one to read then; its `found` tells whether its
    x is a solution (the closest point may be late, too).

    Attributes
    ----------
    status : Status
        How the search ended. SOLVED: x has the least cost among all points with least
        shifts. DUAL_INFEASIBLE: that cost falls without bound along the ray x.
        PRIMAL_INFEASIBLE: the constraints that must not be shifted contradict each
        other, or an infinite shift is needed (h_i = -inf); all is NaN, obj inf.
        Otherwise x is the best point found, y, z, z_box are NaN, and `message` tells
        whether the shifts are the least ones.
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Point and multipliers of the shifted problem. Of its many multipliers (shifted
        rows leave no room) those come with the least multiple of a certificate that
        gives all their sign.
    obj : float
        1/2 x'Px + q'x; -inf if unbounded.
    residuals : Residuals
        Of the shifted problem; NaN unless SOLVED.
    shift_h, shift_b, shift_lb, shift_ub : (m,), (p,), (n,), (n,) array
        The shifts, shift_h and shift_ub >= 0, shift_lb <= 0.
    norm : int
        2 or 1, the norm in which the shifts are least.
    message : str
        A sentence that adds to the status, or "".

    Examples
    --------
    >>> import namlcp
    >>> G, h = np.array([[1.0], [-1.0]]), np.array([0.0, -3.0])  # x <= 0 and x >= 3
    >>> result = namlcp.solve_qp(np.eye(1), [0.0], G, h, infeasible="closest")
    >>> result.status.value, result.closest.x, result.closest.shift_h
    ('primal_infeasible', array([1.5]), array([1.5, 1.5]))
    """

    problem: Any = None  # the QP, and (P, G, A) as they were given
    stamp: int | None = None
    PUBLIC = "backward", "derivative", "found"

    def backward(
        self, dx: Any = None, dshift_h: Any = None, dshift_b: Any = None
    ) -> QPGradients:
        """Return the gradients of a scalar in the data of the infeasible QP.

        Parameters
        ----------
        dx, dshift_h, dshift_b : (n,), (m,), (p,) array, optional
            The gradients of the scalar in x and the shifts, 0 where absent.

        Returns
        -------
        QPGradients
            In P, q, G, h, A, b, lb and ub. If it is `singular`, the shifts leave some
            freedom to x; the gradients in G and A then hold for changes that keep the
            rank of the shifted rows, others make shifts and x jump.

        Raises
        ------
        ValueError
            As for `QPResult.backward`, or the shifts are not those of norm 2.

        Examples
        --------
        >>> import namlcp
        >>> G, h = np.array([[1.0], [-1.0]]), np.array([0.0, -3.0])  # x <= 0, x >= 3
        >>> result = namlcp.solve_qp(np.eye(1), np.zeros(1), G, h, infeasible="closest")
        >>> result.closest.x, result.closest.backward(dx=[1.0]).h.round(9)
        (array([1.5]), array([ 0.5, -0.5]))
        """
        return self.derivative.backward(dx, dshift_h, dshift_b)

    @property
    def derivative(self) -> ClosestDerivative:
        """The factors of `backward`."""
        if self.found and self.norm != 2:
            raise ValueError(
                f"derivatives need shifts of norm 2, got those of norm {self.norm}"
            )
        problem_of(self)  # raises where it has changed
        return self.kept

    @cached_property
    def kept(self) -> ClosestDerivative:
        return ClosestDerivative(*self.problem, *self.stages)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BatchResult(metaclass=Public):
    """Result of `solve_batch` for N items; ``batch[i]`` is the `QPResult` of item i.

    Attributes
    ----------
    codes : (N,) int8 array
        How each item ended: its place in ``list(Status)``; `statuses` has the members.
    x, y, z, z_box : (N, n), (N, p), (N, m), (N, n) array
        As in `QPResult`; NaN where an item is INVALID.
    obj : (N,) array
        Objectives.
    residuals : (N,) structured array
        Its fields are those of `Residuals`.
    iterations : (N,) array
    form : (N,) array of str
        The solver that gave the point; "" where an item is INVALID.
    messages : dict
        Sentences that add to the status, by the number of the item.
    closest : dict
        The `ClosestPoint` of infeasible items, by the number of the item, if
        `Options.infeasible` asks for it.
    solve_time : float
        Seconds for all items together.

    Examples
    --------
    >>> import namlcp
    >>> q = np.array([[-1.0], [2.0], [np.nan]])
    >>> batch = namlcp.solve_batch(np.eye(1), q, lb=np.zeros(1))
    >>> [status.value for status in batch.statuses], batch.x[:2, 0] + 0.0
    (['solved', 'solved', 'invalid'], array([1., 0.]))
    >>> batch[0].x
    array([1.])
    """

    codes: np.ndarray
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    obj: np.ndarray
    residuals: np.ndarray
    iterations: np.ndarray
    form: np.ndarray
    messages: dict[int, str]
    closest: dict[int, ClosestPoint]
    solve_time: float = 0.0
    problem: Items | None = None
    PUBLIC = "backward", "solved", "statuses"

    def backward(
        self,
        dx: Any = None,
        dy: Any = None,
        dz: Any = None,
        dz_box: Any = None,
        *,
        threads: int | None = None,
    ) -> BatchGradients:
        """Return the gradients of a scalar in the data of all items.

        Parameters
        ----------
        dx, dy, dz, dz_box : (N, n), (N, p), (N, m), (N, n) array, optional
            As for `QPResult.backward`, of each item.
        threads : int, optional
            Threads, by default one for each core.

        Returns
        -------
        BatchGradients
            Items that were not solved have gradients 0, and False in `used`. An
            argument shared by all items has the sum of their gradients.

        Examples
        --------
        >>> from namlcp import solve_batch
        >>> batch = solve_batch(np.eye(1), np.array([[-1.0], [1.0]]), lb=np.zeros(1))
        >>> gradients = batch.backward(dx=np.ones((2, 1)))
        >>> gradients.q.tolist(), gradients.lb.tolist()
        ([[-1.0], [0.0]], [1.0])
        """
        if self.problem is None:
            raise ValueError(LOST)
        self.problem.refuse_changes(slice(None))
        points = Point(self.x, self.y, self.z, self.z_box)
        derivative = BatchDerivative(self.problem, points, self.solved, threads)
        return derivative.backward(dx, dy, dz, dz_box)

    @property
    def statuses(self) -> list[Status]:
        """The status of each item."""
        return [STATUSES[code] for code in self.codes]

    @property
    def solved(self) -> np.ndarray:
        """(N,) bool: which items are solved."""
        return self.codes == STATUSES.index(Status.SOLVED)

    def __len__(self) -> int:
        return self.codes.size

    def __bool__(self) -> bool:
        raise TypeError("a batch is not true or false: ask batch.solved.all(), or len")

    __repr__ = described
    __reduce__ = Single.__reduce__

    def __iter__(self) -> Iterator[QPResult]:
        return map(self.__getitem__, range(len(self)))

    def __getitem__(self, i: int) -> QPResult:
        """Return the result of one item; its times are not measured."""
        if not -len(self) <= index(i) < len(self):
            raise IndexError(f"the batch has {len(self)} items, got item {i}")
        number = range(len(self))[i]
        return QPResult(
            **{name: getattr(self, name)[i] for name in Point._fields},
            status=STATUSES[self.codes[i]],
            obj=float(self.obj[i]),
            residuals=Residuals(*self.residuals[i].item()),
            iterations=int(self.iterations[i]),
            form=str(self.form[i]),
            message=self.messages.get(number, ""),
            closest=self.closest.get(number),
            problem=self.problem and partial(self.problem.item, number),
        )


class QPSolution(NamedTuple, Generic[Array]):
    """Solutions of QPs in another package's arrays, named as in `QPResult`.

    x, y, z, z_box : (..., n), (..., p), (..., m), (..., n) tensor or array
        NaN where a QP is not solved.
    solved : (...) tensor or array of bool
    """

    x: Array
    y: Array
    z: Array
    z_box: Array
    solved: Array


def qp_result(
    outcome: Outcome,
    problem: tuple[QP, tuple[Any, Any, Any]],
    start: float,
    ready: float,
    history: np.ndarray | None = None,
) -> QPResult:
    """Return the outcome for `problem`, the checked QP and (P, G, A) as given.

    start, ready: the values of perf_counter() at the call and after its checks.
    """
    closest = outcome.closest
    return QPResult(
        **outcome.point._asdict(),
        status=outcome.status,
        obj=OBJECTIVE.get(outcome.status, outcome.residuals.objective),
        residuals=outcome.residuals,
        iterations=outcome.iterations,
        form=outcome.method,
        message=outcome.message,
        setup_time=ready - start,
        solve_time=perf_counter() - ready,
        history=history,
        closest=closest and closest_point(closest, problem),
        problem=problem,
    )


def closest_point(found: Nearest, problem: tuple[QP, Any]) -> ClosestPoint:
    """Return what was found for an infeasible problem, given as in `qp_result`."""
    return ClosestPoint(**vars(found), problem=problem, stamp=stamp_of(problem[0]))


def batch_result(outcomes: Any, items: Items, seconds: float) -> BatchResult:
    pairs = outcomes.closest.items()
    outcomes.closest = {i: closest_point(one, items.item(i)) for i, one in pairs}
    return BatchResult(**vars(outcomes), solve_time=seconds, problem=items)


def lcp_result(
    outcome: Outcome,
    problem: tuple[LCP, Any],
    start: float,
    ready: float,
    history: np.ndarray | None,
) -> LCPResult:
    """Return the outcome for the checked LCP and A as given; times as `qp_result`."""
    point, (lcp, _) = outcome.point, problem
    if point.s is None:
        with np.errstate(all="ignore"):  # of numbers that are not finite
            point = point._replace(s=point.z - point.w / lcp.matrix.slopes)
    return LCPResult(
        **point._asdict(),
        status=outcome.status,
        iterations=outcome.iterations,
        residual=outcome.residuals,
        method=outcome.method,
        setup_time=ready - start,
        solve_time=perf_counter() - ready,
        ray=outcome.ray,
        message=outcome.message,
        history=history,
        problem=problem,
        stamp=stamp_of(lcp[1:], lcp.matrix.stamp),
    )


def problem_of(result: Any) -> Any:
    """Return the problem of a result; raise ValueError if there is no derivative."""
    if result.status is not Status.SOLVED:
        raise ValueError(
            f"derivatives need a result of status solved, got {result.status.value}"
        )
    problem = result.problem
    if problem is None:
        raise ValueError(LOST)
    if callable(problem):
        return problem()
    if type(problem[0]) is tuple:  # the matrices, the vectors, and P, G, A of a Solver
        matrices, vectors, given = problem
        problem = QP.of(matrices, vectors), given
    elif isinstance(result, LCPResult) and len(problem) == 5:  # see `solve_small`
        A, is_symmetric, q, lower, upper = problem
        if type(A) is Prepared:
            matrix, A = A, A.A
        else:
            dense = A if type(A) is np.ndarray else Prepared(A).small
            matrix = Prepared.unchecked(dense, is_symmetric)
        lower = np.zeros(q.size) if lower is None else lower
        upper = np.full(q.size, np.inf) if upper is None else upper
        problem = LCP(matrix, q, lower, upper), A
    if result.stamp is not None and result.stamp != stamp_now(problem):
        raise ValueError(CHANGED)
    if len(problem) == len(QP._fields):  # the arguments of `solve_small`
        return whole(*problem), problem[:6:2]
    return problem


def stamp_now(problem: Any) -> int:
    first = problem[0]
    if isinstance(first, LCP):
        return stamp_of(first[1:], first.matrix.stamp_now())
    return stamp_of(first if isinstance(first, QP) else problem)
