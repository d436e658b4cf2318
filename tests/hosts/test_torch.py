"""Derivatives of QPs in PyTorch, by its own checks."""

import numpy as np
import pytest
from problems_layers import SHARP, layer_data

torch = pytest.importorskip("torch")
from namlcp.torch import solve_qp  # noqa: E402

# torch's own forward mode uses what torch deprecates
pytestmark = pytest.mark.filterwarnings("ignore:.*torch.jit.script")


def tensors(kind=torch.float64, **shape):
    return [torch.tensor(v, dtype=kind).requires_grad_() for v in layer_data(**shape)]


def solutions(*arguments):
    return solve_qp(*arguments, **SHARP)[:4]


@pytest.mark.parametrize("lead", [(), (2,), (1, 2)])
def test_gradients_pass_the_checks_of_torch(lead):
    data = tensors(n=4, m=4, p=1, lead=lead)
    assert torch.autograd.gradcheck(solutions, data)
    modes = {"check_forward_ad": True, "check_backward_ad": False}
    assert torch.autograd.gradcheck(solutions, data, **modes)


def test_only_what_needs_a_gradient_gets_one():
    data = [v.detach() for v in tensors()]
    data[1].requires_grad_()
    found = solve_qp(*data)
    found.x.sum().backward()
    assert data[1].grad.shape == (5,)
    assert all(v.grad is None for v in data if v is not data[1])
    with torch.no_grad():
        assert not solve_qp(*data).x.requires_grad


def test_single_precision_stays():
    data = tensors(torch.float32, lead=(3,))
    found = solve_qp(*data)
    assert found.x.dtype == found.z_box.dtype == torch.float32
    assert found.solved.dtype == torch.bool
    found.x.square().sum().backward()
    exact = tensors(lead=(3,))
    solve_qp(*exact).x.square().sum().backward()
    for v, w in zip(data, exact, strict=True):
        assert v.grad.dtype == torch.float32
        assert v.grad.shape == v.shape
        np.testing.assert_allclose(v.grad, w.grad, rtol=1e-3, atol=1e-3)


def test_items_without_a_solution_leave_the_others_alone():
    q = torch.tensor([[-1.0], [-2.0]], dtype=torch.float64, requires_grad=True)
    G = torch.tensor([[1.0], [-1.0]], dtype=torch.float64)
    h = torch.tensor([[3.0, 0.0], [-1.0, 0.0]], dtype=torch.float64)
    found = solve_qp(torch.eye(1, dtype=torch.float64), q, G, h)
    assert found.solved.tolist() == [True, False]
    assert torch.isnan(found.x[1]).all()
    torch.where(found.solved[:, None], found.x, 0.0).sum().backward()
    np.testing.assert_allclose(q.grad, [[-1.0], [0.0]])


def test_data_changed_in_place_after_the_solve_do_no_harm():
    data = tensors()
    found = solve_qp(*data)
    with torch.no_grad():
        data[0].mul_(7.0)
        loss = found.x.sum()
    found.x.sum().backward()
    fresh = tensors()
    solve_qp(*fresh).x.sum().backward()
    assert loss.isfinite()
    np.testing.assert_allclose(data[1].grad, fresh[1].grad)


def test_a_second_derivative_raises():
    """Also where the cotangent is constant, and where other terms have derivatives."""
    data = tensors()
    (g,) = torch.autograd.grad(solve_qp(*data).x.sum(), data[1], create_graph=True)
    with pytest.raises(RuntimeError, match="can be differentiated once"):
        torch.autograd.grad(g.sum() + data[1].sum(), data[1])
    with pytest.raises(RuntimeError, match="can be differentiated once"):
        torch.autograd.gradgradcheck(solutions, data)
    with torch.autograd.forward_ad.dual_level():
        q = torch.autograd.forward_ad.make_dual(data[1], torch.ones_like(data[1]))
        found = solve_qp(data[0], q, *data[2:])
        along = torch.autograd.forward_ad.unpack_dual(found.x).tangent
    with pytest.raises(RuntimeError, match="can be differentiated once"):
        along.sum().backward()


def test_transforms_of_functions():
    data = [v.detach() for v in tensors()]

    def total(q):
        return solve_qp(data[0], q, *data[2:]).x.sum()

    gradient = torch.func.grad(total)(data[1])
    _, along = torch.func.jvp(total, (data[1],), (torch.ones_like(data[1]),))
    assert along.item() == pytest.approx(gradient.sum().item(), rel=1e-12)
    for second in torch.func.grad, torch.func.jacfwd:
        with pytest.raises(RuntimeError):
            second(lambda q: torch.func.grad(total)(q).sum())(data[1])


def test_integers_have_solutions_of_floats():
    found = solve_qp(torch.eye(2), torch.tensor([1, 1]), ub=torch.tensor([-2, 3]))
    assert found.x.dtype == torch.get_default_dtype()
    assert found.x.tolist() == [-2.0, -1.0]
    assert solve_qp(torch.tensor([[2]]), torch.tensor([1])).x.tolist() == [-0.5]


def test_malformed_problems_raise():
    with pytest.raises(ValueError, match="q must be finite"):
        solve_qp(torch.eye(1), torch.tensor([float("nan")]))
