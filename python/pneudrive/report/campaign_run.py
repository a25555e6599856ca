"""What a campaign ran, what was left out of it, what its data carry, and where everything comes from."""

from __future__ import annotations

import platform
from collections import Counter
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__
from pneudrive.campaign.cycle import KINDS
from pneudrive.campaign.folder import Campaign
from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.errors import CampaignError
from pneudrive.report.campaign_curves import picture
from pneudrive.report.page import Items, Section, Table, Text
from pneudrive.report.provenance import PACKAGES, reference
from pneudrive.report.rig_diagram import rig_diagram
from pneudrive.report.words import FLAGS, plural
from pneudrive.rig.interface import Envelope

if TYPE_CHECKING:
    from pneudrive.characteristics import CampaignCharacteristics

MOST_LINES = 120  # of a protocol that is shown
MOST_SKIPPED = 40
METHODS = ("gum2008", "patterson1971", "wahba1983", "burnham2002", "kato1972", "dieterich1979", "armstrong1994")
#: What the flags of campaigns mean, beside those of recordings.
CAMPAIGN_FLAGS = FLAGS | {
    "time_backwards": "samples whose time runs backwards, left out",
    "undersampled": "a breakaway peak of too few samples",
    "no_peak": "the force still rises where the search for a peak ends",
    "pressure_transient": "the air moved as much as the result",
    "inertia": "the mass that breaks loose may add to the peak",
    "no_running": "nothing tells uninterrupted sliding",
    "stuck": "a channel stood still while the piston travelled",
    "slow_samples": "a peak sampled at less than 5 kHz",
    "long_loading": "the force took more than a tenth of the stop to rise",
    "duration": "the rest differs from the planned stop by more than 20 %",
    "reversed": "the restart reverses the approach",
    "by_motion": "the stop was found from motion, not from the steps",
}


def about_of(found: CampaignCharacteristics) -> dict[str, Any]:
    """Return what the campaign's folder says of itself; empty where it cannot be opened any more."""
    try:
        return Campaign.open(found.folder).about
    except CampaignError:
        return {}


def what(found: CampaignCharacteristics) -> Section:
    """Protocol, rig, operator, numbers of cycles."""
    about, rig = about_of(found), found.identity
    kinds = Counter(c.kind for c in found.cycles) + Counter({"stop": len(found.stops)})
    counts = ", ".join(f"{plural(n, kind)} ({KINDS.get(kind, kind)})" for kind, n in kinds.items())
    origin = (
        "A simulated rig made these data: every claim rests on its assumptions and is synthetic."
        if found.synthetic
        else "A real rig measured these data."
    )
    blocks: list = [
        Text(origin, "note" if found.synthetic else "plain"),
        Text(f"Cycles that were read: {counts or 'none'}."),
    ]
    envelope = _envelope(about)
    if envelope is not None:
        caption = "The rig as it states itself, not to scale, with signs and limits."
        blocks.append(picture(found, "campaign-rig", caption, rig_diagram(rig, envelope)))
    rows = [
        ("campaign", found.name),
        ("rig", rig.name),
        ("operator", str(about.get("operator") or "not told")),
        ("labels", ", ".join(f"{k} {v}" for k, v in {**rig.labels, **about.get("labels", {})}.items()) or "none"),
        ("created", str(about.get("created", "not told"))),
        ("seed of the order", str(about.get("seed", "not told"))),
        ("areas a, b", f"{1e4 * rig.area_a_m2:.4g} cm², {1e4 * rig.area_b_m2:.4g} cm²"),
        ("mass beyond the sensor", f"{rig.mass_beyond_sensor_kg:.3g} kg"),
        ("stiffness", f"{rig.stiffness_n_m:.3g} N/m" if rig.stiffness_n_m else "not told: stick-slip cannot be judged"),
        ("chambers", f"{rig.chambers}; pressure measured at the {rig.pressure_measured_at}"),
        ("ambient pressure", f"{rig.ambient_pressure_pa / 1e5:.4g} bar abs"),
        ("which samples count", found.protocol),
    ]
    blocks.append(Table(("", ""), tuple(rows), numbers_from=9))
    blocks.append(_ranges(found))
    blocks.append(_sensors(found))
    return Section("run", "What was run", tuple(blocks), synthetic=found.synthetic)


def _envelope(about: dict[str, Any]) -> Envelope | None:
    stated = about.get("envelope")
    if not isinstance(stated, dict):
        return None
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in stated.items()}
    try:
        return Envelope(**values)
    except TypeError:
        return None


