"""Frequency response of the linear model and of the nonlinear drive, sensitivities, and the tube study."""

from __future__ import annotations

import math
from itertools import product
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import units
from pneudrive.constants import ANR_DENSITY_KG_M3, ANR_TEMPERATURE_K
from pneudrive.datasheet.characteristic import Found, characteristic
from pneudrive.datasheet.characteristics.response import run_strokes, short_columns, simulate_plant, start_of
from pneudrive.datasheet.characteristics.steady import adiabatic_stiffness, full_force, oscillations
from pneudrive.datasheet.equilibrium import gas_at, linear_model, moving_gas, open_command, steady_state
from pneudrive.datasheet.plant import Actuation, HeldDrive
from pneudrive.datasheet.stands import flow_through
from pneudrive.describe.files.provenance import values
from pneudrive.describe.marks import StatedPressure
from pneudrive.errors import CommandError, DescriptionError, PneudriveError, SimulationError, nearest
from pneudrive.progress import UNWATCHED, Flag, Progress, Watch
from pneudrive.simulation.bench_circuit import VACUUM
from pneudrive.simulation.simulate import positive

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr

    from pneudrive.arrays import Array, NamedNumbers, Plain
    from pneudrive.describe.drive import Drive
    from pneudrive.simulation.session import Linear


# --- Frequency response of the linear model, and of the nonlinear drive at finite amplitudes.

FREQUENCIES = np.geomspace(0.1, 100.0, 91)  # Hz
NEAR, REACH = np.linspace(-1.0, 1.0, 61), 0.3  # frequencies added about a resonance, and their reach in ln f
LEAST_DAMPING = 1e-9  # of a resonance, for the distance of these frequencies
FINE = 201  # frequencies between the neighbours of the largest response
SLOW = 1e-4  # of the linear model's slowest pole that counts: where the velocity gain is read, Hz
SINE_HZ, AMPLITUDES = (1.0, 2.0, 4.0, 8.0), (0.05, 0.1, 0.2, 0.4)
STEPS, SETTLING, COUNTED = 200, 4, 2  # of the command in a period; periods before, and looked at
HARMONICS = 10
NOTHING = np.full(COUNTED * STEPS, math.nan)  # response of a piston that reaches an end
LOADS = (0.2, 0.3, 0.4)  # of the blocked force at full command: amplitudes of a load


def response(linear: Linear, output: str, frequencies: Array) -> Array:
    """Return the complex frequency response of an output to the command."""
    row = linear.outputs.index(output)
    c, d = linear.C[row], linear.D[row, 0]
    unity, b = np.eye(len(linear.states)), linear.B[:, 0]
    return np.array([c @ np.linalg.solve(2j * math.pi * f * unity - linear.A, b) + d for f in frequencies])


