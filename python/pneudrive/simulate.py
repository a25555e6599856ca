"""A drive or a circuit, commands and a start in; a trajectory out. The equations and their solution are the core's."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from pneudrive import __version__, humidity, units
from pneudrive import command as commands
from pneudrive.errors import CommandError, DescriptionError, PneudriveError, SimulationError, warn
from pneudrive.references import bibtex
from pneudrive.session import short_name
from pneudrive.show import Shown
from pneudrive.start import check_tolerance, is_circuit, ready
from pneudrive.start import compiled as compiled
from pneudrive.trajectory import MEANING, meaning
from pneudrive.watch import UNWATCHED, Watch

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    import xarray as xr

    from pneudrive._core import SimulationResult
    from pneudrive.describe import Drive, Initial
    from pneudrive.describe.circuit import Circuit
    from pneudrive.watch import Flag

MOST_SAMPLES = 50_000_000  # a trajectory of that many rows takes about 6 GB
MOST_BUDGET = 10**15
#: A ledger that closes worse than this and than so many times the tolerance is told (assumed).
ENERGY_CLOSES, ENERGY_RTOL = 1e-3, 300.0
SOLVER = "Rodas5P"


@dataclass(frozen=True, repr=False)
class Run(Shown):
    """A trajectory as it comes from the core: columns of a file (SI, absolute pressure) and where they come from."""

    columns: dict[str, np.ndarray]
    provenance: dict[str, Any]
    meanings: Mapping[str, str] = field(default_factory=dict)  # of columns of a circuit

    def dataset(self) -> xr.Dataset:
        """Label the columns: dimension time, a unit and a long name for each variable."""
        import xarray as xr

        variables, coordinates = {}, {}
        for column, values in self.columns.items():
            name, attrs = _label(column, self.meanings.get(column))
            (coordinates if name == "time" else variables)[name] = xr.Variable(
                "time", values, dict(attrs), fastpath=True
            )
        return xr.Dataset(variables, coordinates, self.provenance)


def simulate(
    drive: Drive | Circuit,
    command: commands.Commands,
    duration: str | float,
    *,
    initial: Initial | Mapping[str, object] | str | None = None,
    sample_rate: str | float = "1 kHz",
    rtol: float = 1e-6,
    ledger: bool = False,
    budget: int | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate a drive or a circuit.

    Parameters
    ----------
    drive : Drive or Circuit
        What is simulated; for a circuit commands and the start state have names, see `Circuit.simulate`.
    command : number, str, path, sequence of (time, command) or callable
        Valve command in [-1, 1]: a number that holds throughout, ``"0 s: 0.6, 1 s: -0.6"``, a CSV file (time_s,
        command) or pairs with the time in s; each entry holds until the next, the first is at 0 s. A function of the
        time in s is asked at every sample and held until the next one, as by a controller at `sample_rate`.
    duration : str or float
        ``"2 s"``, or a number of seconds.
    initial : Initial, dict or str, optional
        Start state, ``{"position": "50 mm", "pressure_a": "3 bar abs"}``; where nothing is said mid stroke, at rest,
        ambient pressure and temperature.
    sample_rate : str or float
        ``"1 kHz"``, or a number of samples a second.
    rtol : float
        Relative tolerance of the solver.
    ledger : bool
        Integrate the accounts of mass, energy and entropy along, without changing a bit of the states;
        ``attrs["ledger"]`` then says how well they close. Not for the chamber law ``as-printed``, which does not
        conserve energy.
    budget : int, optional
        Attempts at a step after which the run is given up. Where nothing is said 220,000 for the run, 100,000 for each
        second of motion and 100 for each entry of the command, more below rtol = 1e-6, and down to half as many above
        11 states. Ordinary drives take 200 to 10,000 a second.
    progress, cancel : optional
        See `pneudrive.watch.Watch`: a callback that is told how many of the seconds are simulated, and a flag that
        ends the run.

    Returns
    -------
    xarray.Dataset
        Dimension time (round(duration * sample_rate) + 1 samples, the last one at the duration), variables position,
        velocity, acceleration, pressure_a, temperature_a, ..., each with ``units`` and ``long_name``; SI, absolute
        pressure. Its ``attrs`` hold description_hash, version, solver, rtol, statistics, warnings, citations, assumed,
        and impacts: each contact with an end stop as a dict of time_s, end ("a" or "b"), speed_m_s (at first touch),
        energy_j (kinetic, of the moving mass and load), depth_m and peak_force_n (the largest until it leaves), and
        met_cover: whether the stop was pressed through. Contacts slower than 1 mm/s that do not are none.

    Raises
    ------
    CommandError
        The command, the duration, the sample rate or the tolerance is not valid.
    DescriptionError
        The start state does not fit the drive.
    SimulationError
        The solver cannot go on, the piston reaches a cover, no gas is left in a chamber, or the budget is used up; the
        message says when, in which state and what to try.
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
        budget=budget,
        watch=Watch(progress, cancel),
    ).dataset()


def run(
    drive: Drive | Circuit,
    command: commands.Commands,
    duration: str | float,
    *,
    initial: Initial | Mapping[str, object] | str | None = None,
    sample_rate: str | float = "1 kHz",
    rtol: float = 1e-6,
    ledger: bool = False,
    budget: int | None = None,
    watch: Watch = UNWATCHED,
) -> Run:
    """Simulate without labelling the result, which would import xarray.

    Arguments and errors are those of `simulate`.
    """
    _require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    seconds = _positive(duration, "s", "duration")
    rate = _positive(sample_rate, "1/s", "sample_rate")
    samples = seconds * rate
    if not 1.0 <= round(samples) <= MOST_SAMPLES:
        raise CommandError(
            f"duration = {seconds:g} s at sample_rate = {rate:g} Hz makes {samples:.3g} samples",
            rule=f"1 to {MOST_SAMPLES:.0e} samples",
        )
    has_function = callable(command) or (isinstance(command, Mapping) and any(map(callable, command.values())))
    asked = [k / rate for k in range(round(samples))] if has_function else None
    check_tolerance(rtol)
    if budget is not None and (isinstance(budget, bool) or not 1 <= budget <= MOST_BUDGET):
        raise CommandError(f"budget = {budget} is out of bounds", rule=f"1 to {MOST_BUDGET:.0e} attempts at a step")
    plan = _plan(drive, command, asked)
    core: Any
    core, start = ready(drive, initial)
    watch.look()
    try:
        result: SimulationResult = core.simulate(
            *plan, seconds, rate, start, rtol, ledger, budget, lambda t: watch.tell(t, seconds, "seconds simulated")
        )
    except (ValueError, RuntimeError) as error:
        raise SimulationError(str(error)) from None
    meanings = drive.meanings if is_circuit(drive) else drive.circuit.meanings if drive.has_lines else {}
    if meanings and not is_circuit(drive):
        _in_short(result)
    result["warnings"] += _open_ledger(result["ledger"], rtol) + humidity.told(drive, result["columns"])
    for message in result["warnings"]:
        warn(message)
    return Run(result["columns"], _provenance(drive, result, rtol), meanings)


def _plan(drive: Drive | Circuit, command: Any, asked: list[float] | None) -> tuple[Any, ...]:  # noqa: ANN401
    """Read the command, as the core takes it: steps of a drive, or plans by the names of a circuit's inputs."""
    if is_circuit(drive):
        named = commands.plans(command, drive.commandable, asked)
        return ([(f"{name}.command", list(times), list(values)) for name, (times, values) in named],)
    steps = commands.steps(command, asked, drive.valve.command)
    return ([("valve.command", *map(list, steps))],) if drive.has_lines else steps


