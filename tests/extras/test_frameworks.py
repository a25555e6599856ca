"""Results of a run within the differentiation of JAX and of PyTorch."""

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.errors import CommandError

jax = pytest.importorskip("jax", reason="make test-extras")
torch = pytest.importorskip("torch", reason="make test-extras")
jnp = pytest.importorskip("jax.numpy")

OF = pn.Differentiable(
    pn.Drive.load("catalogue:reference"),
    "0.6",
    "0.15 s",
    vary=["cylinder.bore", "friction.coulomb"],
    outputs=["final(position)", "max(velocity)"],
    initial={"position": "50 mm"},
)
JACOBIAN = OF.jacobian(OF.start)


def test_jax_asks_for_double_precision():
    jax.config.update("jax_enable_x64", False)
    with pytest.raises(CommandError, match="single precision"):
        OF.jax()


def test_jax_differentiates_through_a_run_in_both_directions():
    jax.config.update("jax_enable_x64", True)
    function, x = OF.jax(), jnp.asarray(OF.start)
    assert np.array_equal(jax.jit(function)(x), OF(OF.start))
    assert np.array_equal(jax.jacfwd(function)(x), JACOBIAN)
    assert np.array_equal(jax.jacrev(function)(x), JACOBIAN)
    assert jax.vmap(function)(jnp.stack([x, 1.1 * x])).shape == (2, 2)
    found = jax.grad(lambda x: jnp.sum(jnp.sin(function(x)) ** 2))(x)
    wanted = (2.0 * np.sin(OF(OF.start)) * np.cos(OF(OF.start))) @ JACOBIAN
    assert found == pytest.approx(wanted, rel=1e-12)


def test_torch_differentiates_through_a_run():
    function, x = OF.torch(), torch.tensor(OF.start, requires_grad=True)
    function(x).sin().pow(2).sum().backward()
    wanted = (2.0 * np.sin(OF(OF.start)) * np.cos(OF(OF.start))) @ JACOBIAN
    assert x.grad.numpy() == pytest.approx(wanted, rel=1e-12)
    assert np.array_equal(torch.autograd.functional.jacobian(function, torch.tensor(OF.start)), JACOBIAN)
    assert not function(torch.tensor(OF.start)).requires_grad