@characteristic(
    "bode",
    algorithm="exact linearisation by the core, evaluated at frequencies",
    x="frequency",
    y="velocity_magnitude velocity_phase",
    needs_shares=True,
    held=True,
)
def _bode(plant: HeldDrive, position: float | None = None, frequencies: Any = None) -> Found:  # noqa: ANN401
    """Frequency response.

    Response of velocity, position and pressures to a small command about an operating point, without lag and dead time
    of the valve. The point is mid stroke, with pressures of slow steady motion, a valve that begins to open (u > 0),
    and viscous friction. A valve with negative overlap is at its centre, where both edges of a chamber are open.
    `pn.linearise` gives the model at other points.

    Settings
    --------
    position
        position of the operating point, in m; default: mid stroke
    frequencies
        Hz; default: 0.1 to 100, with a finer grid around each resonance

    Results
    -------
    frequency : Hz
        frequency
    velocity_response : m/s over frequency
        magnitude of velocity over command
    velocity_magnitude : dB over frequency
        magnitude of velocity over command, in dB re 1 m/s
    velocity_phase : deg over frequency
        phase of velocity over command
    position_response : m over frequency
        magnitude of position over command
    pressure_response : Pa over frequency
        magnitude of pressure a minus b, over command
    velocity_gain : m/s
        velocity over command at low frequency, at the operating point
    resonance : Hz
        frequency of the largest response; none if the response falls from the lowest frequency on
    peak : dB
        largest magnitude of velocity over command, in dB re 1 m/s
    damping_ratio : 1
        damping ratio of the oscillation nearest to the resonance; none without an oscillation
    """
    x = plant.middle_m if position is None else position
    linear = linear_model(plant, open_command(plant, 0.0), x, moving_gas(plant), "sliding")
    output = f"{plant.piston}.velocity_m_s"
    modes = oscillations(linear)
    damping = np.maximum([-one.real / abs(one) for one in modes], LEAST_DAMPING)
    near = damping * np.sinh(np.outer(NEAR, np.arcsinh(REACH / damping)))
    grid = np.union1d(FREQUENCIES, np.abs(modes) * np.exp(near) / (2.0 * math.pi))
    highest = int(np.argmax(np.abs(response(linear, output, grid))))
    fine = np.geomspace(grid[max(highest - 1, 0)], grid[min(highest + 1, grid.size - 1)], FINE)
    sizes = np.abs(response(linear, output, fine))
    resonance = fine[int(np.argmax(sizes))] if highest else math.nan
    mode = min(modes, key=lambda one: abs(abs(one) - 2.0 * math.pi * resonance), default=complex(math.nan))
    f = grid if frequencies is None else np.array([positive(one, "", "frequency") for one in frequencies])
    velocity = response(linear, output, f)
    a, b = (response(linear, f"{plant.piston}.{side}.pressure_pa", f) for side in "ab")
    size = np.abs(velocity)
    phase = np.unwrap(np.angle(velocity)) * 180.0 / math.pi
    gain = abs(response(linear, output, np.array([SLOW]))[0])
    numbers = gain, resonance, 20.0 * np.log10(sizes.max()), -mode.real / abs(mode)
    return f, size, 20.0 * np.log10(size), phase, size / (2.0 * math.pi * f), np.abs(a - b), *numbers


@characteristic(
    "describing-function",
    algorithm="simulated, command in 200 steps a period; two periods by Fourier transform after four of settling",
    x="frequency",
    y="gain",
    needs_shares=True,
)
def _describing(plant: HeldDrive, amplitudes: Any = AMPLITUDES, frequencies: Any = SINE_HZ) -> Found:  # noqa: ANN401
    """Response to large sines.

    First harmonic of the velocity relative to a sinusoidal command, and the other harmonics relative to the first, for
    several amplitudes and frequencies. The piston starts at mid stroke and does not reach an end.

    Settings
    --------
    amplitudes
        amplitudes of the command
    frequencies
        Hz

    Results
    -------
    amplitude : 1
        amplitude of the command
    frequency : Hz
        frequency
    gain : m/s over amplitude, frequency
        first harmonic of the velocity divided by the amplitude
    phase : deg over amplitude, frequency
        phase of the first harmonic
    distortion : 1 over amplitude, frequency
        root of the sum of squares of harmonics 2 to 10, divided by the first one
    """
    start = start_of(plant, plant.middle_m, plant.pressures(gas_at(plant)))

    def velocities(amplitude: float, frequency: float) -> Array:
        rate, periods = STEPS * frequency, SETTLING + COUNTED

        def sine(t: float) -> float:  # held from a step to the next: the value at its middle
            return amplitude * math.sin(2.0 * math.pi * frequency * (t + 0.5 / rate))

        try:
            plans = {name: lambda t, size=size: size * sine(t) for name, size in plant.actuation.out.items()}
            run = simulate_plant(plant, plans, periods / frequency, rate, initial=start)
        except SimulationError:
            return NOTHING
        columns = short_columns(plant, run)
        last = slice(SETTLING * STEPS, periods * STEPS)
        if np.abs(columns["end_stop_force_n"][last]).max() > 0.0:
            return NOTHING
        return columns["velocity_m_s"][last]

    return _over_grid(amplitudes, frequencies, velocities)


def _over_grid(
    amplitudes: Sequence[float], frequencies: Sequence[float], respond: Callable[[float, float], Array]
) -> tuple[Any, ...]:
    """Return amplitudes and frequencies, and gain, phase and distortion with the shape (amplitudes, frequencies)."""
    named = (("amplitude", amplitudes), ("frequency", frequencies))
    axes = [[positive(one, "", name) for one in values] for name, values in named]
    found = np.array([[_over_sine(respond(a, f), a) for f in axes[1]] for a in axes[0]])
    return *axes, *np.moveaxis(found, 2, 0)


