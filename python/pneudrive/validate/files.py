"""validation.toml: metrics, verdicts and diagnosis for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import __version__
from pneudrive.describe import toml
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.validate.metrics import Metrics
    from pneudrive.validate.validation import RecordResult, Validation

SCHEMA = 1


def write_validation(found: Validation, folder: str | Path) -> Path:
    """Write validation.toml into a folder that is there.

    Raises
    ------
    CommandError
        It cannot be written.
    """
    target = Path(folder) / "validation.toml"
    with whole(target) as temporary:
        temporary.write_text(validation_toml(found), encoding="utf-8")
    return target


def validation_toml(found: Validation) -> str:
    """Return the text of validation.toml: SI, shares as numbers, fit in percent; what is unknown is left out."""
    out = ["# A drive against recordings. SI; nrmse and share are shares, fit in percent."]
    out += _table("", {"schema": SCHEMA, "window_s": found.window_s, "notes": list(found.notes)})
    out += _table(
        "provenance",
        {"drive": found.drive.name, "description_hash": found.drive.description_hash, "version": __version__},
    )
    if found.drive.provenance:
        out += _table("provenance.identified", found.drive.to_dict()["provenance"])
    for verdict in found.verdicts:
        entry = {"what": verdict.what, "value": verdict.value, "target": verdict.target, "text": verdict.text}
        met = {} if verdict.met is None else {"met": bool(verdict.met)}
        out += _table("verdict", entry | met, array=True)
    for record in found.records:
        out += _record(record)
    for row in found.conditions:
        out += _table("condition", vars(row), array=True)
    diagnosis = found.diagnosis()
    sizes = {name.replace(" ", "_"): value for name, value in diagnosis.size.items()}
    out += _table("diagnosis", {"left": diagnosis.left, "clean": diagnosis.is_clean, "residual_over_noise": sizes})
    for culprit in diagnosis.culprits:
        entry = {
            "what": culprit.key,
            "amount": culprit.amount,
            "unit": culprit.unit,
            "interval": list(culprit.interval),
            "share": culprit.share,
            "rivals": [name for name, _ in culprit.rivals],
            "text": culprit.text,
            "remedy": culprit.remedy,
        }
        out += _table("diagnosis.culprit", entry, array=True)
    return "\n".join(out) + "\n"


def _record(record: RecordResult) -> list[str]:
    recording = record.recording
    head = {
        "name": recording.name,
        "source": str(recording.source or ""),
        "sha256": recording.sha256,
        "samples": len(recording),
        "labels": recording.labels,
    }
    out = _table("record", head, array=True)
    for name, channel in record.channels.items():
        entry: dict[str, object] = {"free": _metrics(channel.free), "restarted": _metrics(channel.restarted)}
        if channel.off_s is not None:
            entry["off_s"] = channel.off_s
        white = channel.whiteness
        entry["whiteness"] = {"outside": white.outside, "ljung_box": white.ljung_box, "p": white.p}
        entry["correlated_with"] = {c.signal: c.value for c in channel.cross}
        out += _table(f"record.{name}", entry)
    for b in record.breakaways:
        out += _table("record.breakaway", vars(b) | {"error": b.error}, array=True)
    return out


def _metrics(found: Metrics) -> dict[str, object]:
    return {name: value for name, value in vars(found).items() if np.isfinite(value)}


def _table(name: str, entries: Mapping[str, object], *, array: bool = False) -> list[str]:
    head = [] if not name else ["", f"[[{name}]]" if array else f"[{name}]"]
    return head + [
        f"{toml.key_text(key)} = {toml.value_text(value)}" for key, value in entries.items() if value is not None
    ]
