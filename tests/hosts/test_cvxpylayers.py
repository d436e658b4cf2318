"""Layers of cvxpylayers for PyTorch with our solver."""

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("cvxpylayers", minversion="1.2")
import cvxpy as cp  # noqa: E402
from cvxpylayers.torch import CvxpyLayer  # noqa: E402

from namlcp.cvxpylayers import NAM  # noqa: E402


def parameters(*shapes):
    torch.manual_seed(0)
    return [torch.randn(s, dtype=torch.float64, requires_grad=True) for s in shapes]


def layer(P_is_parametric=False):
    """min x'Px/2 + c'x, G x <= h, sum x = 1, |x| <= 3, with its duals."""
    n, m = 3, 2
    x, c, G, h = cp.Variable(n), cp.Parameter(n), cp.Parameter((m, n)), cp.Parameter(m)
    L = cp.Parameter((n, n))
    square = cp.sum_squares(L @ x) if P_is_parametric else 2.0 * cp.sum_squares(x)
    rows = [G @ x <= h, cp.sum(x) == 1, x <= 3, x >= -3]
    problem = cp.Problem(cp.Minimize(0.5 * square + c @ x), rows)
    data = [c, G, h, L] if P_is_parametric else [c, G, h]
    duals = [row.dual_variables[0] for row in rows[:2]]
    made = CvxpyLayer(problem, data, [x, *duals], solver=NAM())
    return made, parameters(*(v.shape for v in data))


@pytest.mark.parametrize("P_is_parametric", [False, True])
def test_gradients_pass_the_check_of_torch(P_is_parametric):
    made, data = layer(P_is_parametric)
    assert torch.autograd.gradcheck(made, data)


def test_batches():
    made, data = layer()
    stacked = [torch.stack([v, 0.5 * v]).detach().requires_grad_() for v in data]
    found = made(*stacked)
    found[0].square().sum().backward()
    for k, scale in enumerate((1.0, 0.5)):
        alone = [(scale * v).detach().requires_grad_() for v in data]
        x = made(*alone)[0]
        np.testing.assert_allclose(found[0][k].detach(), x.detach(), atol=1e-9)
        x.square().sum().backward()
        for v, w in zip(stacked, alone, strict=True):
            np.testing.assert_allclose(v.grad[k], w.grad, atol=1e-8)


def test_a_linear_program():
    x, c = cp.Variable(2), cp.Parameter(2)
    problem = cp.Problem(cp.Minimize(c @ x), [x >= 1.0, cp.sum(x) >= 3.0])
    made = CvxpyLayer(problem, [c], [x], solver=NAM())
    cost = torch.tensor([1.0, 2.0], dtype=torch.float64, requires_grad=True)
    (found,) = made(cost)
    np.testing.assert_allclose(found.detach(), [2.0, 1.0], atol=1e-9)
    found.sum().backward()
    np.testing.assert_allclose(cost.grad, [0.0, 0.0], atol=1e-9)


def test_no_solution_and_other_cones_raise():
    x, c = cp.Variable(), cp.Parameter()
    problem = cp.Problem(cp.Minimize(cp.square(x)), [x >= c, x <= 0])
    made = CvxpyLayer(problem, [c], [x], solver=NAM())
    with pytest.raises(RuntimeError, match="namlcp: primal_infeasible"):
        made(torch.tensor(1.0, dtype=torch.float64))
    with pytest.raises(TypeError, match="unknown option 'epsabs'"):
        made(torch.tensor(-1.0, dtype=torch.float64), solver_args={"epsabs": 1.0})
    y = cp.Variable(2)
    problem = cp.Problem(cp.Minimize(cp.norm(y) + c * y[0]), [y >= 1])
    with pytest.raises(ValueError, match="must be a QP, got cones of the kinds soc"):
        CvxpyLayer(problem, [c], [y], solver=NAM())
