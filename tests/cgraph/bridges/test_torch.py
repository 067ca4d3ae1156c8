"""`to_torch`: a compiled graph within PyTorch, with its derivatives, at one point and at many."""

import numpy as np
import pytest

import cgraph as cg
from tests.cgraph.bridges.agreement import ARM, POINT, SAMPLES, SMALL
from tests.tolerances import EQUATIONS

torch = pytest.importorskip("torch")
pytestmark = pytest.mark.filterwarnings("ignore:.torch.jit.script. is deprecated")  # torch itself calls it


def tensor(values, grad: bool = False):
    return torch.tensor(values, dtype=torch.float64, requires_grad=grad)


@pytest.mark.parametrize("backend", ["auto", "python"])
def test_it_has_the_values_of_the_compiled_graph_at_one_point_and_at_many(backend):
    fn = cg.compile(SMALL, backend, fma=False)
    function, wanted = cg.to_torch(fn), fn.batch(SAMPLES.reshape(-1, 3).T).T.reshape(4, 5, 3)
    assert (function(tensor(SAMPLES[0, 0])).numpy() == fn(SAMPLES[0, 0])).all()
    many = tensor(SAMPLES)
    assert (function(many).numpy() == wanted).all()
    assert (torch.func.vmap(torch.func.vmap(function))(many).numpy() == wanted).all()
    assert (torch.func.vmap(function, in_dims=1, out_dims=1)(many).numpy() == wanted).all()


def test_its_derivatives_pass_torch_s_own_checks():
    function = cg.to_torch(cg.compile(SMALL, "python"))
    for points in (tensor(SAMPLES[0, 0], grad=True), tensor(SAMPLES[0, :2], grad=True)):
        assert torch.autograd.gradcheck(function, (points,), check_forward_ad=True)
        assert torch.autograd.gradgradcheck(function, (points,), check_fwd_over_rev=True)


def test_its_derivatives_of_three_orders_are_those_of_the_graph():
    fn, point, func = cg.compile(SMALL, "python"), SAMPLES[0, 0], torch.func
    function, weights = cg.to_torch(fn), np.array([1.0, -2.0, 0.5])
    for derivative in (func.jacrev, func.jacfwd):
        assert np.allclose(derivative(function)(tensor(point)), fn.jacobian(point), rtol=EQUATIONS)
        many = func.vmap(derivative(function))(tensor(SAMPLES[0]))
        assert np.allclose(many, fn.jacobian(SAMPLES[0]), rtol=EQUATIONS)
    scalar = lambda x: function(x) @ tensor(weights)  # noqa: E731
    hessian = func.hessian(scalar)(tensor(point))
    assert np.allclose(hessian, fn.hessian(point, weights), rtol=EQUATIONS)
    step = 1e-6  # of a central difference, right to about its square
    third = func.jacrev(func.hessian(scalar))(tensor(point)).numpy()
    ends = [fn.hessian(point + sign * np.array([step, 0.0, 0.0]), weights) for sign in (1, -1)]
    assert third[:, :, 0] == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=1e-7, abs=1e-8)


def test_an_arm_is_trained_on():
    """A gradient of a mean over many points, as a loss has it."""
    fn = cg.compile(ARM, "python")
    points = tensor(np.stack([POINT, 0.5 * POINT]), grad=True)
    cg.to_torch(fn)(points).square().mean().backward()
    rows = points.detach().numpy()
    wanted = fn.vjp(rows, 2.0 * fn.batch(rows.T).T / 14.0)
    assert np.abs(points.grad.numpy() - wanted).max() < EQUATIONS * np.abs(wanted).max()


def test_what_torch_cannot_hand_over_is_told():
    function = cg.to_torch(cg.compile(SMALL, "python"))
    for junk, words in (
        (torch.zeros(3), "float64 on the CPU, got torch.float32"),
        ([1.0, 2.0, 3.0], "must be a tensor"),
    ):
        with pytest.raises(TypeError, match=words):
            function(junk)
    with pytest.raises(cg.GraphError, match=r"x must have shape \(\.\.\., 3\)"):
        function(tensor([1.0, 2.0]))
