"""Sensors between the output of a drive and its recording: gain, offset, lag, noise.

    y(t) = gain h(t) + offset + noise,    lag dh/dt + h = model output

h is the output after a first-order lag. Each recording has its own offset, because sensors may be zeroed between
recordings. Gain and lag are common to all recordings.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from pneudrive.arrays import Array, Keyed
from pneudrive.errors import DescriptionError, FitError, RecordingError, nearest
from pneudrive.signals.drive_recording import DriveRecording
from pneudrive.simulation.trajectory import meaning

#: Channel -> column of a recording and of the core.
CHANNELS = {
    meaning(column)[0]: column
    for column in (
        "position_m",
        "pressure_a_pa",
        "pressure_b_pa",
        "velocity_m_s",
        "temperature_a_k",
        "temperature_b_k",
        "friction_force_n",
    )
}
#: Default channels; others are compared on request.
USUAL = ("position", "pressure_a", "pressure_b")
LEAST_VALUES = 20


def channels_in(recording: DriveRecording, wanted: Sequence[str] | None) -> list[str]:
    """Return the channels of a recording to compare with the model.

    Parameters
    ----------
    recording : DriveRecording
    wanted : sequence of str or None
        None: position and pressures, if measured.

    Raises
    ------
    RecordingError
        A channel is unknown or missing in the recording, or no channel is given.
    """
    where = str(recording.source or recording.name)
    for name in wanted or ():
        if name not in CHANNELS:
            raise RecordingError(f"{name} is not a channel", where=where, remedy=nearest(name, CHANNELS))
        if CHANNELS[name] not in recording:
            known = ", ".join(recording.columns)
            raise RecordingError.of("identify.no_column", where=where, column=CHANNELS[name], known=known)
    found = [c for c in USUAL if CHANNELS[c] in recording] if wanted is None else list(wanted)
    if not found:
        raise RecordingError.of("identify.nothing_to_compare", where=where, known=", ".join(CHANNELS))
    for name in found:
        if np.isfinite(recording[CHANNELS[name]]).sum() < LEAST_VALUES:
            raise RecordingError(f"{name} has fewer than {LEAST_VALUES} values", where=where)
    return found


Free = Literal["free"]


@dataclass(frozen=True)
class Sensor:
    """Known properties of a measured channel.

    Quantities are texts with a unit (``"2 um"``) or numbers in SI.

    Attributes
    ----------
    noise : quantity, optional
        Standard deviation of white noise; by default estimated from the residuals.
    offset : quantity or ``"free"``
        Error added by the sensor; ``"free"``: one offset for each recording.
    offset_uncertainty : quantity, optional
        Standard uncertainty of a free offset, from a datasheet, as prior of the fit.
    gain : float or ``"free"``
    lag : quantity or ``"free"``
        Time constant of the first-order lag.
    resolution : quantity
        Step of an encoder or a converter.
    """

    noise: str | float | None = None
    offset: str | float | Free = 0.0
    offset_uncertainty: str | float | None = None
    gain: float | Free = 1.0
    lag: str | float | Free = 0.0
    resolution: str | float = 0.0


@dataclass(frozen=True)
class Channel:
    """Sensor in SI, which measures the model output `column`. The fit of its `free` properties begins at `START`."""

    name: str
    column: str
    unit: str
    noise: float | None = None
    offset: float = 0.0
    offset_uncertainty: float = np.inf
    gain: float = 1.0
    lag: float = 0.0
    resolution: float = 0.0
    free: frozenset[str] = frozenset()


#: Free property -> start value. The lag is that of a pressure transducer with its tube (assumed).
START = {"offset": 0.0, "gain": 1.0, "lag": 2e-3, "delay": 0.0}
#: Unit -> typical offset, which scales the coordinate of an offset.
OFFSET_SIZE = {"m": 1e-3, "Pa": 1e3, "m/s": 1e-2, "K": 1.0, "N": 1.0, "m/s^2": 1.0}


def command_delay(sensors: Mapping[str, Sensor | Keyed] | None) -> float | None:
    """Return the delay of the valve after the recorded command in s, from ``{"command": {"delay": "2 ms"}}``.

    None means ``"free"``: a delay is fitted for each recording.

    Raises
    ------
    FitError
        The command has another key, or the delay is not a time.
    """
    said = (sensors or {}).get("command", {})
    if isinstance(said, Sensor) or set(said) - {"delay"}:
        raise FitError.of("identify.command_sensor")
    given = said.get("delay", 0.0)
    return None if given == "free" else _si(given, "s", "command.delay", -np.inf)


def _si(given: Any, unit: str, what: str, least: float) -> float:  # noqa: ANN401 - checked here
    from pneudrive.units import parse

    try:
        value = parse(given, unit) if isinstance(given, str) and unit else float(given)
    except (DescriptionError, TypeError, ValueError) as error:
        reason = error.what if isinstance(error, DescriptionError) else f"{given!r} is not a quantity"
        raise FitError(f"sensor {what}: {reason}", rule=f"a quantity in {unit}" if unit else "a number") from None
    if not (np.isfinite(value) and value >= least):
        raise FitError(f"sensor {what} = {given} is out of bounds", rule="finite and not negative")
    return value


def channels_of(names: list[str], sensors: Mapping[str, Sensor | Keyed] | None) -> dict[str, Channel]:
    """Return the named channels, each with the properties of its sensor in SI.

    Raises
    ------
    FitError
        A channel or a keyword is unknown, or a quantity has another dimension or is out of bounds.
    """
    stated = {name: sensor for name, sensor in (sensors or {}).items() if name != "command"}
    if unknown := sorted(set(stated) - set(names)):
        raise FitError.of("identify.no_channel", name=unknown[0], known=", ".join(names))
    known, channels = [field.name for field in fields(Sensor)], {}
    for name in names:
        sensor, unit = stated.get(name, {}), meaning(CHANNELS[name])[1]
        properties = vars(sensor) if isinstance(sensor, Sensor) else sensor
        if unknown := [key for key in properties if key not in known]:
            raise FitError(f"sensor {name}: {unknown[0]} is not known", remedy=nearest(str(unknown[0]), known))
        free = frozenset(key for key, given in properties.items() if given == "free" and key in START)
        values = {key: START[key] for key in free}
        for key, given in properties.items():
            if given is not None and key not in free:
                least = -np.inf if key in ("offset", "gain") else 0.0
                values[key] = _si(given, {"gain": "", "lag": "s"}.get(key, unit), f"{name}.{key}", least)
        channels[name] = Channel(name, CHANNELS[name], unit, **values, free=free)
    return channels


#: Typical delay of a valve, s (assumed), which scales the coordinate of a delay.
DELAY_SIZE_S = 2e-3


@dataclass(frozen=True)
class SensorParameter:
    """Free parameter of a sensor: offset or command delay of one recording, or gain or lag of all recordings."""

    kind: str
    channel: str
    recording: int | None
    name: str
    unit: str
    size: float
    uncertainty: float
    lower: float = -np.inf
    upper: float = np.inf


def sensor_parameters(
    channels: Iterable[Channel], recordings: Sequence[tuple[str, list[Channel]]], *, delay: bool
) -> list[SensorParameter]:
    """Return the free parameters of the sensors: an offset for each recording, but one gain and one lag for all.

    Each recording is given as a pair: its name and its channels. `delay` adds a command delay for each recording.
    """
    which = [f" [{name}]" if len(recordings) > 1 else "" for name, _ in recordings]
    out = [
        SensorParameter("delay", "command", i, f"command.delay{of}", "s", DELAY_SIZE_S, np.inf)
        for i, of in enumerate(which if delay else ())
    ]
    for channel in channels:
        for i, of in enumerate(which):
            if "offset" in channel.free and channel in recordings[i][1]:
                name, known = f"{channel.name}.offset{of}", channel.offset_uncertainty
                size = known if np.isfinite(known) else 5.0 * OFFSET_SIZE[channel.unit]  # an assumption
                out.append(SensorParameter("offset", channel.name, i, name, channel.unit, size, known))
        for kind, unit, lower in (("gain", "1", -np.inf), ("lag", "s", 0.0)):
            if kind in channel.free:
                name = f"{channel.name}.{kind}"
                out.append(SensorParameter(kind, channel.name, None, name, unit, 1.0, np.inf, lower))
    return out


def white_noise(values: Array) -> float:
    """Estimate the standard deviation of white noise on a smooth signal, from its third differences."""
    third = np.diff(values[np.isfinite(values)], 3)
    return float(np.sqrt(np.mean(third**2) / 20.0)) if third.size else 0.0


def lagged(time_s: Array, values: Array, lag_s: float) -> Array:
    """Pass columns through a first-order lag. The result is exact for values that are linear between the samples.

    Parameters
    ----------
    time_s : ndarray, shape (n,)
    values : ndarray, shape (n, ...)
    lag_s : float
        Time constant. The lag starts in the steady state of a linear input.

    Returns
    -------
    ndarray, shape (n, ...)
    """
    if lag_s <= 0.0 or len(time_s) < 2:
        return values
    step = np.diff(time_s)
    decay = np.exp(-step / lag_s)
    # y+ = e y + w0 u + w1 u+ solves lag y' + y = u for u linear over the step
    mean = (1.0 - decay) * lag_s / step
    w0, w1 = mean - decay, 1.0 - mean
    out = np.empty_like(values)
    out[0] = values[0] - lag_s * (values[1] - values[0]) / step[0]
    shape = (-1,) + (1,) * (values.ndim - 1)
    forced = w0.reshape(shape) * values[:-1] + w1.reshape(shape) * values[1:]
    if np.ptp(step) <= 1e-9 * step[0]:
        from scipy.signal import lfilter

        e = float(decay.mean())
        begin = (e * out[0])[None]
        out[1:] = lfilter([1.0], [1.0, -e], forced, axis=0, zi=begin)[0]
        return out
    for i in range(len(step)):
        out[i + 1] = decay[i] * out[i] + forced[i]
    return out
