"""Convex QPs as a differentiable function of PyTorch; needs torch 2.2 or newer.

``namlcp.torch.solve_qp`` solves on the processor in double precision, whatever the
tensors are, and returns tensors of their type and device.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import torch

from namlcp.results import QPSolution
from namlcp.stack import Stack


def solve_qp(
    P: torch.Tensor,
    q: torch.Tensor,
    G: torch.Tensor | None = None,
    h: torch.Tensor | None = None,
    A: torch.Tensor | None = None,
    b: torch.Tensor | None = None,
    lb: torch.Tensor | None = None,
    ub: torch.Tensor | None = None,
    **settings: Any,
) -> QPSolution[torch.Tensor]:
    """Solve convex QPs so that autograd can differentiate their solutions.

    ``minimise 1/2 x'Px + q'x  subject to  Gx <= h,  Ax = b,  lb <= x <= ub``

    Parameters
    ----------
    P : (..., n, n) tensor
        Symmetrised: the QP is that of (P + P') / 2.
    q, G, h, A, b, lb, ub : tensors, optional from G on
        As for `namlcp.solve_qp`, but of its shapes: no number for all bounds, no row
        for a matrix. Leading axes of all arguments broadcast.
    **settings
        The fields of `namlcp.Options`; threads are those of `namlcp.solve_batch` if
        there are leading axes.

    Returns
    -------
    QPSolution
        All parts can be differentiated in all arguments, in reverse and forward mode,
        once: a second derivative raises RuntimeError. An item that is not solved
        (infeasible, unbounded, out of time) is NaN, whatever the option `infeasible`
        says, and its gradients are 0: weigh it by `solved` in a loss, with torch.where.

    Raises
    ------
    ValueError, TypeError
        An argument is malformed, or P not convex. With leading axes an item of which
        this is true is not solved.

    Notes
    -----
    At a kink of the solution a gradient is chosen as by `namlcp.QPResult.backward`.
    float32 and other types are converted to float64 and back.

    Examples
    --------
    >>> import torch
    >>> import namlcp
    >>> q = torch.tensor([-1.0, -4.0], requires_grad=True)
    >>> ub = torch.tensor([2.0, 1.0])
    >>> x = namlcp.torch.solve_qp(torch.eye(2), q, ub=ub).x
    >>> x.sum().backward()
    >>> x.tolist(), q.grad.tolist()
    ([1.0, 1.0], [-1.0, 0.0])
    """
    if not q.is_floating_point():  # the solution is of its type
        q = q.to(torch.get_default_dtype())
    parts = [(P + P.mT) / 2, q, G, h, A, b, lb, ub]
    x, y, z, z_box, solved, _ = Solve.apply(settings, *parts)
    return QPSolution(x, y, z, z_box, solved)


class Solve(torch.autograd.Function):
    """The solution of a `Stack` as a function of its arguments."""

    @staticmethod
    def forward(settings: dict[str, Any], *parts: Any) -> tuple[Any, ...]:
        """Return x, y, z, z_box, solved and the stack."""
        stack = Stack([array_of(part) for part in parts], settings)
        kind = kind_of(parts[1])
        solution = (torch.tensor(v, **kind) for v in stack.solution)
        return *solution, torch.tensor(stack.solved, device=kind["device"]), stack

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        _, *parts = inputs
        ctx.stack = output[-1]
        ctx.kinds = [kind_of(part) for part in parts]
        ctx.save_for_backward(*parts)
        ctx.save_for_forward(*parts)
        ctx.mark_non_differentiable(output[-2])

    @staticmethod
    def backward(ctx: Any, *cotangents: Any) -> tuple[Any, ...]:
        def found(*solution: Any) -> list[Any]:
            gradients = ctx.stack.backward(solution, ctx.needs_input_grad[1:])
            pairs = zip(gradients, ctx.kinds, strict=True)
            return [None if v is None else torch.tensor(v, **kind) for v, kind in pairs]

        return None, *once(ctx, found, cotangents[:4])

    @staticmethod
    def jvp(ctx: Any, _: Any, *tangents: Any) -> tuple[Any, ...]:
        def found(*changes: Any) -> list[Any]:
            return [torch.tensor(v, **ctx.kinds[1]) for v in ctx.stack.forward(changes)]

        return *once(ctx, found, tangents), None, None


def once(ctx: Any, found: Callable[..., Any], tensors: Sequence[Any]) -> Any:
    """Return what is found for tensors, and refuse to differentiate it.

    It depends on the data, too. Only where that may matter they are asked for: they may
    have been changed in place since, which torch refuses then.
    """
    if not torch.is_grad_enabled():  # this saves 50 us
        return found(*map(array_of, tensors))
    return Once.apply(found, len(tensors), *tensors, *ctx.saved_tensors)


class Once(torch.autograd.Function):
    """A derivative as a function of its direction and of the data."""

    @staticmethod
    def forward(found: Callable[..., Any], count: int, *tensors: Any) -> Any:
        return tuple(found(*map(array_of, tensors[:count])))

    @staticmethod
    def setup_context(ctx: Any, inputs: Any, output: Any) -> None:
        """Keep nothing."""

    @staticmethod
    def backward(ctx: Any, *_: Any) -> Any:
        raise RuntimeError(
            "solutions of namlcp.torch.solve_qp can be differentiated once, those of "
            "namlcp.jax.solve_qp any number of times"
        )

    jvp = backward


def array_of(tensor: torch.Tensor | None) -> np.ndarray | None:
    if tensor is None:
        return None
    return tensor.detach().to("cpu", torch.float64, copy=True).numpy()


def kind_of(tensor: torch.Tensor | None) -> dict[str, Any]:
    """Return type and device of a tensor, as `torch.tensor` takes them."""
    return {} if tensor is None else {"dtype": tensor.dtype, "device": tensor.device}
