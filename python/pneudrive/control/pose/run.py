"""A platform under control along a path of its pose: one controller for each leg, one run, one score."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import _core, units
from pneudrive.control.axis import supply_of
from pneudrive.control.loop import MEANINGS, MOST_SEED, RTOL, provenance_of, whole_number
from pneudrive.control.mismatch import mismatched, read_mismatch
from pneudrive.control.pose.legs import check_path, demands, leg_reference, leg_tunings
from pneudrive.control.pose.path import PoseScore, Tracked, pose_path
from pneudrive.control.results.measures import LAST_S, air_of
from pneudrive.control.setup import read_setup, told
from pneudrive.describe.system import compiled
from pneudrive.errors import CommandError, SimulationError
from pneudrive.files.inputs import INPUTS, inputs_of
from pneudrive.platforms import platform as platform_of
from pneudrive.platforms.kinematics import pose_columns
from pneudrive.progress import Watch
from pneudrive.simulation.simulate import Run, positive
from pneudrive.simulation.start import check_tolerance

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.control.mismatch import Mismatch
    from pneudrive.control.pose.legs import Demands
    from pneudrive.control.pose.path import PosePath
    from pneudrive.control.setup import Setup
    from pneudrive.control.tuning import Controller, Tuning
    from pneudrive.describe.circuit import Circuit
    from pneudrive.platforms import Platform
    from pneudrive.progress import Flag

    Array = NDArray[np.float64]

#: Draws of one leg of one seed of a spread.
LEGS = 64
#: Columns of each leg that are kept, and their names behind that of the leg.
KEPT = ("position_m", "velocity_m_s", "reference_m", "disturbance_n", "holds")


def run_pose(
    circuit: Circuit,
    law: str | None = None,
    *,
    reference: PosePath | Mapping[str, str] | str | Path,
    setup: Setup | str | Path = "real",
    duration: str | float | None = None,
    seed: int = 1,
    controller: Controller | str | Path | None = None,
    payload: str | Sequence[str] | None = None,
    mismatch: Mismatch | str | Path | None = None,
    dynamics: str = "full",
    rtol: float = RTOL,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Run a platform under control along a path of its pose. Simulated: controllers and platform share equations.

    Each leg has its own controller. The path gives it position, velocity, acceleration and jerk of its leg. The inverse
    dynamics of the described platform give it moving mass, load and rate of the load.

    Parameters
    ----------
    circuit : Circuit
        With one platform, and a cylinder with valves at each leg.
    law : str, optional
        Of `pneudrive.control.laws`; the default is ``"nmpc"``.
    reference : PosePath, mapping, str or path-like
        See `pneudrive.control.pose.pose_path`.
    setup, duration, controller, rtol, progress, cancel : optional
        See `pneudrive.control.run`.
    seed : int
        Seed of all noise, and of the draws of a mismatch with ranges.
    payload : str or sequence of str, optional
        Mass at ``payload_at`` of the platform that no controller knows, ``"2 kg"``. Each of several payloads is run.
        The dataset is that of the first one, and the score has the spread.
    mismatch : Mismatch, str or path-like, optional
        Deviation of each leg from its description. Ranges are drawn for each leg.
    dynamics : str
        ``"full"``, or ``"constant"``: mass and load of a leg stay those at the start of the path.

    Returns
    -------
    xarray.Dataset
        Dimension time; coordinates of the platform and of each leg with their references, pressures and commands, such
        as ``tripod.heave``, ``tripod.heave_reference``, ``leg_1.position``. Its ``attrs`` hold score (a dict, see
        `PoseScore`) and events of each leg.

    Raises
    ------
    CommandError
        An argument is not valid, or a leg cannot follow the path. The message names time, leg and margin.
    DescriptionError
        The path is not valid, or a leg has no cylinder with valves.
    SimulationError
        The run cannot continue.

    Examples
    --------
    >>> import pneudrive as pn
    >>> circuit = pn.Circuit.load("examples/tripod.toml")
    >>> run = pn.control.run_pose(circuit, "inversion", reference={"heave": "450 mm; 0.1 s: 455 mm in 0.3 s"})
    >>> run.attrs["score"]["stops_hit"]
    0
    """
    check_tolerance(rtol)
    seed = whole_number("seed", seed, 0, MOST_SEED)
    if dynamics not in ("full", "constant"):
        raise CommandError(f'dynamics = "{dynamics}"', rule='"full" or "constant"')
    platform = platform_of(circuit)
    path = pose_path(reference, platform)
    read, setup_name = read_setup(setup)
    seconds = path.duration_s if duration is None else positive(duration, "s", "duration")
    needs = demands(platform, path, seconds)
    tunings = leg_tunings(circuit, platform, needs, law, read, controller)
    margins = check_path(platform, tunings, needs)
    legs = _Legs(circuit, platform, path, needs, tunings, read, seconds, dynamics == "full")
    payloads = [payload] if payload is None or isinstance(payload, str) else list(payload)
    watch = Watch(progress, cancel)
    runs = [legs.run(own, mismatch, seed, rtol, watch) for own in payloads]
    scores = [legs.score(columns, mass_kg, margins) for columns, mass_kg, _ in runs]
    spread = {str(own): one.coordinates for own, one in zip(payloads, scores, strict=True)} if len(runs) > 1 else {}
    score = replace(scores[0], payload_spread=spread)
    columns, _, events = runs[0]
    shared = provenance_of(circuit, tunings[0], (read, setup_name), path.text, seed, rtol)
    provenance = shared | {
        "gains": {one.belief.name: {gain.key: gain.value for gain in one.gains} for one in tunings},
        "dynamics": dynamics,
        "payload": str(payloads[0] or ""),
        INPUTS: inputs_of(circuit),
        "score": score.to_dict(),
        "events": events,
    }
    return Run(columns, provenance, MEANINGS).dataset()