def _ranges(found: CampaignCharacteristics) -> Table:
    r = found.ranges
    rows = (
        ("speed, mm/s", *(_or_none(1e3 * v, ".4g") for v in r.speed_m_s)),
        ("pressure a, bar gauge", *(_or_none(v / 1e5, ".3g") for v in r.gauge_a_pa)),
        ("pressure b, bar gauge", *(_or_none(v / 1e5, ".3g") for v in r.gauge_b_pa)),
        ("temperature, °C", *(_or_none(v - ZERO_CELSIUS_K, ".1f") for v in r.temperature_k)),
    )
    head = ("range of the sweeps", "lowest", "highest")
    return Table(head, rows, "Outside of these friction over speed and pressure is an extrapolation")


def _or_none(value: float, form: str) -> str:
    return f"{value:{form}}" if np.isfinite(value) else "none"


def _sensors(found: CampaignCharacteristics) -> Table:
    rig = found.identity
    channels = dict.fromkeys([*rig.accuracy, *rig.limits, *rig.resolution, *rig.calibration])
    rows = []
    for channel in channels:
        low, high = rig.limits.get(channel, (None, None))
        span = f"{low:g} … {high:g}" if low is not None else "not told"
        accuracy = f"{rig.accuracy[channel]:.3g}" if channel in rig.accuracy else "not told: assumed"
        rows.append((channel, span, accuracy, rig.calibration.get(channel, "not told")))
    if not rows:
        rows = [("all", "not told", "not told: assumed", "not told")]
    head = ("channel, SI", "range", "standard uncertainty", "calibration")
    return Table(head, tuple(rows), "Sensors as the rig states them", numbers_from=9)


def said(found: CampaignCharacteristics) -> Section | None:
    """List what the data do not carry first, then what they do."""
    if not found.statements:
        return None
    missing = tuple(str(s) for s in found.statements if not s.carried and s.topic != "stops")
    carried = tuple(str(s) for s in found.statements if s.carried and s.topic != "stops")
    blocks: list = []
    if missing:
        blocks += [Text("Not carried by these data, and what would:", "note"), Items(missing)]
    if carried:
        blocks += [Text("Carried:"), Items(carried)]
    return Section("statements", "What the data carry, and what not", tuple(blocks), synthetic=found.synthetic)


def flags(found: CampaignCharacteristics) -> Section:
    """List flags of cycles and stops, and what was skipped."""
    counts = Counter(found.flags) + Counter(flag for s in found.stops for flag in s.flags)
    blocks: list = []
    if counts:
        rows = tuple((flag.replace("_", " "), CAMPAIGN_FLAGS.get(flag, ""), str(n)) for flag, n in counts.most_common())
        blocks.append(Table(("flag", "meaning", "cycles"), rows, "Flags", numbers_from=2))
    else:
        blocks.append(Text("No cycle carries a flag."))
    if found.skipped:
        rows = tuple((s.key or "–", s.file, s.reason) for s in found.skipped[:MOST_SKIPPED])
        more = f"; {len(found.skipped) - MOST_SKIPPED} more are not listed" if len(found.skipped) > MOST_SKIPPED else ""
        blocks.append(Table(("cycle", "file", "why"), rows, f"Cycles that were skipped{more}", numbers_from=9))
    else:
        blocks.append(Text("No cycle was skipped."))
    return Section("flags", "Flags and skipped cycles", tuple(blocks), synthetic=found.synthetic)


def budget(found: CampaignCharacteristics) -> Section | None:
    """List the sources of uncertainty of the curves."""
    if not found.sources:
        return None
    rows = tuple((s.name, s.kind, s.basis, s.note, f"{s.standard_uncertainty_n:.2g}") for s in found.sources)
    head = ("source", "GUM", "basis", "note", "N")
    text = "Standard uncertainties, root mean square over the points of all curves."
    table = Table(head, rows, "Budget of the bands", numbers_from=4)
    return Section("budget", "Uncertainty budget", (Text(text), table), synthetic=found.synthetic)


def provenance(found: CampaignCharacteristics) -> Section:
    """Software, protocol as run, sources of methods."""
    about = about_of(found)
    rows = [("pneudrive, this report", __version__), ("pneudrive, the campaign", str(about.get("version", "not told")))]
    rows += [("Python", platform.python_version()), *((p, version(p)) for p in PACKAGES)]
    rows.append(("raw data", f"{found.folder.name}/cycles, one Parquet file a cycle"))
    blocks: list = [Table(("software, settings", "version, value"), tuple(rows), numbers_from=9)]
    protocol = found.folder / "campaign.toml"
    if protocol.is_file():
        lines = protocol.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        cut = [] if len(lines) <= MOST_LINES else [f"... {len(lines) - MOST_LINES} more lines"]
        blocks += [Text("The protocol as run:"), Text("\n".join([*lines[:MOST_LINES], *cut]), "code")]
    cited = tuple(line for key in METHODS if (line := reference(key)))
    blocks += [Text("Sources of methods and laws:"), Items(cited)]
    return Section("provenance", "Provenance and sources", tuple(blocks), synthetic=found.synthetic)
