"""A `Differentiable` as a function for JAX and for PyTorch, with the derivatives from pneudrive."""

# pyright: reportMissingImports=false, reportFunctionMemberAccess=false
# JAX and PyTorch are not installed with pneudrive.
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class ArrayFunction(Protocol):
    """A function of an array, shape (p,), with results, shape (k,), and their Jacobian. `Differentiable` is one."""

    names: list[str]
    output_names: list[str]

    def __call__(self, values: Array) -> Array:
        """Return the results."""
        ...

    def value_and_jacobian(self, values: Array) -> tuple[Array, Array]:
        """Return the results and their derivatives, shape (k, p)."""
        ...


def jax_function(of: ArrayFunction) -> Any:  # noqa: ANN401 - a function of JAX
    """Return a function of a JAX array, shape (p,), that returns the results, shape (k,).

    It has a rule for forward differentiation, which JAX transposes for backward differentiation. The function can be
    compiled and mapped over members, which are then simulated one after the other.

    Raises
    ------
    CommandError
        JAX is set to single precision.
    """
    import jax
    import jax.numpy as jnp

    if not jax.config.read("jax_enable_x64"):
        raise CommandError(
            "JAX computes in single precision", remedy='Call jax.config.update("jax_enable_x64", True) first.'
        )
    k, p = len(of.output_names), len(of.names)
    result, matrix = (jax.ShapeDtypeStruct(shape, jnp.float64) for shape in ((k,), (k, p)))

    @jax.custom_jvp
    def function(values: Any) -> Any:  # noqa: ANN401
        return jax.pure_callback(lambda x: of(np.asarray(x)), result, values, vmap_method="sequential")

    @function.defjvp
    def _(primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
        both = jax.pure_callback(
            lambda x: of.value_and_jacobian(np.asarray(x)), (result, matrix), primals[0], vmap_method="sequential"
        )
        return both[0], both[1] @ tangents[0]

    return function


def torch_function(of: ArrayFunction) -> Any:  # noqa: ANN401 - a function of PyTorch
    """Return a function of a tensor of doubles, shape (p,), that returns the results, shape (k,)."""
    import torch

    class TorchRun(torch.autograd.Function):
        """One run, with its Jacobian if a gradient is requested."""

        @staticmethod
        def forward(ctx: Any, values: Any) -> Any:  # noqa: ANN401
            x = values.detach().cpu().double().numpy()
            if not values.requires_grad:
                return torch.as_tensor(of(x), device=values.device)
            found, jacobian = of.value_and_jacobian(x)
            ctx.save_for_backward(torch.as_tensor(jacobian, device=values.device))
            return torch.as_tensor(found, device=values.device)

        @staticmethod
        def backward(ctx: Any, *gradients: Any) -> Any:  # noqa: ANN401
            (jacobian,) = ctx.saved_tensors
            return gradients[0].to(jacobian) @ jacobian

    return TorchRun.apply
