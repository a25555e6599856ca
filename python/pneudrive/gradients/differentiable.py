"""Results of a run as a function of drive parameters, with exact Jacobian, for SciPy, JAX and PyTorch."""

# pyright: reportMissingImports=false, reportFunctionMemberAccess=false
# JAX and PyTorch are not installed with pneudrive.
from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from pneudrive.arrays import Array, ArrayPair
from pneudrive.ensemble.outputs import Output, Reduction, SignalNames, reductions
from pneudrive.errors import CommandError, SimulationError
from pneudrive.free.parameters import Differentiator
from pneudrive.simulation.command import Commands
from pneudrive.simulation.simulate import positive
from pneudrive.simulation.start import DriveOrCircuit, StartState, start

WORDS = ("final", "max", "min", "mean", "integral", "time_when", "samples")
#: Number of parts into which a sampling interval is divided if it contains a result between its samples.
_BETWEEN = 256


class Differentiable:
    """Results of a run as a differentiable function of parameters of the drive.

    For `scipy.optimize`, the object is a function of an array. `jax()` and `torch()` return functions that these
    libraries can differentiate.

    Parameters
    ----------
    drive : Drive or Circuit
    command, duration, initial, rtol
        As for `pneudrive.simulate`. The start state does not depend on the parameters.
    vary : sequence of str
        Numbers of the file that are the arguments of the function. In a circuit they have names such as
        ``"left.bore"``.
    outputs : sequence of str or Output
        Results of the function: ``"final(position)"``, ``"max(pressure_a)"``, ``"integral(mass_flow_a)"``,
        ``"time_when(position > 0.45 m)"``, ``"samples(position)"``; see `pneudrive.ensemble.outputs`.
    sample_rate : str or float
        Sampling rate of integrals, means, extremes and samples.

    Attributes
    ----------
    names, units : list of str
        Names and units of the numbers, in the order of the argument.
    start : ndarray, shape (p,)
        Values of the numbers in the drive, in SI.
    output_names : list of str
        Names of the results, one for each element: samples have names such as ``"position[3]"``.

    Raises
    ------
    CommandError
        Unknown name or output, or an output without a derivative.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:parker-osp-p25-mpye")
    >>> of = pn.Differentiable(drive, "0.6", "0.2 s", vary=["friction.coulomb"], outputs=["final(position)"])
    >>> of(of.start).shape, of.jacobian(of.start).shape
    ((1,), (1, 1))
    """

    def __init__(
        self,
        drive: DriveOrCircuit,
        command: Commands,
        duration: str | float,
        *,
        vary: Sequence[str],
        outputs: Sequence[str | Output],
        initial: StartState = None,
        sample_rate: str | float = "1 kHz",
        rtol: float = 1e-6,
    ) -> None:
        self._of = Differentiator(drive, vary, command, initial, rtol)
        seconds = positive(duration, "s", "duration")
        rate = positive(sample_rate, "1/s", "sample_rate")
        self._times = np.append(np.arange(round(seconds * rate)) / rate, seconds)
        columns = [one.name for one in start(drive).variables if one.kind == "output"]
        self._reductions = reductions(outputs, SignalNames(columns))
        for one in self._reductions:
            if one.word not in WORDS:
                raise CommandError(f"{one.name} has no derivative", rule=f"one of {', '.join(WORDS)}")
        self._columns = list(dict.fromkeys(column for one in self._reductions for column in one.columns))
        self.names = [one.name for one in self._of.parameters]
        self.units = [one.unit for one in self._of.parameters]
        self.start = np.array([one.value for one in self._of.parameters])
        parts = {"samples": [f"[{i}]" for i in range(len(self._times))]}
        self.output_names = [one.name + part for one in self._reductions for part in parts.get(one.word, [""])]

    def __call__(self, values: ArrayLike) -> Array:
        """Return the k results for the p values of the parameters, all in SI.

        Raises
        ------
        SimulationError
            The run stops, or a signal does not pass the level of a ``time_when``.
        """
        return self._reduce(self._run(values, derivatives=False))[0]

    def jacobian(self, values: ArrayLike) -> Array:
        """Return the derivatives of the results, shape (k, p). The errors are those of calling the object."""
        return self.value_and_jacobian(values)[1]

    def value_and_jacobian(self, values: ArrayLike) -> ArrayPair:
        """Return results and derivatives of one run, shapes (k,) and (k, p).

        The errors are those of calling the object.
        """
        return self._reduce(self._run(values, derivatives=True))

    def jax(self) -> Any:  # noqa: ANN401 - a function of JAX
        """Return a JAX function. It takes an array of the p parameters, and returns the k results.

        The function has a rule for forward differentiation, which JAX transposes for reverse mode. It can be compiled.
        It can also be vectorised (``vmap``); the runs are then simulated one after the other.

        Raises
        ------
        CommandError
            JAX is set to single precision.
        """
        import jax
        import jax.numpy as jnp

        if not jax.config.read("jax_enable_x64"):
            raise CommandError.of("gradients.single-precision")
        k, p = len(self.output_names), len(self.names)
        call = partial(jax.pure_callback, vmap_method="sequential")
        result, matrix = (jax.ShapeDtypeStruct(shape, jnp.float64) for shape in ((k,), (k, p)))

        @jax.custom_jvp
        def function(values: Any) -> Any:  # noqa: ANN401
            return call(lambda x: self(np.asarray(x)), result, values)

        @function.defjvp
        def _(primals: tuple[Any], tangents: tuple[Any]) -> tuple[Any, Any]:
            both = call(lambda x: self.value_and_jacobian(np.asarray(x)), (result, matrix), primals[0])
            return both[0], both[1] @ tangents[0]

        return function

    def torch(self) -> Any:  # noqa: ANN401 - a function of PyTorch
        """Return a PyTorch function. It takes a tensor of the p parameters, as doubles, and returns the k results."""
        import torch

        class TorchRun(torch.autograd.Function):
            """One run, with its Jacobian if a gradient is requested."""

            @staticmethod
            def forward(ctx: Any, values: Any) -> Any:  # noqa: ANN401
                x = values.detach().cpu().double().numpy()
                if not values.requires_grad:
                    return torch.as_tensor(self(x), device=values.device)
                found, jacobian = self.value_and_jacobian(x)
                ctx.save_for_backward(torch.as_tensor(jacobian, device=values.device))
                return torch.as_tensor(found, device=values.device)

            @staticmethod
            def backward(ctx: Any, *gradients: Any) -> Any:  # noqa: ANN401
                (jacobian,) = ctx.saved_tensors
                return gradients[0].to(jacobian) @ jacobian

        return TorchRun.apply

    def _run(self, values: ArrayLike, *, derivatives: bool) -> tuple[Array, ArrayPair]:
        """Return times, values and derivatives of a run, with more samples near level crossings and extremes."""
        searches = [one for one in self._reductions if one.word in SOUGHT]
        times, given = self._times, self._times
        if searches:
            coarse, _ = self._of.run(values, given, self._columns, derivatives=False)
            for one in searches:
                k = _sample(one, coarse[:, self._columns.index(one.columns[0])])
                first = k if one.word == "time_when" else max(k - 1, 0)
                last = min(k + 1, given.size - 1)
                times = np.union1d(times, np.linspace(given[first], given[last], _BETWEEN * (last - first) + 1))
        return times, self._of.run(values, times, self._columns, derivatives=derivatives)

    def _reduce(self, ran: tuple[Array, ArrayPair]) -> ArrayPair:
        times, (signals, slopes) = ran
        given, parts = np.searchsorted(times, self._times), []
        for one in self._reductions:
            column = self._columns.index(one.columns[0])
            x, by = signals[:, column], slopes[:, column]
            if one.word in SOUGHT:
                parts.append(SOUGHT[one.word](one, times, x, by))
                continue
            x, by = x[given], by[given]
            if one.word == "final":
                parts.append((x[-1:], by[-1:]))
            elif one.word == "samples":
                parts.append((x, by))
            else:
                both: Array = np.array(np.trapezoid(np.column_stack([x, by]), self._times, axis=0))
                both /= self._times[-1] - self._times[0] if one.word == "mean" else 1.0
                parts.append((both[:1], both[None, 1:]))
        values, derivatives = zip(*parts, strict=True)
        return np.concatenate(values), np.concatenate(derivatives)


