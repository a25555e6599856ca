"""Simulation of drives and circuits: the core integrates, this module prepares the call and labels the trajectory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Integral
from typing import TYPE_CHECKING

from pneudrive import __version__, units
from pneudrive.errors import CommandError, DescriptionError, PneudriveError, SimulationError, naming, warn
from pneudrive.files.inputs import INPUTS, inputs_of
from pneudrive.lazy_names import upper
from pneudrive.progress import UNWATCHED, Flag, Progress, Watch
from pneudrive.references import bibtex
from pneudrive.repr_tables import Shown
from pneudrive.simulation import command as commands
from pneudrive.simulation import run_limits
from pneudrive.simulation.session import core_error
from pneudrive.simulation.start import DriveOrCircuit, StartState, check_tolerance
from pneudrive.simulation.trajectory import MOST_SAMPLES, meaning

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive._core import SimulationResult
    from pneudrive.arrays import Columns, Plain
    from pneudrive.free.parameters import Parameter

MOST_BUDGET = 10**15
#: Residual of a ledger above which a warning is given: absolute, and as a multiple of the tolerance (assumed).
ENERGY_CLOSES, ENERGY_RTOL = 1e-3, 300.0
SOLVER = "Rodas5P"
#: Largest number of command steps that a run stores.
MOST_STEPS = 1000
#: Columns without derivatives, because they are inputs.
UNDIFFERENTIATED = ("time_s", "command")


@dataclass(frozen=True, repr=False)
class Run(Shown):
    """Trajectory as the core returns it: columns as in a file, in SI with absolute pressures, and provenance."""

    columns: Columns
    provenance: Plain
    meanings: Mapping[str, str] = field(default_factory=dict)  # meanings of the columns of a circuit
    parameters: Sequence[Parameter] = ()
    derivatives: Columns = field(default_factory=dict)  # of each column by the parameters, shape (n, p)

    def dataset(self) -> xr.Dataset:
        """Return a labelled dataset: dimension time, a unit and a long name for each variable."""
        import xarray as xr
        from xarray.indexes import PandasIndex

        upper("Pneu")  # registers `run.pneu`
        variables = {}
        for column, values in self.columns.items():
            name, unit, long_name = meaning(column)
            about = {"units": unit, "long_name": self.meanings.get(column) or long_name, "column": column}
            variables[name] = xr.Variable(("time",), values, about, fastpath=True)
        # The public constructor of xarray aligns variables, which takes more than half the time of a simulation. Here
        # all variables have the same index, so that the internal constructor suffices. If it is missing or has changed,
        # the public constructor is used.
        try:
            index = PandasIndex(variables["time"].values, "time")
            ready = variables | index.create_variables({"time": variables["time"]})
            sizes, attrs = {"time": len(index.index)}, dict(self.provenance)
            made = xr.Dataset._construct_direct(ready, {"time"}, sizes, attrs, {"time": index})
        except (AttributeError, TypeError):
            # A variable with the name of its dimension becomes the coordinate of the dimension.
            made = xr.Dataset(variables, attrs=dict(self.provenance))
        if not self.parameters:
            return made
        out: Plain = {
            "parameter": ("parameter", [parameter.name for parameter in self.parameters]),
            "parameter_units": ("parameter", [parameter.unit for parameter in self.parameters]),
        }
        for column, derivatives in self.derivatives.items():
            name = meaning(column)[0]
            unit, long_name = made[name].attrs["units"], made[name].attrs["long_name"]
            about = {"units": f"{unit} per unit of the parameter", "long_name": f"derivative: {long_name}"}
            out[f"sensitivity_{name}"] = (("parameter", "time"), derivatives.T, about)
        return made.assign(out)


def simulate(
    drive: DriveOrCircuit,
    command: commands.Commands,
    duration: str | float,
    *,
    initial: StartState = None,
    sample_rate: str | float = "1 kHz",
    rtol: float = 1e-6,
    ledger: bool = False,
    sensitivities: Sequence[str] = (),
    budget: int | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate a drive or a circuit.

    Parameters
    ----------
    drive : Drive or Circuit
        Object to simulate. Commands and start state of a circuit have names, see `Circuit.simulate`.
    command : number, str, path, sequence of (time, command) or callable
        Valve command in [-1, 1]: a number for the whole run, ``"0 s: 0.6, 1 s: -0.6"``, a CSV file (time_s, command),
        or pairs with the time in s. Each entry holds until the next, and the first is at 0 s. A function of the time in
        s is evaluated at every sample and held until the next sample, as by a controller at `sample_rate`.
    duration : str or float
        ``"2 s"``, or a number of seconds.
    initial : Initial, dict or str, optional
        Start state, ``{"position": "50 mm", "pressure_a": "3 bar abs"}``. The default is mid-stroke, at rest, at
        ambient pressure and temperature.
    sample_rate : str or float
        ``"1 kHz"``, or a number of samples per second.
    rtol : float
        Relative tolerance of the solver.
    ledger : bool
        Also integrate the balances of mass, energy and entropy. The states stay exactly the same, and
        ``attrs["ledger"]`` reports how well the balances close. This is not available with the chamber law
        ``as-printed``, which does not conserve energy.
    sensitivities : sequence of str
        Parameters of the drive file, such as ``"friction.coulomb"``; in a circuit, such as ``"left.friction.coulomb"``.
        For each variable, the result then also has the exact derivatives with respect to these parameters, such as
        ``sensitivity_position`` with dimensions parameter and time. They are derivatives of the numerical solution for
        a fixed start state, and include impacts, sticking and slipping. The command must not be a function.
    budget : int, optional
        Limit on the attempted steps of the run. Default: 220,000, plus 100,000 for each second of motion and 100 for
        each entry of the command. For more than 10 states, this limit is multiplied by 10/states, but at least by 0.5.
        Ordinary drives take 200 to 10,000 attempts per second.
    progress, cancel : optional
        See `pneudrive.progress.Watch`: a callback that gets the number of simulated seconds, and a flag that ends the
        run.

    Returns
    -------
    xarray.Dataset
        Its dimension time has round(duration * sample_rate) + 1 samples, the last one at the duration. The variables
        are position, velocity, acceleration, pressure_a, temperature_a, ..., each with ``units`` and ``long_name``, in
        SI with absolute pressure. Its ``attrs`` hold description_hash, version, solver, rtol, statistics, warnings,
        citations, assumed, command_steps and impacts. command_steps (drives only) lists the time in s and the new
        command of each change, for at most 1000 changes. impacts lists each contact with an end stop as a dict of
        time_s, end ("a" or "b"), speed_m_s (at first touch), energy_j (kinetic energy of all parts that move towards
        the stop), depth_m, peak_force_n (largest force until the piston leaves the stop), and met_cover (whether the
        stop was fully compressed). A contact slower than 1 mm/s that does not fully compress the stop is not listed.

    Raises
    ------
    CommandError
        The command, the duration, the sample rate or the tolerance is not valid.
    DescriptionError
        The start state does not fit the drive.
    SimulationError
        The solver cannot continue, the piston reaches a cover, no gas is left in a chamber, or the budget is used up.
        The message gives the time, the state and a remedy.
    Cancelled
        `cancel` was set.

    Examples
    --------
    >>> import pneudrive as pn
    >>> run = pn.simulate(pn.Drive.load("catalogue:parker-osp-p25-sy5000"), "0 s: 1", "0.1 s", sample_rate="100 Hz")
    >>> run.sizes["time"], run.pressure_a.attrs["units"]
    (11, 'Pa')
    """
    return run(
        drive,
        command,
        duration,
        initial=initial,
        sample_rate=sample_rate,
        rtol=rtol,
        ledger=ledger,
        sensitivities=sensitivities,
        budget=budget,
        watch=Watch(progress, cancel),
    ).dataset()


