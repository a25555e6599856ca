"""A drive under a learner's control, as an environment of Gymnasium: ``pneudrive/Position-v0``. Extra ``gym``."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium import spaces

from pneudrive import _core, units
from pneudrive.control.controller import Controller
from pneudrive.control.loop import MOST_SEED, Prepared, prepare
from pneudrive.control.mismatch import Mismatch, mismatched, read_mismatch
from pneudrive.control.motion import Reference
from pneudrive.control.own_law import OWN, check_inputs, is_own, signals
from pneudrive.control.paths import PEAK
from pneudrive.control.references import reference
from pneudrive.control.setup import Setup, read_setup
from pneudrive.control.tuning import tune
from pneudrive.describe.drive import Drive
from pneudrive.describe.system import compiled
from pneudrive.errors import CommandError, warn
from pneudrive.simulation.simulate import positive

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit

    Described = Drive | Circuit

ID = "pneudrive/Position-v0"
#: Of an episode without a reference of its own (assumed): moves to places within this share of the stroke, by this
#: share of the drive's speed at most, each followed by a rest, s.
WITHIN, FASTEST, REST_S = (0.1, 0.9), (0.1, 0.5), (0.1, 0.5)


class _Learner:
    """Placeholder for a law: the environment receives each command."""

    inputs = ()

    def step(self, *_: object) -> float:
        return float("nan")


class PositionEnv(gymnasium.Env):
    """A piston that follows a reference. The action is the command of the valve, -1 .. 1, at each sample.

    An observation is the numbers of `observed`, then position and velocity of the reference now and at times ahead.
    `observed` names signals of custom laws (`pneudrive.control.signals`). SI units, pressures absolute; the
    names end in their unit. The reward of a sample is minus the true error in mm. An episode is terminated if the
    error is beyond `lost` or the drive cannot move further, and truncated after its duration.

    Parameters
    ----------
    drive : Drive or Circuit, optional
        By default ``catalogue:reference``.
    reference : str, Reference or path-like, optional
        As `pneudrive.control.reference` reads it; by default moves that are drawn anew for each episode.
    setup : Setup, str or path-like
        What stands between drive and command.
    period, duration, lost : str or float
        Time between two samples, time of an episode, and error at which a drive is lost.
    inputs : sequence of str
        Signals that are observed.
    ahead : sequence of str or float
        Times ahead at which the reference is observed; numbers are in s.
    spread : Mismatch, str, path-like or callable, optional
        The drive of an episode, where laws and observer believe in `drive`: ``"standard"`` or a TOML file with ranges
        as for `pneudrive.control.benchmark`, of which each reset draws a member that is in no comparison;
        ``"mass+30"``, ..., the same for each episode; or ``spread(drive, random)``, which returns it; `random` is a
        ``numpy.random.Generator``.
        `reset` tells what was drawn as ``info["truth"]``.
    law : str, optional
        A law that runs beside: its command is `law_command`, for `ResidualCommand`.
    reward : callable, optional
        ``reward(info)`` in place of minus the error in mm.

    Examples
    --------
    >>> import gymnasium
    >>> env = gymnasium.make("pneudrive.control.environment:pneudrive/Position-v0", duration="50 ms")
    >>> first, info = env.reset(seed=1)
    >>> env.unwrapped.observed[:2], first.shape
    (('position_m', 'velocity_m_s'), (10,))
    """

    #: Units are those of the names of `observed`; the action is the command of the valve, -1 .. 1.
    metadata: dict[str, Any] = {"render_modes": [], "units": "SI, in the names of observed"}  # noqa: RUF012 - as Env

    def __init__(
        self,
        drive: Described | None = None,
        *,
        reference: str | Reference | Path | None = None,
        setup: Setup | str | Path = "real",
        period: str | float = "1 ms",
        duration: str | float = "3 s",
        lost: str | float = "50 mm",
        inputs: Sequence[str] = ("position", "velocity", "pressure_a", "pressure_b"),
        ahead: Sequence[str | float] = (0.0, 0.01, 0.03),
        spread: Mismatch | str | Path | Callable[[Described, np.random.Generator], Described] | None = None,
        law: str | None = None,
        reward: Callable[[dict[str, Any]], float] | None = None,
    ) -> None:
        known = signals()
        self.drive = Drive.load("catalogue:reference") if drive is None else drive
        self.inputs, self.ahead = tuple(check_inputs(ID, inputs)), _times(ahead)
        self.spread = spread if spread is None or callable(spread) else read_mismatch(spread)[0]
        self.duration_s, self.lost_m = positive(duration, "s", "duration"), positive(lost, "m", "lost")
        self._reference, self._reward = reference, reward
        self._setup, _ = read_setup(setup)
        if law is not None and is_own(law):
            what = f"the law {law!r} is code, which cannot run beside the action"
            raise CommandError(what, remedy='Name a law of pneudrive: law="pid".')
        self._law: Any = _Learner() if law is None else law
        told = {"law": OWN if law is None else law, "period": f"{positive(period, 's', 'period')!r} s"}
        self._controller = Controller.model_validate(told)
        #: Command of the law that runs beside, at the sample that waits for an action; not a number without a law.
        self.law_command = float("nan")
        # Initial data of an episode without drive and reference. Wrong arguments are rejected here.
        self._first = self._prepare(self.drive, self._middle() if reference is None else reference)
        self._prepared = self._first
        for late in self._true(self._first, np.random.default_rng(0)).truth.setup.later_than(self.duration_s):
            warn(late)
        self.observed = (
            *(units.column_name(name, known[name][0]) for name in self.inputs),
            *(f"reference_{1e3 * t:g}_ms_{what}" for t in self.ahead for what in ("m", "m_s")),
        )
        self.observation_space = spaces.Box(-np.inf, np.inf, (len(self.observed),), np.float64)
        self.action_space = spaces.Box(-1.0, 1.0, (1,), np.float64)
        self._loop: _core.ControlLoop | None = None

    def _prepare(self, drive: Described, along: str | Reference | Path) -> Prepared:
        law = self._law if isinstance(self._law, _Learner) else None
        told = {"setup": self._setup, "duration": self.duration_s, "believes": self.drive}
        return prepare(drive, law, along, controller=self._controller, **told)

    def _middle(self) -> Reference:
        """Return a placeholder for a random reference: at rest at mid-stroke."""
        return Reference("mid stroke", 0.5 * tune(self.drive, setup=self._setup).plant.stroke_m)

    def _true(self, prepared: Prepared, random: np.random.Generator) -> Prepared:
        """Draw the drive of an episode from the spread. Comparisons draw with seed 0, members from 1 on."""
        if not isinstance(self.spread, Mismatch):
            return prepared
        drawn = self.spread.drawn(int(random.integers(1, MOST_SEED)), 0)
        core_json, plant = prepared.circuit.core_json(), prepared.plant
        return prepared._replace(truth=mismatched(core_json, plant, prepared.setup, self.spread, drawn))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Begin an episode; `options` may hold a reference for it. Equal seeds give equal bits."""
        super().reset(seed=seed)
        options = options or {}
        if options.keys() - {"reference"}:
            raise CommandError(f"options = {options!r}", rule="the one option of an episode is reference")
        along = options.get("reference", self._reference)
        if along is None:
            along = self._drawn()
        drive = self.spread(self.drive, self.np_random) if callable(self.spread) else self.drive
        same = drive is self.drive and along is self._reference
        prepared = self._prepared = self._true(self._first if same else self._prepare(drive, along), self.np_random)
        motion, truth = prepared.reference.core(), prepared.truth
        noise = truth.setup.core(int(self.np_random.integers(MOST_SEED)), prepared.circuit.ambient.pressure_pa)
        try:
            self._loop = _core.ControlLoop(
                compiled(truth.core_json),
                prepared.start | truth.start,
                json.dumps(prepared.tuning.core()),
                json.dumps(motion),
                json.dumps(noise),
                prepared.duration_s,
                prepared.rtol,
                list(self.inputs),
            )
        except ValueError as error:
            raise CommandError(f"the episode cannot begin: {error}") from None
        self._at = _core.ControlReference(json.dumps(motion)).at
        self._tick, self._last = 0, round(prepared.duration_s / prepared.tuning.period_s)
        observation, info = self._observe()
        return observation, info | {"reference": prepared.reference.text, "truth": dict(truth.values)}

    def step(self, action: Any) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:  # noqa: ANN401
        """Give the command and advance to the next sample.

        Raises
        ------
        CommandError
            The action is not one finite number, or no episode goes on.
        """
        if self._loop is None:
            raise CommandError("no episode goes on", remedy="Call reset first.")
        command = _command(action)
        try:
            self._loop.give(min(max(command, -1.0), 1.0))
            self._tick += 1
            observation, info = self._observe()
        except RuntimeError as error:
            self._loop = None
            nowhere = np.zeros(self.observation_space.shape or ())
            return nowhere, -1e3 * self.lost_m, True, False, {"reason": str(error)}
        lost = abs(info["error_m"]) > self.lost_m
        reward = -1e3 * abs(info["error_m"]) if self._reward is None else float(self._reward(info))
        return observation, reward, lost, self._tick >= self._last, info

    def columns(self) -> dict[str, NDArray[np.float64]]:
        """Return the columns of the episode so far, as a run of `pneudrive.control.run` has them, SI units."""
        return {} if self._loop is None else self._loop.columns()

    def _observe(self) -> tuple[NDArray[np.float64], dict[str, Any]]:
        assert self._loop is not None
        seen, truth = self._loop.observe(), self._loop.truth
        if seen is None or truth is None:
            raise CommandError("the episode is over", remedy="Call reset.")
        t = self._tick * self._prepared.tuning.period_s
        wanted = self._at(t)[0]
        *measured, self.law_command = seen
        for by in self.ahead:
            measured += self._at(t + by)[:2]
        info = {"time_s": t, "error_m": wanted - truth[0], "position_m": truth[0]}
        if not isinstance(self._law, _Learner):
            info["law_command"] = self.law_command
        return np.array(measured), info

    def _drawn(self) -> Reference:
        """Draw moves for an episode."""
        plant, draw = self._prepared.tuning.plant, self.np_random.uniform
        place = start = plant.stroke_m * draw(*WITHIN)
        moves, t = [], draw(*REST_S)
        while t < self.duration_s or not moves:
            to = plant.stroke_m * draw(*WITHIN)
            takes = max(PEAK * abs(to - place) / (plant.speed_m_s * draw(*FASTEST)), 0.05)
            moves.append(f"{t!r} s: {to!r} m in {takes!r} s")
            place, t = to, t + takes + draw(*REST_S)
        return reference("; ".join([f"{start!r} m", *moves]))