def _over_sine(values: Array, amplitude: float) -> tuple[float, float, float]:
    """Return gain and phase (degrees) of the first harmonic relative to the sinusoidal input, and the distortion."""
    spectrum = np.fft.rfft(values)[::COUNTED] * 2.0 / (COUNTED * STEPS)
    first = spectrum[1] * 1j
    distortion = np.sqrt(np.sum(np.abs(spectrum[2 : HARMONICS + 1]) ** 2)) / abs(first)
    return abs(first) / amplitude, math.degrees(np.angle(first)), distortion


@characteristic(
    "load-describing-function",
    algorithm="simulated, load in 200 steps a period; two periods by Fourier transform after four of settling",
    x="frequency",
    y="compliance",
    held=True,
)
def _load_describing(
    plant: HeldDrive,
    amplitudes: Any = None,  # noqa: ANN401
    frequencies: Any = SINE_HZ,  # noqa: ANN401
    pressures: Any = None,  # noqa: ANN401
) -> Found:
    """Response to large sines of the load.

    First harmonic of the position relative to a sinusoidal load, and the other harmonics relative to the first, for
    several amplitudes and frequencies. The valve is at command 0. The piston starts at mid stroke and does not reach an
    end.

    Settings
    --------
    amplitudes
        amplitudes of the load, in N; default: 20, 30 and 40 % of the blocked force at full command
    frequencies
        Hz
    pressures
        pressures of both chambers; default: the mean of ambient and supply pressure

    Results
    -------
    amplitude : N
        amplitude of the load
    frequency : Hz
        frequency
    compliance : m/N over amplitude, frequency
        first harmonic of the position divided by the amplitude
    phase : deg over amplitude, frequency
        phase of the first harmonic
    distortion : 1 over amplitude, frequency
        root of the sum of squares of harmonics 2 to 10, divided by the first one
    """
    if amplitudes is None:
        most = min(abs(full_force(plant, direction)[0]) for direction in (1.0, -1.0))
        amplitudes = [share * most for share in LOADS]
    gas = gas_at(plant, pressures)

    def positions(amplitude: float, frequency: float) -> Array:
        rate, periods = STEPS * frequency, SETTLING + COUNTED
        session = plant.session(0.0, plant.middle_m, 0.0, gas)
        sine = amplitude * np.sin(2.0 * math.pi * (np.arange(periods * STEPS) + 0.5) / STEPS)  # held from step to step
        session.schedule(plant.load, [(k / rate, force) for k, force in enumerate(sine)])
        session.advance(SETTLING / frequency)
        way = []
        for k in range(COUNTED * STEPS):
            session.advance((SETTLING * STEPS + k) / rate)
            way.append(session.read(f"{plant.piston}.position_m"))
        return np.array(way) if 0.0 < min(way) <= max(way) < plant.stroke_m else NOTHING

    return _over_grid(amplitudes, frequencies, positions)


# --- Importance of the numbers of a drive: relative sensitivities of its characteristics.

SHARE = 1e-3  # of a number, to both sides


def moved(drive: Drive, name: str, factor: float) -> Drive:
    """Return a drive with one of its numbers multiplied by a factor."""
    given = values(drive)[name]
    if isinstance(given.mark, StatedPressure):
        pressure = attrgetter(name)(drive)
        text = f"{factor * pressure.value_pa!r} Pa {'gauge' if pressure.gauge else 'abs'}"
        return drive.replace({name: text})
    unit = given.mark.si_unit if given.mark is not None else ""
    value = factor * given.si
    return drive.replace({name: units.UnitFloat(value, unit, given.mark.written) if unit else value})  # type: ignore[union-attr]


