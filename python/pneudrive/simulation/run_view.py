"""Values of a simulated run: strokes, impacts, gas, peak pressures, positions."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from pneudrive.arrays import Keyed
from pneudrive.constants import ANR_DENSITY_KG_M3
from pneudrive.errors import is_severe
from pneudrive.simulation.start import DriveOrCircuit
from pneudrive.simulation.trajectory import TABLE, meaning
from pneudrive.views import Finding, ShownValue, State, View

#: Columns of the flow into a chamber, of a drive and of a circuit.
_CHAMBER_FLOW = re.compile(r"(mass_flow_[ab]|.+\.[ab]\.mass_flow)_kg_s")
LITRE = 1e-3  # m3
MOST_APART = 0.03  # the gas is shown if every second sample gives the same amount within this fraction
MOST_STROKES = 2  # stroke times among the leading values


def run_view(columns: Keyed, provenance: Keyed, described: DriveOrCircuit | None = None) -> View:
    """Return the view of a run without its figures.

    Parameters
    ----------
    columns : mapping
        Name of a column in a file -> array in SI.
    provenance : mapping
        Attributes of the run; empty for a run from a CSV file.
    described : Drive or Circuit, optional
        Simulated drive or circuit, whose gas defines the volume at the reference atmosphere (ANR). Default: air.
    """
    import numpy as np

    time, steps = columns["time_s"], (provenance.get("statistics") or {}).get("steps")
    title = f"{provenance.get('title', 'run')}: {len(time)} samples to {time[-1]:g} s"
    impacts: list[Keyed] = list(provenance.get("impacts") or ())
    findings = [Finding(text, "bad" if is_severe(text) else "open") for text in provenance.get("warnings") or ()]
    state: State = "bad" if any(finding.state == "bad" for finding in findings) else "good"
    flows = [values for name, values in columns.items() if _CHAMBER_FLOW.fullmatch(name)]
    density = ANR_DENSITY_KG_M3 if described is None else described.gas.anr_density_kg_m3
    litres, coarse = (
        sum(float(np.trapezoid(np.maximum(flow[::nth], 0.0), time[::nth])) for flow in flows) / density / LITRE
        for nth in (1, 2)
    )
    amount = litres if abs(litres - coarse) <= MOST_APART * litres else "not resolved by the samples: use --energy"
    air = ShownValue("air", "all chambers", f"{'air' if described is None else 'gas'} into chambers, l ANR", amount)
    labels = {column: meaning(column) for column in columns}
    peaks = [
        ShownValue(f"{name}.peak", name, "peak pressure, absolute", float(columns[column].max()), "Pa")
        for column, (name, unit, _) in labels.items()
        if unit == "Pa"
    ]
    begun = [_begun(provenance, impact) for impact in impacts]
    backwards = zip(begun[::-1], impacts[::-1], strict=True)  # the first impact of a stroke counts
    of_stroke = {at: hit for at, hit in backwards if at is not None}
    leading = [
        ShownValue(
            f"stroke time {number}", "run", f"stroke time, to the end of chamber {hit['end']}", hit["time_s"] - at, "s"
        )
        for number, (at, hit) in enumerate(sorted(of_stroke.items())[:MOST_STROKES], start=1)
    ]
    if impacts:
        hardest = max(impact["energy_j"] for impact in impacts)
        leading.append(ShownValue("hardest impact", "run", "hardest impact", hardest, "J", state=state))
    if peaks:
        peak = max(float(each.value) for each in peaks)
        leading.append(ShownValue("peak pressure", "run", "peak pressure, absolute", peak, "Pa"))
    return View(
        title if steps is None else f"{title}, {steps} steps of the solver",
        (*_positions(columns), *_impacts(impacts, begun), *peaks, air),
        state=state,
        leading=(*leading, *([air] if flows else [])),
        findings=findings,
    )


def _begun(provenance: Keyed, impact: Keyed) -> float | None:
    """Return the time in s of the command towards the struck end, if no reversal follows before the impact.

    Without such a command, return the time at which the command becomes 0, as before a return by a spring, or None.
    """
    sign = 1.0 if impact["end"] == "b" else -1.0
    begun, before = None, -1.0
    for at, value in provenance.get("command_steps") or ():
        towards = sign * value
        if at <= impact["time_s"] and not before > 0.0 <= towards:
            begun = float(at) if towards >= 0.0 else None
        before = towards
    return begun


def _positions(columns: Keyed) -> Iterator[ShownValue]:
    for column, x in columns.items():
        if column.rpartition(".")[2] == "position_m":
            label = meaning(column)[0]
            ends = {"start": x[0], "end": x[-1], "lowest": x.min(), "highest": x.max()}
            for name, value in ends.items():
                yield ShownValue(f"{label}.{name}", label, name, f"{1e3 * value:.3f} mm")


def _impacts(impacts: list[Keyed], begun: Sequence[float | None]) -> Iterator[ShownValue]:
    for number, (impact, at) in enumerate(zip(impacts, begun, strict=True), start=1):
        label = f"impact {number}" + (f", {impact['cylinder']}" if impact.get("cylinder") else "")
        values = {**impact, "stroke_time_s": None if at is None else impact["time_s"] - at}
        for key, (name, unit) in TABLE["impact"].items():
            if values[key] is not None:
                yield ShownValue(f"{label}.{name}", label, name, values[key], unit)