def _sample(one: Reduction, x: Array) -> int:
    """Return the index of an extreme sample, or of the sample before a condition first holds."""
    if one.word in ("max", "min"):
        return int(x.argmax() if one.word == "max" else x.argmin())
    holds = x > one.level if one.above else x < one.level
    if holds[0] or not holds.any():
        side = "above" if one.above else "below"
        when = "initially" if holds[0] else "never"
        raise SimulationError(
            f"{one.columns[0]} is {when} {side} {one.level:g}", remedy="Choose a level that the signal passes."
        )
    return int(holds.argmax()) - 1


def _crossing(one: Reduction, times: Array, x: Array, by: Array) -> ArrayPair:
    """Return the time at which a signal passes a level, and its derivatives, computed from the slope of the signal."""
    k = _sample(one, x)
    share = (one.level - x[k]) / (x[k + 1] - x[k])
    near = slice(max(k - 1, 0), k + 3)
    rates = np.gradient(x[near], times[near])[k - near.start :][:2]
    slopes = np.interp([share], [0.0, 1.0], rates)
    moved: Array = (1.0 - share) * by[k] + share * by[k + 1]
    return np.array([times[k] + share * (times[k + 1] - times[k])]), (-moved / slopes)[None]


def _extreme(one: Reduction, times: Array, x: Array, by: Array) -> ArrayPair:
    """Return the extreme of a parabola around the largest or smallest sample, and its derivatives."""
    k = _sample(one, x)
    if not 0 < k < len(x) - 1:
        return x[k : k + 1], by[k : k + 1]
    before, after = times[k] - times[k - 1], times[k + 1] - times[k]
    slopes = (x[k] - x[k - 1]) / before, (x[k + 1] - x[k]) / after
    if slopes[0] == slopes[1]:
        return x[k : k + 1], by[k : k + 1]
    # at the vertex of the parabola: a small shift in time does not change the value there
    middle = 0.5 * (times[k - 1] + times[k])
    at = middle - slopes[0] * 0.5 * (before + after) / (slopes[1] - slopes[0])
    t = times[k - 1 : k + 2]
    weights = np.array([np.prod((at - t[t != own]) / (own - t[t != own])) for own in t])
    return np.array([weights @ x[k - 1 : k + 2]]), (weights @ by[k - 1 : k + 2])[None]


#: Results at times between samples -> function that computes them.
SOUGHT = {"time_when": _crossing, "max": _extreme, "min": _extreme}