@dataclass(frozen=True)
class _Legs:
    """Platform and controllers along a path, ready to run."""

    circuit: Circuit
    platform: Platform
    path: PosePath
    needs: Demands
    tunings: list[Tuning]
    setup: Setup
    seconds: float
    is_full: bool

    def run(
        self, payload: str | None, mismatch: Mismatch | str | Path | None, seed: int, rtol: float, watch: Watch
    ) -> tuple[dict[str, Array], float, list[dict[str, Any]]]:
        """Return columns, mass of the drawn air, kg, and events of one run with a payload."""
        core_json = self._loaded(payload)
        ambient_pa, axes = self.circuit.ambient.pressure_pa, []
        start: dict[str, float] = {}
        for i, tuning in enumerate(self.tunings):
            setup = self.setup
            if mismatch is not None:
                own, _ = read_mismatch(mismatch)
                drawn = own.drawn(seed, i) if own.is_spread else {key: low for key, (low, _) in own.ranges.items()}
                if i > 0:  # the supply is one for all legs
                    drawn = {key: value for key, value in drawn.items() if not key.startswith("supply")}
                truth = mismatched(core_json, tuning.plant, setup, own, drawn)
                core_json, setup = truth.core_json, truth.setup
                start |= truth.start
            motion, efforts = leg_reference(self.needs, i, self.path.text)
            form = motion.core() | ({"efforts": efforts} if self.is_full else {})
            own_setup = setup.core(seed, ambient_pa) | {"step_repeats": 1, "member": i}
            axes.append((json.dumps(tuning.core()), json.dumps(form), json.dumps(own_setup)))
        outputs = [name for names in pose_columns(self.platform) for name in names]
        try:
            each, poses, mass_kg = _core.control_run(
                compiled(core_json),
                self._start() | start,
                axes,
                outputs,
                self.seconds,
                rtol,
                lambda t: watch.tell(t, self.seconds, "seconds simulated"),
                None,
            )
        except ValueError as error:
            raise CommandError(f"the run cannot begin: {error}") from None
        except RuntimeError as error:
            raise SimulationError(str(error)) from None
        columns = {"time_s": each[0]["time_s"]}
        columns |= {name: np.ascontiguousarray(poses[:, k]) for k, name in enumerate(outputs)}
        wanted = self.path.at(columns["time_s"])[0]
        for k, (key, unit) in enumerate(self._coordinates()):
            name = f"{self.platform.name}.{key}"
            columns[f"{name}_reference_{unit}"] = np.ascontiguousarray(wanted[:, k])
        events = []
        for i, (leg, tuning, own) in enumerate(zip(self.platform.legs, self.tunings, each, strict=True)):
            columns |= {f"{leg.name}.{key}": own[key] for key in KEPT}
            needed = np.interp(columns["time_s"], self.needs.times_s, self.needs.forces_n[:, i])
            columns[f"{leg.name}.required_force_n"] = needed
            columns |= {f"{leg.name}.{end}.pressure_pa": own[f"pressure_{end}_pa"] for end in "ab"}
            several = [name for name in tuning.plant.valves if f"{name}.command" in own]
            columns |= {f"{name}.command": own[f"{name}.command"] for name in several}
            columns |= {} if several else {f"{tuning.plant.valves[0]}.command": own["command"]}
            events += [{"leg": leg.name} | event for event in told(own["events"])]
        return columns, mass_kg, events

    def score(self, columns: Mapping[str, Array], mass_kg: float, margins: Mapping[str, float]) -> PoseScore:
        """Score a run."""
        time, period = columns["time_s"], self.path.period_s
        scored = time >= (0.0 if period is None else time[-1] - max(LAST_S, period) + 0.5 * time[1])

        def tracked(name: str, of: str, unit: str) -> Tracked:
            wanted = columns[f"{name}_{unit}" if of == name else f"{of}_{unit}"][scored]
            error = wanted - columns[f"{name}_{unit}"][scored]
            rmse, most = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
            return Tracked(unit, rmse, most, 0.5 * float(np.ptp(wanted)))

        own = self.platform.name
        legs = [leg.name for leg in self.platform.legs]
        reached = [columns[f"{leg.name}.position_m"] for leg in self.platform.legs]
        ends = zip(reached, self.platform.legs, strict=True)
        hit = [float(x.min()) <= 0.0 or float(x.max()) >= leg.stroke_m for x, leg in ends]
        commands = [columns[f"{valve}.command"] for tuning in self.tunings for valve in tuning.plant.valves]
        ambient = self.circuit.ambient
        gas = self.circuit.gas.heat_capacity_ratio, self.circuit.gas.gas_constant_j_kg_k
        supply = supply_of(self.tunings[0].belief.core_json())
        air = air_of(mass_kg, supply, (ambient.pressure_pa, ambient.temperature_k), gas)["anr_m3"] / self.seconds
        return PoseScore(
            coordinates={
                key: tracked(f"{own}.{key}", f"{own}.{key}_reference", unit) for key, unit in self._coordinates()
            },
            legs={leg: tracked(f"{leg}.position", f"{leg}.reference", "m") for leg in legs},
            air_per_cycle_anr_m3=None if period is None else air * period,
            air_anr_m3_s=air,
            saturated_share=max(float(np.mean(np.abs(command) >= 1.0)) for command in commands),
            stops_hit=int(sum(hit)),
            singular_value=margins["singular_value"],
            force_share=margins["force"],
            speed_share=margins["speed"],
            payload_spread={},
        )

    def _coordinates(self) -> list[tuple[str, str]]:
        return list(zip(self.platform.coordinates, self.platform.units, strict=True))

    def _loaded(self, payload: str | None) -> str:
        """Return the circuit in the core's form with a payload that no controller knows."""
        form = json.loads(self.circuit.core_json())
        if payload is not None:
            numbers = next(one["numbers"] for one in form["components"] if one["name"] == self.platform.name)
            numbers["payload"] = numbers.get("payload", 0.0) + units.parse(payload, "kg")
        return json.dumps(form, sort_keys=True)

    def _start(self) -> dict[str, float]:
        """Return the start at rest on the path, each piston in balance."""
        given: dict[str, str] = {}
        for leg, tuning, x in zip(self.platform.legs, self.tunings, self.needs.positions_m[0], strict=True):
            given[f"{leg.name}.position"] = f"{float(x)!r} m"
            for end, pressure in zip("ab", tuning.plant.rest_pressures_pa, strict=True):
                given[f"{leg.name}.{end}.pressure"] = f"{pressure!r} Pa abs"
        return self.circuit.core_initial(given)