def run(
    drive: DriveOrCircuit,
    command: commands.Commands,
    duration: str | float,
    *,
    initial: StartState = None,
    sample_rate: str | float = "1 kHz",
    rtol: float = 1e-6,
    ledger: bool = False,
    sensitivities: Sequence[str] = (),
    budget: int | None = None,
    watch: Watch = UNWATCHED,
) -> Run:
    """Simulate and return unlabelled columns, without importing xarray.

    Arguments and errors are those of `simulate`.
    """
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    seconds = positive(duration, "s", "duration")
    rate = positive(sample_rate, "1/s", "sample_rate")
    samples = seconds * rate
    if not 1.0 <= round(samples) <= MOST_SAMPLES:
        raise CommandError(
            f"duration = {seconds:g} s at sample_rate = {rate:g} Hz gives {samples:.3g} samples",
            rule=f"1 to {MOST_SAMPLES:.0e} samples",
        )
    has_function = callable(command) or (isinstance(command, Mapping) and any(map(callable, command.values())))
    asked = [k / rate for k in range(round(samples))] if has_function else None
    check_tolerance(rtol)
    if budget is not None and (isinstance(budget, bool) or not 1 <= budget <= MOST_BUDGET):
        raise CommandError(f"budget = {budget} is out of bounds", rule=f"1 to {MOST_BUDGET:.0e} attempted steps")
    plans = commands.inputs(command, drive.commandable, asked)
    core, start = drive.system.compiled(), drive.core_initial(initial)
    watch.look()
    try:
        inputs = [(name, list(times), list(values)) for name, (times, values) in plans]
        options = (rate, start, rtol, ledger, budget, lambda t: watch.tell(t, seconds, "seconds simulated"))
        result: SimulationResult = core.simulate(inputs, seconds, *options)
    except (ValueError, RuntimeError) as error:
        raise core_error(error, SimulationError) from None
    open_energy = abs((result["ledger"] or {"energy_error": 0.0})["energy_error"])
    if not open_energy <= max(ENERGY_CLOSES, ENERGY_RTOL * rtol):  # also true if the balance is NaN
        result["warnings"].append(
            f"the energy balance has an error of {open_energy:.1e} of the energy throughput: friction or "
            f"flow is not resolved; choose rtol below {rtol:.1e}, or bristles with less damping"
        )
    result["warnings"] += run_limits.warnings(drive, result["columns"])
    for message in result["warnings"]:
        warn(message)
    parameters, derivatives = (), {}
    if sensitivities:  # by a second simulation with the same command, start and tolerance
        from pneudrive.free.parameters import Differentiator

        differentiator = Differentiator(drive, sensitivities, command, initial, rtol)
        parameters = differentiator.parameters
        names = [name for name in result["columns"] if name not in UNDIFFERENTIATED]
        values = [parameter.value for parameter in parameters]
        _, by_numbers = differentiator.run(values, result["columns"]["time_s"], names, watch=watch)
        derivatives = {name: by_numbers[:, i] for i, name in enumerate(names)}
    provenance = _provenance(drive, result, plans, rtol)
    return Run(result["columns"], provenance, drive.meanings, parameters, derivatives)