def _times(ahead: Sequence[str | float]) -> tuple[float, ...]:
    rule = "a sequence of finite times, from 0 s on"
    if isinstance(ahead, str) or not isinstance(ahead, Iterable):
        raise CommandError(f"ahead = {ahead!r} is no sequence", rule=rule, remedy='ahead=("0 s", "10 ms")')
    found = tuple(units.parse(one, "s") if isinstance(one, str) else float(one) for one in ahead)
    if not all(0.0 <= one < np.inf for one in found):
        raise CommandError(f"ahead = {ahead!r} is out of bounds", rule=rule)
    return found


def _command(action: Any) -> float:  # noqa: ANN401 - of any learner
    try:
        (command,) = np.asarray(action, dtype=float).reshape(-1)
    except (TypeError, ValueError):
        command = np.nan
    if not np.isfinite(command):
        raise CommandError(f"the action is {reprlib.repr(action)}", rule="one finite number, the command -1 .. 1")
    return float(command)


class ResidualCommand(gymnasium.ActionWrapper):
    """The action is added to the command of the law that runs in parallel: ``PositionEnv(law="pid")``.

    Parameters
    ----------
    env : Env
        A `PositionEnv` with a law.
    scale : float
        Share of the full command that an action of 1 adds.

    Raises
    ------
    CommandError
        The environment has no law.
    """

    def __init__(self, env: gymnasium.Env, scale: float = 0.2) -> None:
        super().__init__(env)
        inner = env.unwrapped
        if not isinstance(inner, PositionEnv) or isinstance(inner._law, _Learner):
            raise CommandError("a residual needs a law to add to", remedy='Make the environment with law="pid".')
        self._inner, self.scale = inner, scale

    def action(self, action: Any) -> NDArray[np.float64]:  # noqa: ANN401 - of any environment
        """Return the law's command with the residual."""
        return np.clip(self._inner.law_command + self.scale * np.asarray(action, dtype=float), -1.0, 1.0)


def register_envs() -> None:
    """Register the environment; Gymnasium calls it for installed packages."""
    if ID not in gymnasium.registry:
        gymnasium.register(id=ID, entry_point=f"{__name__}:PositionEnv")


register_envs()
