"""Sections on the run of a campaign: protocol, flags, skipped cycles, statements, budget, provenance."""

from __future__ import annotations

import math
from collections import Counter
from typing import TYPE_CHECKING, Any

from pneudrive import __version__
from pneudrive.campaign.cycle import KINDS
from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.friction.campaign.compare import about_of
from pneudrive.friction.sentences import flag_table
from pneudrive.report.campaign.rig_diagram import rig_diagram
from pneudrive.report.page import Paragraph
from pneudrive.report.provenance import references, software
from pneudrive.report.topics import Topic
from pneudrive.report.words import plural
from pneudrive.rig.interface import Envelope

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.report.page import Block, PageTable, Section

MOST_LINES = 120  # lines of a protocol that are shown
MOST_SKIPPED = 40
METHODS = ("gum2008", "patterson1971", "wahba1983", "burnham2002", "kato1972", "dieterich1979", "armstrong1994")


def what(found: CampaignCharacteristics) -> Section:
    """Return the section on protocol, rig, operator and numbers of cycles."""
    topic, about, rig = Topic("campaign", "run"), about_of(found), found.identity
    kinds = Counter(c.kind for c in found.cycles) + Counter({"stop": len(found.stops)})
    counts = ", ".join(f"{plural(n, kind)} ({KINDS.get(kind, kind)})" for kind, n in kinds.items())
    envelope = _envelope(about)
    labels = {**rig.labels, **about.get("labels", {})}
    rows = (
        ("campaign", found.name),
        ("rig", rig.name),
        ("operator", str(about.get("operator") or "not stated")),
        ("labels", ", ".join(f"{k} {v}" for k, v in labels.items()) or "none"),
        ("created", str(about.get("created", "not stated"))),
        ("seed of the order", str(about.get("seed", "not stated"))),
        ("areas a, b", f"{1e4 * rig.area_a_m2:.4g} cm², {1e4 * rig.area_b_m2:.4g} cm²"),
        ("mass beyond the sensor", f"{rig.mass_beyond_sensor_kg:.3g} kg"),
        ("stiffness", f"{rig.stiffness_n_m:.3g} N/m" if rig.stiffness_n_m else "not stated: stick-slip is not judged"),
        ("chambers", f"{rig.chambers}; pressure measured at the {rig.pressure_measured_at}"),
        ("ambient pressure", f"{rig.ambient_pressure_pa / 1e5:.4g} bar abs"),
        ("selection of samples", found.protocol),
    )
    return topic.section(
        topic.text("simulated", "note") if found.synthetic else topic.text("measured"),
        topic.text("counts", counts=counts or "none"),
        topic.picture("campaign-rig", rig_diagram(rig, envelope)) if envelope is not None else None,
        topic.table(rows, "facts"),
        _ranges(topic, found),
        _sensors(topic, found),
    )


def _envelope(about: dict[str, Any]) -> Envelope | None:
    stated = about.get("envelope")
    if not isinstance(stated, dict):
        return None
    values: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in stated.items()}
    try:
        return Envelope(**values)
    except TypeError:
        return None


def _ranges(topic: Topic, found: CampaignCharacteristics) -> PageTable:
    r = found.ranges
    rows = (
        ("speed, mm/s", [1e3 * v for v in r.speed_m_s], ".4g"),
        ("pressure a, bar gauge", [v / 1e5 for v in r.gauge_a_pa], ".3g"),
        ("pressure b, bar gauge", [v / 1e5 for v in r.gauge_b_pa], ".3g"),
        ("temperature, °C", [v - ZERO_CELSIUS_K for v in r.temperature_k], ".1f"),
    )
    said = ((name, *(f"{v:{form}}" if math.isfinite(v) else "none" for v in ends)) for name, ends, form in rows)
    return topic.table(said, "ranges")


def _sensors(topic: Topic, found: CampaignCharacteristics) -> PageTable:
    rig = found.identity
    untold = "not stated: assumed"
    rows = [
        (
            channel,
            "{:g} … {:g}".format(*rig.limits[channel]) if channel in rig.limits else "not stated",
            f"{rig.accuracy[channel]:.3g}" if channel in rig.accuracy else untold,
            rig.calibration.get(channel, "not stated"),
        )
        for channel in dict.fromkeys([*rig.accuracy, *rig.limits, *rig.resolution, *rig.calibration])
    ]
    return topic.table(rows or [("all", "not stated", untold, "not stated")], "sensors")


def said(found: CampaignCharacteristics) -> Section | None:
    """Return the section of statements: missing ones first."""
    if not found.statements:
        return None
    topic = Topic("campaign", "statements")
    missing, carried = (
        [str(s) for s in found.statements if s.carried == known and s.topic != "stops"] for known in (False, True)
    )
    return topic.section(*topic.listed(missing, "missing", "note"), *topic.listed(carried, "carried"))


def flags(found: CampaignCharacteristics) -> Section:
    """Return the section on flags of cycles and stops, and on skipped cycles."""
    topic = Topic("campaign", "flags")
    counts = Counter(found.flags) + Counter(flag for s in found.stops for flag in s.flags)
    texts = {flag: flag_table().get(flag, {"means": "", "do": ""}) for flag in counts}
    raised = ((flag.replace("_", " "), texts[flag]["means"], texts[flag]["do"], n) for flag, n in counts.most_common())
    skipped = ((s.key or None, s.file, s.reason) for s in found.skipped[:MOST_SKIPPED])
    left_out = len(found.skipped) - MOST_SKIPPED
    more = f"; {left_out} more are not listed" if left_out > 0 else ""
    return topic.section(
        topic.table(raised, "raised") if counts else topic.text("none_raised"),
        topic.table(skipped, "skipped", more=more) if found.skipped else topic.text("none_skipped"),
    )


def budget(found: CampaignCharacteristics) -> Section | None:
    """Return the section on the sources of uncertainty of the curves."""
    if not found.sources:
        return None
    topic = Topic("campaign", "budget")
    rows = ((s.name, s.kind, s.basis, s.note, s.standard_uncertainty_n) for s in found.sources)
    return topic.section(topic.text(), topic.table(rows))


def provenance(found: CampaignCharacteristics) -> Section:
    """Return the section on software, protocol as run, sources of methods."""
    rows = [
        ("pneudrive, this report", __version__),
        ("pneudrive, the campaign", str(about_of(found).get("version", "not stated"))),
        *software(),
        ("raw data", f"{found.folder.name}/cycles, one Parquet file per cycle"),
    ]
    topic = Topic("campaign", "provenance")
    return topic.section(
        topic.table(rows, "software"),
        *_protocol(topic, found),
        *topic.listed(references(METHODS), "sources"),
    )


def _protocol(topic: Topic, found: CampaignCharacteristics) -> Iterator[Block]:
    protocol = found.folder / "campaign.toml"
    if protocol.is_file():
        lines = protocol.read_text(encoding="utf-8", errors="replace").strip().splitlines()
        more = [topic.say("more", count=len(lines) - MOST_LINES)] if len(lines) > MOST_LINES else []
        yield topic.text("protocol")
        yield Paragraph("\n".join([*lines[:MOST_LINES], *more]), "code")
