"""Datasheet of a drive: results, headline numbers, values with their source, and comparison with recordings."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.constants import IMPACT_ENERGY_J_M2, USUAL_PEAK_PA
from pneudrive.datasheet.characteristics.air import NO_STROKES
from pneudrive.datasheet.measured import MeasuredBeside, beside
from pneudrive.datasheet.plant import LEAST_VELOCITY, LOCK, HeldDrive
from pneudrive.datasheet.registry import UncertainDrive, characteristics
from pneudrive.datasheet.stands import parts_of
from pneudrive.describe.drive import Drive
from pneudrive.describe.files import sourced, toml
from pneudrive.describe.system import DescribedValue, values_of
from pneudrive.errors import HAZARD, CommandError, PneudriveError, package_table
from pneudrive.lazy_names import upper
from pneudrive.numbers import plain
from pneudrive.simulation.simulate import number_of
from pneudrive.views import Finding, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence
    from pathlib import Path

    import xarray as xr

    from pneudrive.describe.circuit import Circuit
    from pneudrive.progress import Watch


# --- Units and names of results in readable form.

NARROWEST = 1e-6  # relative width of an interval that is not shown: rounding
#: SI unit -> size below which a number is displayed as 0; 1e-9 for others. 1/s: solver error of a relative leakage.
ROUNDING = {"1/s": 1e-6}
#: SI unit -> factor and displayed unit.
SHOWN_UNITS = {
    "Pa": (1e-5, "bar"),
    "m": (1e3, "mm"),
    "m3/(s Pa)": (1e8, "dm3/(s bar)"),
}


def shown_unit(unit: str) -> tuple[float, str]:
    """Return the factor to the displayed unit of a result, and the displayed unit."""
    return SHOWN_UNITS.get(unit, (1.0, unit))


def in_words(name: str) -> str:
    """Return the name of a variable as words."""
    return name.replace("_", " ")


def written_value(value: float, unit: str, low: float | None = None, high: float | None = None) -> str:
    """Write a value with its unit, and its interval if it has one.

    Examples
    --------
    >>> written_value(5.3005e5, "Pa"), written_value(0.209, "s", 0.2, 0.215), written_value(math.nan, "s")
    ('5.30 bar', '0.209 s (0.200 .. 0.215)', 'none')
    """
    factor, shown = shown_unit(unit)
    if not math.isfinite(value):
        return "none" if math.isnan(value) else "infinite"
    text = f"{plain(factor * value)}{'' if shown == '1' else f' {shown}'}"
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return text
    ends = [plain(factor * end) for end in (low, high)]
    narrow = ends[0] == ends[1] or high - low <= NARROWEST * max(abs(value), 1e-6)
    return text if narrow else f"{text} ({ends[0]} .. {ends[1]})"


#: Characteristics of a sheet, in the order of display.
OF_A_SHEET: tuple[str, ...] = tuple(package_table(__file__, "sheet.toml")["characteristics"])


class SheetNumber(NamedTuple):
    """A headline number with its values for both strokes, or a single value in `out`, and its standard."""

    name: str
    out: str
    back: str
    standard: str


@dataclass(frozen=True, eq=False, repr=False)
class Datasheet(Viewed):
    """Content of a datasheet.

    Attributes
    ----------
    drive : Drive or Circuit
    stroke_m, supply_pa : float
        Stroke of the piston, and absolute pressure of the supply.
    results : dict
        Characteristic -> data set.
    failed : dict
        Characteristic -> reason why it cannot be computed for the drive.
    measured : MeasuredBeside or None
    hazards : tuple of Finding
        Findings that endanger people or the machine.
    """

    drive: Drive | Circuit
    stroke_m: float
    supply_pa: float
    results: dict[str, xr.Dataset]
    failed: dict[str, str]
    measured: MeasuredBeside | None
    hazards: tuple[Finding, ...] = ()

    @cached_property
    def numbers(self) -> list[SheetNumber]:
        """Headline numbers, and the service life that is stated for the drive or its parts."""
        results, known = self.results, characteristics()
        out = []
        for name, headlines in package_table(__file__, "sheet.toml")["headlines"].items():
            found: Any = results.get(name, {})
            for title, result in headlines.items():
                if result in found:
                    places = (dict(zip(found[result].dims, at, strict=True)) for at in np.ndindex(found[result].shape))
                    first, *others = (shown(found, result, place) for place in places)
                    out.append(SheetNumber(title, first, others[0] if others else "", known[name].standard))
        for name, result in (("stiffness", "adiabatic_stiffness"), ("natural-frequency", "natural_frequency")):
            if name in results:  # at mid stroke and at one of the pressures
                found = results[name]
                at = {"position": found.sizes["position"] // 2, "pressure": min(1, found.sizes["pressure"] - 1)}
                bar = 1e-5 * found.pressure[at["pressure"]]
                title = f"{in_words(result)}, mid stroke, {bar:g} bar abs"
                out.append(SheetNumber(title, shown(found, result, at), "", ""))
        if "flow" in results:
            found = results["flow"]
            for k, path in enumerate(found.path.values):
                c, b = (shown(found, name, {"path": k}) for name in ("conductance", "critical_ratio"))
                out.append(SheetNumber(f"C and b, {path}", f"{c}, b = {b}", "", known["flow"].standard))
        drive = self.drive
        lives = {"drive, by its label": drive.labels[LIFE]} if LIFE in drive.labels else {}
        for part in parts_of(drive) if isinstance(drive, Drive) else ():
            lives |= {f"{part.name} [{one.source}]": one.value for one in part.printed if one.key == LIFE}
        stated = {f"B10, stated: {whose}": f"{life} cycles" for whose, life in lives.items()} or {"B10": "not stated"}
        return out + [SheetNumber(name, life, "", "ISO 19973") for name, life in stated.items()]

    @property
    def values(self) -> list[DescribedValue]:
        """Each value that the drive states, as written, with its source."""
        drive = self.drive
        written = {key for key, _ in toml.leaves(sourced.parted(drive.to_dict())[0])}
        identified: Any = getattr(drive, "provenance", None) or {}
        out = []
        for one in values_of(drive):
            if one.key in written:
                origin = one.origin or "given"
                text = f"{one.value:g}" if isinstance(one.value, float) else str(one.value)
                if one.key in identified:
                    known = identified[one.key]
                    ends = f"{known.interval[0]} .. {known.interval[1]} ({100 * known.confidence:g} %)"
                    origin = f"identified: {ends}, {known.source}"
                out.append(one._replace(value="table" if isinstance(one.value, np.ndarray) else text, origin=origin))
        return out

    @property
    def assumed(self) -> list[str]:
        """Assumptions that are not in the drive file."""
        written = {key.removeprefix("components.") for key in self.drive.origin_of}
        return [line for line in self.drive.assumed() if line.partition(" = ")[0] not in written]

    @property
    def findings(self) -> list[Finding]:
        """Hazards, and outcomes of the comparison with recordings."""
        return [*self.hazards, *(self.measured.findings if self.measured else ())]

    @property
    def notes(self) -> list[str]:
        """Sentences on stroke, impact and air of a cycle."""
        at, lines = {number.name: number for number in self.numbers}, []
        if "stroke time" in at:
            time, where = at["stroke time"], f"{plain(1e-5 * self.supply_pa)} bar abs"
            stroke = f"Stroke of {1e3 * self.stroke_m:g} mm at {where} and full command"
            if "none" in (time.out, time.back):
                lines.append(f"{stroke}: the piston does not go from end to end and back.")
            else:
                half, rest = shown(self.results["square-response"], "half_period", {}), ""
                if "impact" in self.results:  # single strokes at full command
                    places = ({"command": -1, "direction": k} for k in (0, 1))
                    out, back = (shown(self.results["impact"], "stroke_time", place) for place in places)
                    rest = f"; from rest {out} out, {back} back"
                lines.append(f"{stroke}: {time.out} out, {time.back} back in a periodic cycle of 2 x {half}{rest}.")
        if "end energy" in at and "none" not in (at["end energy"].out, at["end energy"].back):
            energy, speed = at["end energy"], at["end speed"]
            lines.append(f"Impact: {energy.out} at {speed.out} out, {energy.back} at {speed.back} back.")
        if "air per full cycle" in at:
            fast = f"{at['air per fast cycle'].out} in a cycle of 2 x {shown(self.results['air'], 'half_period', {})}"
            full = f"{at['air per full cycle'].out} per cycle that fills and vents the chambers"
            lines.append(f"Air: {full} (2 x {shown(self.results['air'], 'full_half_period', {})}), {fast}.")
        if self.measured is None:
            lines.append("No recording confirms these numbers: they are simulated from the values below.")
        return lines

    def view(self) -> View:
        """Return hazards, leading numbers, tables and curves; see `pneudrive.report.datasheet.sheet_view`."""
        return upper("sheet_view")(self)


#: Label of a drive, and printed figure of a part: number of cycles that 90 % of the units survive.
LIFE = "b10_cycles"


def build(
    drive: Drive | Circuit, recordings: Sequence[Path], layout: Path | None, watch: Watch, *, intervals: bool = True
) -> Datasheet:
    """Compute the content of a datasheet.

    Raises
    ------
    CommandError
        The circuit does not have exactly one piston with valves, or recordings are given for a circuit.
    RecordingError, LayoutError
        A recording cannot be used.
    Cancelled
        The watch requests a stop.
    """
    if recordings and not isinstance(drive, Drive):
        raise CommandError.of("datasheet.circuit", name=drive.name)
    uncertain = UncertainDrive(drive)
    plant = uncertain.plant
    measured = beside(drive, recordings, layout, watch) if isinstance(drive, Drive) and recordings else None
    results: dict[str, xr.Dataset] = {}
    failed: dict[str, str] = {}
    for name in watch.each(OF_A_SHEET, "characteristics"):
        try:
            results[name] = uncertain.characteristic(name, intervals=intervals)
        except PneudriveError as error:  # noqa: PERF203 - a characteristic takes seconds
            failed[name] = error.what
    return Datasheet(drive, plant.stroke_m, plant.supply_pa, results, failed, measured, tuple(_hazards(plant, results)))


def _hazards(plant: HeldDrive, results: dict[str, xr.Dataset]) -> Iterator[Finding]:
    """Yield the findings on the load at loss of pressure, on impacts and on pressure peaks."""
    ambient = plant.ambient[0]
    labels, locks = plant.described.labels, plant.sum_of(LOCK, "holding_force")
    locks += number_of(labels.get("clamp_force", "0 N"), "N", "labels.clamp_force")
    holds = locks + abs(plant.sliding(LEAST_VELOCITY, (ambient, ambient), plant.middle_m))
    if plant.hanging_n > locks and labels.get("held_by") != "machine":
        text = f"{HAZARD}without pressure, weight and load pull the piston with {plain(plant.hanging_n)} N, but"
        remedy = "A lock or a clamp must hold the load (ISO 4414)."
        # The friction without pressure is known if its dependence on pressure is stated, and neither is assumed.
        is_stated = bool(plant.frictions.get(plant.piston, {}).get("pressure"))
        origins = plant.described.origin_of.items()
        friction = [one for key, one in origins if "friction.coulomb" in key or "friction.pressure" in key]
        if plant.hanging_n > holds:
            yield Finding(f"{text} friction at rest and locks hold only {plain(holds)} N.", "bad", remedy)
        elif not (is_stated and all(one.assumed is None for one in friction)):
            why = "no measurement shows how much friction remains without pressure"
            yield Finding(f"{text} locks hold only {plain(locks)} N: the rest is friction, and {why}.", "open", remedy)
    limit = energy_limit_j(plant)
    response = results.get("square-response")
    if response is None:
        return
    if response.stroke_time.isnull().any():
        yield Finding(f"{HAZARD}{NO_STROKES}.", "bad", "Raise supply.pressure, or take a larger bore.")
    energy = float(response.end_energy.max())
    if energy > limit:
        rule = "that a cylinder of this bore usually takes"
        rule += f" (assumed: {1e-3 * IMPACT_ENERGY_J_M2:g} mJ for each mm2 of piston)"
        rule = "of labels.impact_energy" if "impact_energy" in labels else rule
        text = f"{HAZARD}the impact energy of {plain(energy)} J exceeds the {plain(limit)} J {rule}."
        yield Finding(text, "bad", "Brake before the end, or add a shock absorber.")
    peak = float(response[["peak_pressure_a", "peak_pressure_b"]].to_array().max())
    most = USUAL_PEAK_PA + ambient
    if peak > most:
        text = (
            f"the pressure in a chamber rises to {plain(1e-5 * peak)} bar abs, above the {plain(1e-5 * most)} bar abs"
        )
        rule = "that usual cylinders withstand (assumed: 1.5 times their usual limit of 10 bar gauge)"
        yield Finding(f"{HAZARD}{text} {rule}.", "bad", "Open the needle of the cushion, or brake earlier.")


def energy_limit_j(plant: HeldDrive) -> float:
    """Return the largest admissible energy (J) of an impact: the label `impact_energy`, or an assumed value by bore."""
    stated = plant.described.labels.get("impact_energy")
    if stated is not None:
        return number_of(stated, "J", "labels.impact_energy")
    return IMPACT_ENERGY_J_M2 * 0.25 * math.pi * float(plant.cylinder.bore) ** 2


def shown(found: xr.Dataset, name: str, at: Mapping[Any, int]) -> str:
    """Return one number of a result with its unit and interval."""
    unit, every = found[name].attrs["units"], (f"{name}{end}" for end in ("", "_low", "_high"))
    least = ROUNDING.get(unit, 1e-9) / shown_unit(unit)[0]
    known = (float(found[one].isel(at)) if one in found else math.nan for one in every)
    value, *ends = (0.0 if abs(one) < least else one for one in known)
    return written_value(value, unit, *ends)