def _in_short(result: SimulationResult) -> None:
    """Give columns of a drive's circuit the names of a drive, those that a drive has first."""
    columns = {short_name(name): values for name, values in result["columns"].items()}
    order = [name for name in MEANING if name in columns] + [name for name in columns if name not in MEANING]
    result["columns"] = {name: columns[name] for name in order}
    for impact in result["impacts"]:
        impact.pop("cylinder", None)


def _open_ledger(ledger: dict[str, Any] | None, rtol: float) -> list[str]:
    """Return what to say of energy that does not close."""
    if ledger is None or abs(ledger["energy_error"]) <= max(ENERGY_CLOSES, ENERGY_RTOL * rtol):
        return []
    return [
        f"energy closes only to {abs(ledger['energy_error']):.1e} of what is turned over, so friction or flow is not "
        f"resolved: a smaller rtol than {rtol:.1e} resolves it, or bristles with less damping"
    ]


def _provenance(drive: Drive | Circuit, result: SimulationResult, rtol: float) -> dict[str, Any]:
    ledger = {} if result["ledger"] is None else {"ledger": result["ledger"]}
    water = () if drive.gas.dew_point_k is None else humidity.SOURCES
    return {
        "title": drive.name,
        "description_hash": drive.description_hash,
        "version": __version__,
        "solver": SOLVER,
        "rtol": rtol,
        "statistics": result["statistics"],
        "warnings": [*drive.notes, *result["warnings"]],
        "impacts": result["impacts"],
        "citations": list(dict.fromkeys([*result["citations"], *getattr(drive, "cited", ()), *water])),
        "assumed": drive.assumed(),
        "labels": dict(drive.labels),
        **({"identified": drive.to_dict()["provenance"]} if getattr(drive, "provenance", None) else {}),
        **ledger,
    }


@lru_cache(maxsize=64)
def _label(column: str, said: str | None) -> tuple[str, tuple[tuple[str, str], ...]]:
    name, unit, long_name = meaning(column)
    return name, (("units", unit), ("long_name", said or long_name), ("column", column))


def _require(given: object, has: str, what: str, instead: str) -> None:
    """Refuse a path or a dict where the described object is needed; that it is one is told without importing it."""
    if not hasattr(given, has):
        raise DescriptionError(f"{what} is a {type(given).__name__}", remedy=f"Write {instead}.")


def _positive(given: str | float, si_unit: str, what: str) -> float:
    try:
        value = units.parse(given, si_unit) if isinstance(given, str) else float(given)
    except DescriptionError as error:
        raise CommandError(f"{what}: {error.what}", rule=error.rule, remedy=error.remedy) from None
    if not (math.isfinite(value) and value > 0.0):
        raise CommandError(f"{what} = {given} is out of bounds", rule="finite and greater than 0")
    return value


def citations(run: xr.Dataset) -> str:
    """Return the BibTeX entries of exactly the laws and methods that made a trajectory.

    Parameters
    ----------
    run : xarray.Dataset
        From `simulate`.

    Raises
    ------
    PneudriveError
        The dataset does not say what made it, or a source is missing.
    """
    keys = run.attrs.get("citations")
    if keys is None:
        raise PneudriveError("this dataset does not say what made it", remedy="Pass what pn.simulate returned.")
    return "\n\n".join(bibtex(key) for key in keys)
