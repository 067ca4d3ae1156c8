"""`to_jax` and `as_jax`: values and derivatives in JAX, jitted and in batches."""

import numpy as np
import pytest
from hypothesis import given, settings

import cgraph as cg
from tests.cgraph.bridges import agreement
from tests.cgraph.bridges.agreement import ARM, POINT, SAMPLES, SMALL
from tests.strategies import cases, examples
from tests.tolerances import EQUATIONS

jax = pytest.importorskip("jax")
jax.config.update("jax_platforms", "cpu")
check_grads = pytest.importorskip("jax.test_util").check_grads
jnp = jax.numpy

BRIDGE = agreement.Bridge(cg.to_jax, lambda graph: jax.jit(jax.jacobian(cg.to_jax(graph))))


@pytest.fixture(autouse=True)
def in_float64():
    before = jax.config.jax_enable_x64
    jax.config.update("jax_enable_x64", True)
    yield
    jax.config.update("jax_enable_x64", before)


def test_every_operation_has_its_value_and_its_slopes():
    assert agreement.disagreements(BRIDGE) == {}


@settings(max_examples=examples(100))
@given(cases())
def test_a_random_graph_has_its_values(case):
    agreement.agrees(BRIDGE, case)


def test_an_exact_zero_wins_and_has_the_slopes_of_a_product():
    agreement.lets_zero_win(BRIDGE)


def test_an_arm_and_its_jacobian():
    function, fn = cg.to_jax(ARM), cg.compile(ARM, "python")
    assert np.allclose(function(POINT), fn(POINT), rtol=EQUATIONS)
    assert np.allclose(function(np.stack([POINT, POINT])), [fn(POINT)] * 2, rtol=EQUATIONS)
    along = np.eye(21)[0]
    assert np.allclose(jax.jvp(function, (POINT,), (along,))[1], fn.jvp(POINT, along), rtol=EQUATIONS)


def test_it_goes_through_jit_vmap_and_grad_in_any_precision():
    function, fn = cg.to_jax(SMALL), cg.compile(SMALL, "python")
    wanted = fn.batch(SAMPLES.reshape(-1, 3).T).T.reshape(4, 5, 3)
    assert np.allclose(jax.jit(jax.vmap(jax.vmap(function)))(SAMPLES), wanted, rtol=EQUATIONS)
    check_grads(jax.jit(function), (SAMPLES[0, 0],), order=2, rtol=1e-5)
    assert function(jnp.array(SAMPLES, jnp.float32)).dtype == jnp.float32
    assert function([1, 2, 3]).dtype == jnp.float64
    x = cg.variable("x")
    constant = cg.to_jax(cg.Graph([x], {"one": cg.constant(1.0), "x": x}))
    assert constant(jnp.array([[2.0], [3.0]])).tolist() == [[1.0, 2.0], [1.0, 3.0]]


@pytest.mark.parametrize("backend", ["auto", "python"])
def test_compiled_it_is_called_within_jax_at_one_point_and_at_many(backend):
    fn = cg.compile(SMALL, backend, fma=False)
    function, rows = cg.as_jax(fn), SAMPLES.reshape(-1, 3)
    wanted = fn.batch(rows.T).T.reshape(4, 5, 3)
    assert (function(SAMPLES[0, 0]) == fn(SAMPLES[0, 0])).all()
    for called in (function, jax.jit(function), jax.vmap(function), jax.jit(jax.vmap(jax.vmap(function)))):
        assert (called(SAMPLES) == wanted).all()


def test_compiled_its_derivatives_of_three_orders_are_those_of_the_graph():
    fn, point = cg.compile(SMALL, "python"), SAMPLES[0, 0]
    function = cg.as_jax(fn)
    for derivative in (jax.jacfwd, jax.jacrev):
        assert np.allclose(derivative(function)(point), fn.jacobian(point), rtol=EQUATIONS)
        assert np.allclose(jax.vmap(derivative(function))(SAMPLES[0]), fn.jacobian(SAMPLES[0]), rtol=EQUATIONS)
    check_grads(jax.jit(function), (point,), order=2, rtol=1e-5)
    weights = np.array([1.0, -2.0, 0.5])
    hessian = jax.jit(jax.hessian(lambda x: function(x) @ weights))
    assert np.allclose(hessian(point), fn.hessian(point, weights), rtol=EQUATIONS)
    step = np.array([1e-6, 0.0, 0.0])  # a central difference is right to about its square
    third = jax.jvp(hessian, (point,), (step / 1e-6,))[1]
    assert np.allclose(third, (hessian(point + step) - hessian(point - step)) / 2e-6, rtol=1e-7, atol=1e-8)


@pytest.mark.parametrize("backend", ["auto", "python"])
def test_a_force_against_the_speed_has_slopes_at_rest_within_jax_and_afterwards(backend):
    """The threads of XLA take subnormal numbers for 0."""
    x, y = cg.variables("x y")
    speed = cg.hypot(x, y)
    fn = cg.compile(cg.Graph([x, y], {"fx": -speed * x, "fy": -speed * y}), backend)
    for derivative in (jax.jacrev, jax.jacfwd):
        assert (derivative(cg.as_jax(fn))(jnp.zeros(2)) == 0.0).all()
    assert (fn.jacobian([0.0, 0.0]) == 0.0).all()
    slopes = cg.to_jax(cg.gradient(cg.Graph([x, y], {"speed": speed})))
    for kind in (jnp.float32, jnp.float64):
        assert slopes(jnp.zeros(2, kind)).tolist() == [0.0, 0.0]
        assert slopes(jnp.array([3.0, 4.0], kind)).tolist() == pytest.approx([0.6, 0.8])


def test_what_jax_cannot_take_is_told():
    agreement.refuses(cg.to_jax, "JAX")
    fn = cg.compile(SMALL, "python")
    for function in (cg.to_jax(SMALL), cg.as_jax(fn)):
        with pytest.raises(cg.GraphError, match=r"x must have shape \(\.\.\., 3\)"):
            function(jnp.zeros(2))
    with pytest.raises(TypeError, match="machine code for float64, got float32"):
        cg.as_jax(fn)(jnp.zeros(3, jnp.float32))