@characteristic(
    "sensitivity",
    algorithm="central differences of 0.1 % of the number",
    x="parameter",
    y="stroke_time_sensitivity",
)
def _tornado(plant: HeldDrive, numbers: Any = None) -> Found:  # noqa: ANN401 - a sequence of names
    """Sensitivity to each number of the drive.

    Relative change of a result divided by the relative change of one number of the drive file.

    Settings
    --------
    numbers
        names of numbers in the drive file; default: all

    Results
    -------
    parameter : 1
        number of the drive file
    steady_speed_sensitivity : 1 over parameter
        relative change of the steady speed at full command, per relative change of the number
    stall_force_sensitivity : 1 over parameter
        relative change of the largest load that the resting piston can move, per relative change of the number
    natural_frequency_sensitivity : 1 over parameter
        relative change of the natural frequency at mid stroke, per relative change of the number
    stroke_time_sensitivity : 1 over parameter
        relative change of the time of a full stroke from rest, per relative change of the number
    end_speed_sensitivity : 1 over parameter
        relative change of the speed at the end of that stroke, per relative change of the number
    """
    drive: Any = plant.described
    if not hasattr(drive, "cylinder"):
        raise CommandError(f"{plant.name} is a circuit", rule="sensitivities need a drive file")
    names, rows = [], []
    known = values(drive)
    for name in numbers or ():
        if name not in known:
            raise CommandError(f"{name} is not a number of this drive", remedy=nearest(name, known))
    for name in known if numbers is None else numbers:
        if known[name].si == 0.0:
            continue
        ends = []
        try:
            for sign in (-1.0, 1.0):
                other = HeldDrive(moved(drive, name, 1.0 + sign * SHARE))
                spring = adiabatic_stiffness(other.static, other.middle_m, "3 bar abs")
                stroke = run_strokes(other, [1.0], 0.0, other.before(1.0)).strokes[0]
                speed, (_, stall) = steady_state(other.static, 1.0, 0.0).velocity_m_s, full_force(other.static, 1.0)
                natural = math.sqrt(spring / other.mass) / (2.0 * math.pi)
                ends.append((speed, stall, natural, stroke.stroke_time, stroke.end_speed))
        except PneudriveError:  # at a bound, or tied to another number
            continue
        width = math.log1p(SHARE) - math.log1p(-SHARE)
        names.append(name)
        rows.append([math.log(after / before) / width for before, after in zip(*ends, strict=True)])
    table = np.array(rows)
    order = np.argsort(-np.nanmax(np.abs(table), axis=1))
    return [names[k] for k in order], *table[order].T


# --- Study of the tubes between valve and cylinder: speed and stroke time of a drive over their length and bore.

LENGTHS, DIAMETERS = ("0.5 m", "1 m", "2 m", "5 m"), ("4 mm", "6 mm", "8 mm")