def _provenance(
    drive: DriveOrCircuit, result: SimulationResult, plans: list[tuple[str, commands.Steps]], rtol: float
) -> Plain:
    out = made_from(drive, rtol)
    water = () if drive.gas.dew_point_k is None else run_limits.SOURCES
    out |= {
        "statistics": result["statistics"],
        "warnings": [*drive.notes, *result["warnings"]],
        "impacts": result["impacts"],
        "citations": list(dict.fromkeys([*result["citations"], *getattr(drive, "cited", ()), *water])),
        "assumed": drive.assumed(),
        "labels": dict(drive.labels),
        INPUTS: inputs_of(drive),
    }
    if getattr(drive, "provenance", None):
        out["identified"] = drive.to_dict()["provenance"]
    if result["ledger"] is not None:
        out["ledger"] = result["ledger"]
    if drive.system.names is not None:
        # Exact times and values of the command changes of a drive: samples show a change with a delay.
        ((_, (times, values)),) = plans
        steps = [[t, values[i]] for i, t in enumerate(times) if not i or values[i] != values[i - 1]]
        out |= {"command_steps": steps} if len(steps) <= MOST_STEPS else {}
    return out


def made_from(described: DriveOrCircuit, rtol: float) -> Plain:
    """Return the title and hash of the description, the version of pneudrive, and the solver and its tolerance."""
    names = {"title": described.name, "description_hash": described.description_hash}
    return names | {"version": __version__, "solver": SOLVER, "rtol": rtol}


