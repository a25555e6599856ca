"""Commands and durations of the members, and outputs of each run: numbers, or samples of signals."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import units
from pneudrive.describe.tables.starts import start_table
from pneudrive.errors import CommandError, naming, nearest
from pneudrive.simulation import command as commands
from pneudrive.simulation.simulate import number_of, positive
from pneudrive.simulation.trajectory import meaning

if TYPE_CHECKING:
    from pneudrive.arrays import Array, Columns, Plain
    from pneudrive.simulation.command import CommandInput, Steps

    EachSteps = list[Steps]
    OwnReduction = Callable[[Columns, Array], Array | float]


# --- Commands and duration of each member, one for all members or one for each.


@dataclass(frozen=True, eq=False)
class MemberPlans:
    """Commands and durations of the members.

    Attributes
    ----------
    steps : dict
        Input of the core -> steps for all members, or steps for each member.
    durations : ndarray
        Durations in s, shape (1,) or (n,).
    """

    steps: dict[str, EachSteps]
    durations: Array

    @property
    def duration_s(self) -> float:
        """The longest duration in s."""
        return float(self.durations.max())

    @property
    def moves_up(self) -> bool | None:
        """Whether the first command other than 0 is positive. None if members differ, or without such a command."""
        every = (values for each in self.steps.values() for _, values in each)
        signs = {next((value > 0.0 for value in values if value), None) for values in every}
        return signs.pop() if len(signs) == 1 else None

    def check(self, size: int) -> None:
        """Reject commands or durations whose number differs from the number of members.

        Raises
        ------
        CommandError
            The numbers differ.
        """
        commanded = {f"the command of {name.rpartition('.')[0]}": len(each) for name, each in self.steps.items()}
        for what, length in {**commanded, "duration": len(self.durations)}.items():
            if length not in (1, size):
                raise CommandError.of("ensemble.rows", what=what.removesuffix(" of "), length=length, size=size)

    def part(self, first: int, last: int) -> MemberPlans:
        """Return the commands and durations of the members `first` to ``last - 1``."""
        own = {name: each if len(each) == 1 else each[first:last] for name, each in self.steps.items()}
        return MemberPlans(own, self.durations if len(self.durations) == 1 else self.durations[first:last])

    def alike(self) -> Iterator[tuple[Any, list[tuple[str, list[float], Array]], Array]]:
        """Yield groups of members with equal command times, which are computed together.

        Yields
        ------
        ndarray of int, or slice
            Indices of the members.
        list
            Tuples of input, its times in s, and its values with shape (times,) or (members, times).
        ndarray
            Durations in s, shape (1,) or (members,).
        """
        longest = max((len(each) for each in self.steps.values()), default=1)
        groups: dict[tuple[tuple[float, ...], ...], list[int]] = {}
        for place in range(longest):
            times = tuple(each[place % len(each)][0] for each in self.steps.values())
            groups.setdefault(times, []).append(place)
        for times, own in groups.items():
            plans = []
            for (name, each), at in zip(self.steps.items(), times, strict=True):
                values = np.array([each[place % len(each)][1] for place in own])
                plans.append((name, list(at), values if longest > 1 else values[0]))
            durations = self.durations if 1 in (longest, len(self.durations)) else self.durations[own]
            yield slice(None) if longest == 1 else np.array(own), plans, durations

    def about(self) -> Plain:
        """Return commands and durations as plain data. A list with an entry per member is replaced by its SHA-256."""
        steps = self.steps.items()
        said = {name: [*map(list, each[0])] if len(each) == 1 else _digest(each) for name, each in steps}
        command = next(iter(said.values())) if list(said) == ["command"] else said
        durations = self.durations.tolist()
        return {"command": command, "duration_s": durations[0] if len(durations) == 1 else _digest(durations)}


def _digest(given: Any) -> Plain:  # noqa: ANN401 - plain data
    return {"members": len(given), "sha256": hashlib.sha256(json.dumps(given).encode()).hexdigest()}


def member_plans(command: Any, duration: Any, commandable: Mapping[str, CommandInput]) -> MemberPlans:  # noqa: ANN401
    """Read the commands of the members of a drive or a circuit.

    Parameters
    ----------
    command : as for `pneudrive.ensemble.simulate_many`
    duration : as for `pneudrive.ensemble.simulate_many`
    commandable : mapping
        Component that takes a command -> its electrical input.
    """
    rows: dict[str, EachSteps] = {}
    if isinstance(command, list | tuple) and command and all(isinstance(one, Mapping) for one in command):
        each = [dict(_member(place, commands.plans, one, commandable)) for place, one in enumerate(command)]
        if any(set(one) != set(each[0]) for one in each):
            raise CommandError("the members have commands of different components", rule="all need the same components")
        rows = {name: [one[name] for one in each] for name in each[0]}
    elif isinstance(command, Mapping):
        for name, given in command.items():
            # Check with a placeholder for the steps that the component exists and does not have two commands.
            ((own, _),) = commands.plans({name: 0.0}, commandable)
            if own in rows:
                raise CommandError(f"two commands are given for {own}", remedy="Keep one of them.")
            with naming(own, CommandError):
                rows[own] = read_rows(given, commandable[own])
    elif "" in commandable or (_is_many(command) and not commands.are_named(command)):
        ((own, _),) = commands.plans(0.0, commandable)
        rows[own] = read_rows(command, commandable[own])
    else:
        rows = {name: [steps] for name, steps in commands.plans(command, commandable)}
    if isinstance(duration, str) or not np.ndim(duration):
        durations = [positive(duration, "s", "duration")]
    elif np.ndim(duration) == 1 and len(duration):
        durations = [positive(one, "s", f"duration of member {place}") for place, one in enumerate(duration)]
    else:
        rule = "one duration for all members, or one for each member"
        raise CommandError(f"duration has the shape {np.shape(duration)}", rule=rule)
    return MemberPlans({commands.input_of(name): each for name, each in rows.items()}, np.array(durations))


def read_rows(given: Any, signal: CommandInput) -> EachSteps:  # noqa: ANN401
    """Read one command for all members, or a list of commands, one for each.

    Raises
    ------
    CommandError
        A command is not valid. The message names the member.

    Examples
    --------
    >>> read_rows("0 s: 1", None)
    [((0.0,), (1.0,))]
    >>> read_rows([0.5, "0 s: 1, 20 ms: -1"], None)
    [((0.0,), (0.5,)), ((0.0, 0.02), (1.0, -1.0))]
    """
    if callable(given):
        raise CommandError("a function cannot command several members", remedy="Give pairs (time, command).")
    if not _is_many(given):
        return [commands.steps(given, None, signal)]
    return [_member(place, commands.steps, one, None, signal) for place, one in enumerate(given)]


def _is_many(given: Any) -> bool:  # noqa: ANN401
    """Return whether a value is a list of commands. Pairs of time and value form a single command."""
    if isinstance(given, np.ndarray):
        return given.ndim in (1, 3) and len(given) > 0
    if isinstance(given, str) or not isinstance(given, Sequence):
        return False
    entries = [one if isinstance(one, list | tuple | np.ndarray) else () for one in given]
    is_pair = [len(one) == 2 and all(isinstance(part, str | Real) for part in one) for one in entries]
    return not all(is_pair)  # without entries, this is one command


def _member(place: int, read: Any, *given: Any) -> Any:  # noqa: ANN401
    with naming(f"member {place}", CommandError):
        if callable(given[0]):
            raise CommandError("the command must not be a function", remedy="Give pairs (time, command).")
        return read(*given)


def parted_starts(given: Any) -> tuple[Any, dict[str, list[Any]]]:  # noqa: ANN401
    """Split a start state into the state common to all members, and the values of the members by key.

    Raises
    ------
    CommandError
        The start states of the members have different keys.

    Examples
    --------
    >>> parted_starts([{"position": "5 mm"}, {"position": "9 mm"}])
    (None, {'position': ['5 mm', '9 mm']})
    """
    if not isinstance(given, list | tuple):
        return given, {}
    each = [start_table(one) for one in given]
    if not each or not each[0] or any(set(one) != set(each[0]) for one in each):
        raise CommandError("the start states of the members have different keys", rule="all members need the same keys")
    return None, {key: [one[key] for one in each] for key in each[0]}


# --- Outputs of each run: numbers, or samples of signals.

#: Default sampling rate of the signals for a user function, Hz.
RATE_HZ = 1000.0
RATE = "outputs: sampling rate"  # name in messages
#: End stop force, N, above which the piston counts as in contact (assumed); the penetration is then far below 1 nm.
TOUCH_N = 1e-3
#: Default outputs: these signals at the end of the run. The stroke time is added.
STATE = ("position", "velocity", "pressure_a", "pressure_b", "temperature_a", "temperature_b")
_CONDITION = re.compile(r"\s*+([A-Za-z_][\w.]*+)\s*+([<>])\s*+(.*\S)\s*+")
_CALL = re.compile(r"\s*([a-z_]+)\s*\((.*)\)\s*", re.DOTALL)


@dataclass(frozen=True)
class Reduction:
    """An output that is computed from each run of one drive.

    Attributes
    ----------
    word : str
        ``final``, ``max``, ``min``, ``mean``, ``integral``, ``time_when``, ``rate_when``, ``samples`` or ``own``.
    columns : tuple of str
        Signals, as columns of a trajectory's file. One signal, except for ``own``.
    name : str
        Name of the variable.
    unit, long_name : str
    level : float
        For ``time_when`` and ``rate_when``: the level, in the unit of the signal. For a settling time (``own``): half
        the width of the band.
    rate_hz : float
        For ``samples`` and ``own``: the sampling rate.
    above : bool
        For ``time_when`` and ``rate_when``: whether the signal must be above the level; False: below it.
    function : callable, optional
        For ``own``: the user function.
    """

    word: str
    columns: tuple[str, ...]
    name: str
    unit: str
    long_name: str
    level: float = math.nan
    rate_hz: float = RATE_HZ
    above: bool = True
    function: OwnReduction | None = None

    @property
    def file_name(self) -> str:
        """Name of the column in a file, including the unit."""
        return units.column_name(self.name, self.unit)

    @property
    def requests(self) -> list[Reduction]:
        """Requests to the core: the output itself, or the samples that its function receives."""
        if self.function is None:
            return [self]
        return [replace(self, word="samples", columns=(column,), function=None) for column in self.columns]

    def about(self) -> Plain:
        """Return the output as plain data."""
        out: Plain = {"output": self.word, "name": self.name, "of": list(self.columns)}
        if not math.isnan(self.level):
            out |= {"level": self.level, "above": self.above}
        if self.word in ("samples", "own"):
            out |= {"rate_hz": self.rate_hz}
        if self.function is not None:
            out |= {"function": getattr(getattr(self.function, "func", self.function), "__qualname__", "")}
        return out


@dataclass(frozen=True)
class Output:
    """An output that a user function computes from sampled signals of each run.

    Parameters
    ----------
    function : callable
        Function of a dict of signals (members, samples) and of their times in s (samples,). It must return one number
        for each member. It receives the members of a chunk together. The value of a member must
        not depend on other members.
    signals : sequence of str
        Signals that the function receives.
    name : str
        Name of the variable in the result.
    unit : str
        Unit of the result.
    long_name : str
    rate : str or float
        Samples per second.
    """

    function: OwnReduction
    signals: Sequence[str]
    name: str
    unit: str = "1"
    long_name: str = ""
    rate: str | float = "1 kHz"

    def of(self, known: SignalNames) -> Reduction:
        """Return the output for a drive.

        Raises
        ------
        CommandError
            A signal does not exist, or the rate is not valid.
        """
        columns = tuple(known.meaning(signal)[0] for signal in self.signals)
        rate_hz = positive(self.rate, "1/s", RATE)
        return Reduction("own", columns, self.name, self.unit, self.long_name, rate_hz=rate_hz, function=self.function)


own = Output


class SignalNames:
    """The signals of a drive, by their names in a trajectory and as columns of a file.

    Parameters
    ----------
    columns : sequence of str
        Columns of a trajectory's file.
    towards_b : bool or None
        Whether the commands first move the piston towards the end of chamber b. None if the commands
        do not move the piston, or if the members differ.
    states : sequence of str
        Signals whose final values are outputs by default.
    """

    def __init__(
        self,
        columns: Sequence[str],
        towards_b: bool | None = None,
        states: Sequence[str] = STATE,
    ) -> None:
        self.columns = {key: column for column in columns for key in (column, meaning(column)[0])}
        self.towards_b = towards_b
        self.states = [signal for signal in states if signal in self.columns]

    def meaning(self, signal: str) -> tuple[str, str, str, str]:
        """Return column, name, unit and long name of a signal.

        Raises
        ------
        CommandError
            The signal does not exist.
        """
        if signal not in self.columns:
            known = {meaning(column)[0] for column in self.columns.values()}
            raise CommandError(f"outputs: there is no signal {signal}", remedy=nearest(str(signal), known))
        return self.columns[signal], *meaning(self.columns[signal])


#: Word -> beginning of the long name of an output of one signal.
_PLAIN = {
    "final": "at the end: ",
    "max": "largest ",
    "min": "smallest ",
    "mean": "mean over time: ",
    "integral": "integral over time: ",
}


def _plain(word: str, signals: SignalNames, signal: str) -> Reduction:
    column, name, unit, long_name = signals.meaning(signal)
    if word == "integral":
        unit = unit.removesuffix("/s") if unit.endswith("/s") else f"{unit} s" if unit != "1" else "s"
    return Reduction(word, (column,), f"{word}_{name}", unit, _PLAIN[word] + long_name)


def _samples(signals: SignalNames, signal: str, rate: str = "1 kHz") -> Reduction:
    column, name, unit, long_name = signals.meaning(signal)
    return Reduction("samples", (column,), name, unit, long_name, rate_hz=positive(rate, "1/s", RATE))


def _time_when(signals: SignalNames, condition: str) -> Reduction:
    found = _CONDITION.fullmatch(condition)
    if found is None:
        raise CommandError.of("ensemble.condition", text=condition)
    signal, sign, text = found.groups()
    column, name, unit, long_name = signals.meaning(signal)
    side = "above" if sign == ">" else "below"
    about = f"first time at which {long_name.partition(',')[0]} {sign} {text}"
    if "pressure" in name and unit not in ("", "1"):
        with naming("outputs"):
            pressure = units.parse_pressure(text)
        if pressure.gauge:
            what = f'outputs: "{text}" is a gauge pressure'
            raise CommandError(what, rule="an absolute pressure", remedy="Write abs.")
        level = pressure.value_pa
    else:
        level = number_of(text, unit, "outputs: level")
    return Reduction("time_when", (column,), f"time_{name}_{side}", "s", about, level, above=sign == ">")


def _stroke_time(signals: SignalNames) -> Reduction:
    if signals.towards_b is None:
        raise CommandError.of("ensemble.stroke_time")
    end, level = ("b", TOUCH_N) if signals.towards_b else ("a", -TOUCH_N)
    about = f"time from the start until the piston first touches the end of chamber {end}"
    column = signals.meaning("end_stop_force")[0]
    return Reduction("time_when", (column,), "stroke_time", "s", about, level, above=signals.towards_b)


def _settling(signals: SignalNames, signal: str, band: str, rate: str = "1 kHz") -> Reduction:
    column, name, unit, long_name = signals.meaning(signal)
    half = number_of(band, unit, "outputs: band")
    if unit == "K":
        half -= units.parse(f"0 {band.strip().partition(' ')[2]}", unit)  # a band is a difference: 5 degC are 5 K
    if not half > 0.0:
        raise CommandError(f"outputs: settling({signal}, {band}) has no valid band", rule="a half width greater than 0")
    about = f"time after which it stays within {band} of its final value: {long_name}"
    function = partial(_settled, half)
    rate_hz = positive(rate, "1/s", RATE)
    return Reduction("own", (column,), f"settling_time_{name}", "s", about, half, rate_hz, function=function)


def _settled(half: float, signals: Columns, times: Array) -> Array:
    """Return the time at which a signal finally enters the band around its last value, by linear interpolation."""
    (x,) = signals.values()
    away = np.abs(x - x[:, -1:])
    beyond = away > half
    last = beyond.shape[1] - 1 - beyond[:, ::-1].argmax(axis=1)
    first = np.minimum(last + 1, x.shape[1] - 1)
    rows = np.arange(len(x))
    before, after = away[rows, last], away[rows, first]
    with np.errstate(invalid="ignore", divide="ignore"):
        crossed = times[last] + (times[first] - times[last]) * (before - half) / (before - after)
    return np.where(beyond.any(axis=1), crossed, 0.0)


#: Word of an output -> least and largest number of arguments, and function that reads them.
WORDS: dict[str, tuple[int, int, Callable[..., Reduction]]] = {
    **{word: (1, 1, partial(_plain, word)) for word in _PLAIN},
    "time_when": (1, 1, _time_when),
    "settling": (2, 3, _settling),
    "samples": (1, 2, _samples),
    "stroke_time": (0, 0, _stroke_time),
}


def read_output(text: str, signals: SignalNames) -> Reduction:
    """Read an output, such as ``"final(position)"``. A name may precede it, ``"top = max(velocity)"``.

    Other forms are ``"time_when(position > 0.45 m)"`` and ``"stroke_time"``; see `pneudrive.simulate_many`.

    Raises
    ------
    CommandError
        The output is unknown, the number of arguments is wrong, or a signal or a quantity is not valid.

    Examples
    --------
    >>> read_output("top = max(velocity)", SignalNames(["velocity_m_s"])).name
    'top'
    """
    name, equals, call = text.partition("=")
    name, call = (name.strip(), call) if equals and "(" not in name else ("", text)
    called = _CALL.fullmatch(call)
    word = called[1] if called else call.strip()
    if word not in WORDS:
        raise CommandError(f'outputs: "{text.strip()}" is not an output', remedy=nearest(word, WORDS))
    arguments = [one.strip() for one in called[2].split(",") if one.strip()] if called else []
    least, most, read = WORDS[word]
    if not least <= len(arguments) <= most:
        raise CommandError(f'outputs: "{text.strip()}" has {len(arguments)} arguments', rule=f"at most {most}")
    made = read(signals, *arguments)
    return replace(made, name=name) if name else made


def reductions(asked: Sequence[str | Output] | None, signals: SignalNames) -> tuple[Reduction, ...]:
    """Return the outputs of each run.

    Parameters
    ----------
    asked : sequence of str or Output, optional
        Default: the state at the end and the stroke time.
    signals : SignalNames
        Signals of the drive.

    Raises
    ------
    CommandError
        An output is not valid, two outputs have the same name, or samples have different rates.
    """
    if asked is None:
        asked = [f"final({signal})" for signal in signals.states]
        asked += ["stroke_time"] if signals.towards_b is not None else []
    each = [asked] if isinstance(asked, str | Output) else asked
    made = tuple(one.of(signals) if isinstance(one, Output) else read_output(one, signals) for one in each)
    names = [one.name for one in made]
    for name in names:
        if names.count(name) > 1:
            raise CommandError(f"outputs: two outputs have the name {name}", remedy='Rename one: "NAME = ...".')
    if not made:
        raise CommandError("outputs is empty", remedy='Name an output, for instance "final(position)".')
    if len({one.rate_hz for one in made if one.word == "samples"}) > 1:
        raise CommandError("outputs: samples(...) have different rates", rule="all samples(...) need the same rate")
    return made