def lines(
    drive: Drive,
    lengths: Sequence[str | float] = LENGTHS,
    diameters: Sequence[str | float] = DIAMETERS,
    *,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate full strokes of a drive with tubes of several lengths and bores at both chambers.

    Every tube has ``kind = "tube"`` (steady flow by an empirical formula). Flow controls of the drive are kept.

    Parameters
    ----------
    drive : Drive
        The tubes of this study replace the table `[tubing]` of the drive, if it has one.
    lengths, diameters : sequence of str or float
        Quantities, or numbers in m.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    xarray.Dataset
        Dimensions diameter and length (m). Variables vent_conductance, vent_speed, stroke_time_out, stroke_time_back,
        mean_speed, end_speed. NaN if the piston does not arrive. ``attrs["without_tubes"]`` and
        ``attrs["as_described"]`` hold the same values for the drive without tubes and with its described tubes.

    Raises
    ------
    CommandError
        A length or a diameter is not a positive length.
    DescriptionError
        `drive` is not a `Drive`.
    Cancelled
        `cancel` was set.

    Examples
    --------
    >>> import pneudrive as pn
    >>> study = pn.lines(pn.Drive.load("catalogue:reference"), ["1 m"], ["4 mm"])
    >>> round(float(study.vent_speed[0, 0]), 3)
    2.297
    """
    _check_drive(drive)
    study = _lines.of(HeldDrive(drive), lengths=lengths, diameters=diameters, watch=Watch(progress, cancel))
    study.attrs = {"title": drive.name, "without_tubes": _row(drive, {})}
    if drive.tubing:
        study.attrs["as_described"] = _row(drive, drive.to_dict()["tubing"])
    return study


def _metres(given: Sequence[str | float], what: str) -> list[float]:
    """Return the distinct lengths in m, in ascending order."""
    lengths = [] if given is None or isinstance(given, str) else list(given)
    if not lengths:
        raise CommandError(f"{what} = {given!r} is not a list of quantities", remedy='For instance ["0.5 m", "2 m"].')
    return sorted({positive(one, "m", what) for one in lengths})


def _check_drive(drive: object) -> None:
    if not hasattr(drive, "tubing"):
        remedy = "Describe it as a drive file: [supply], [valve], [cylinder], [friction]."
        raise DescriptionError(f"the table of tubes needs a drive, but got a {type(drive).__name__}", remedy=remedy)


def _row(drive: Any, tubing: Plain) -> NamedNumbers:  # noqa: ANN401 - checked
    """Return the results of a drive with these tubes, by name."""
    tables = {key: table for key, table in drive.to_dict().items() if key != "provenance"}
    drive = type(drive).model_validate(tables | {"tubing": tubing, "friction": drive.friction})
    held = {"valve": {1.0: 1.0, -1.0: -1.0}} if drive.valve.is_switching else {}
    plant = HeldDrive(drive, actuation=Actuation({"valve": 1.0}, {"valve": -1.0}, held=held))
    pressure = plant.supply_pa
    choked = flow_through(plant, "b", inward=False, upstream=pressure, ratios=[VACUUM])[0]
    conductance = choked / (ANR_DENSITY_KG_M3 * pressure)
    mean_k = math.sqrt(ANR_TEMPERATURE_K * drive.ambient.temperature_k)  # C is that at the temperature of ISO 6358
    flow = ANR_DENSITY_KG_M3 * drive.gas.gas_constant_j_kg_k * mean_k  # times C/A: speed at choked flow
    speed = conductance * flow / drive.cylinder.area_b_m2
    out, back = (
        run_strokes(plant, [u], start_m, plant.before(u), 2.0 * plant.stroke_m / speed).strokes[0]
        for u, start_m in ((1.0, 0.0), (-1.0, plant.stroke_m))
    )
    numbers = (conductance, speed, out.stroke_time, back.stroke_time, plant.stroke_m / out.stroke_time, out.end_speed)
    return dict(zip(list(_lines.results)[2:], numbers, strict=True))


@characteristic(
    "lines",
    algorithm="`pneudrive lines`: steady flow through the exhaust path, and simulated strokes",
    x="length",
    y="mean_speed",
)
def _lines(plant: HeldDrive, lengths: Any = LENGTHS, diameters: Any = DIAMETERS, *, watch: Watch = UNWATCHED) -> Found:  # noqa: ANN401
    """Speed against the tubes.

    Choked speed, stroke times, mean speed and end speed with steady tubes of equal length and bore at both chambers.
    Strokes start from rest, with the emptying chamber at supply pressure.

    Settings
    --------
    lengths
        lengths of each tube
    diameters
        inner diameters

    Results
    -------
    diameter : m
        inner diameter of the tubes
    length : m
        length of each tube
    vent_conductance : m3/(s Pa) over diameter, length
        sonic conductance of the exhaust path of chamber b: line and valve in series
    vent_speed : m/s over diameter, length
        piston speed at choked flow through the exhaust path of chamber b
    stroke_time_out : s over diameter, length
        stroke time to the end of chamber b, from the command; chamber b starts at supply pressure
    stroke_time_back : s over diameter, length
        stroke time to the end of chamber a, from the command; chamber a starts at supply pressure
    mean_speed : m/s over diameter, length
        stroke over stroke_time_out
    end_speed : m/s over diameter, length
        speed at the end of chamber b
    """
    _check_drive(plant.described)
    wide, long, rows = _metres(diameters, "diameter"), _metres(lengths, "length"), []
    for diameter, length in watch.each(product(wide, long), "tubes"):
        tube = {"length": units.UnitFloat(length, "m", "m"), "diameter": units.UnitFloat(diameter, "m", "mm")}
        rows.append(list(_row(plant.described, {"a": tube, "b": tube}).values()))
    return wide, long, *np.reshape(rows, (len(wide), len(long), -1)).transpose(2, 0, 1)