def require(given: object, has: str, what: str, instead: str) -> None:
    """Reject an object that is not a description, such as a path or a dict, without importing classes."""
    if not hasattr(given, has):
        raise DescriptionError(f"{what} is a {type(given).__name__}", remedy=f"Write {instead}.")


#: Largest whole number of 64 bits, for seeds and counts without a separate bound.
MOST_WHOLE = 2**63 - 1


def whole_number(name: str, given: object, low: int = 1, high: int = MOST_WHOLE) -> int:
    """Return a whole number within bounds. NumPy integers are accepted.

    Raises
    ------
    CommandError
        The value is not a whole number, or is out of bounds.

    Examples
    --------
    >>> import numpy as np
    >>> whole_number("seed", np.int64(3), 0, 9)
    3
    """
    rule = f"a whole number, {low} to {high}"
    if not isinstance(given, Integral) or isinstance(given, bool):
        raise CommandError(f"{name} = {given!r} is not a whole number", rule=rule)
    if not low <= int(given) <= high:
        raise CommandError(f"{name} = {given} is out of bounds", rule=rule)
    return int(given)


def positive(given: str | float, si_unit: str, what: str) -> float:
    """Read a quantity of a run that is greater than 0, such as its duration.

    Raises
    ------
    CommandError
        The quantity cannot be read, or is not greater than 0.
    """
    value = number_of(given, si_unit, what)
    if not value > 0.0:
        raise CommandError(f"{what} = {given} is out of bounds", rule="finite and greater than 0")
    return value


def number_of(given: str | float, si_unit: str, what: str) -> float:
    """Read a quantity and return it in SI. A number without a unit may be a text.

    Raises
    ------
    CommandError
        The quantity cannot be read, or is not finite.
    """
    is_pure = si_unit in ("", "1")
    try:
        with naming(what):
            share = units.share_of(given) if is_pure else None
            is_quantity = isinstance(given, str) and not is_pure
            value = units.parse(str(given), si_unit) if is_quantity else float(given if share is None else share)
    except (TypeError, ValueError):
        fault = "is not a number" if isinstance(given, str) else f"has the type {type(given).__name__}"
        rule = "a number without a unit" if is_pure else f"a text with a unit, or a number in {si_unit}"
        raise CommandError(f"{what} = {given} {fault}", rule=rule) from None
    if not math.isfinite(value):
        raise CommandError(f"{what} = {given} is out of bounds", rule="finite")
    return value


def citations(run: xr.Dataset) -> str:
    """Return the BibTeX entries of the laws and methods with which a trajectory was computed.

    Parameters
    ----------
    run : xarray.Dataset
        Run of `simulate`.

    Raises
    ------
    PneudriveError
        The dataset has no citations, or references.bib has no entry for one of them.
    """
    keys = getattr(run, "attrs", {}).get("citations")
    if keys is None:
        what = f"this {type(run).__name__} has no list of citations"
        raise PneudriveError(what, remedy="Pass a dataset that pn.simulate returned. A report lists sources of a fit.")
    return "\n\n".join(bibtex(key) for key in keys)
