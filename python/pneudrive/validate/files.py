"""validation.toml: metrics, verdicts and diagnosis for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive import __version__
from pneudrive.identify.base import sections
from pneudrive.trajectory import whole

if TYPE_CHECKING:
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
    drive, diagnosis = found.drive, found.diagnosis()
    identified = {"identified": drive.to_dict()["provenance"]} if drive.provenance else {}
    tables = {
        "schema": SCHEMA,
        "window_s": found.window_s,
        "notes": list(found.notes),
        "provenance": {"drive": drive.name, "description_hash": drive.description_hash, "version": __version__}
        | identified,
        "verdict": [
            {name: vars(v)[name] for name in ("what", "value", "target", "text", "met")} for v in found.verdicts
        ],
        "record": [_record(record) for record in found.records],
        "condition": [vars(row) for row in found.conditions],
        "diagnosis": {
            "left": diagnosis.left,
            "clean": diagnosis.is_clean,
            "residual_over_noise": {name.replace(" ", "_"): value for name, value in diagnosis.size.items()},
            "culprit": [
                {name: getattr(c, name) for name in ("amount", "unit", "interval", "share", "text", "remedy")}
                | {"what": c.key, "rivals": [name for name, _ in c.rivals]}
                for c in diagnosis.culprits
            ],
        },
    }
    head = "# A drive against recordings. SI; nrmse and share are shares, fit in percent."
    return "\n".join([head, *sections(tables)]) + "\n"


def _record(record: RecordResult) -> dict[str, Any]:
    recording = record.recording
    out: dict[str, Any] = {
        "name": recording.name,
        "source": str(recording.source or ""),
        "sha256": recording.sha256,
        "samples": len(recording),
        "labels": recording.labels,
    }
    for name, channel in record.channels.items():
        white = channel.whiteness
        out[name] = {
            "free": _metrics(channel.free),
            "restarted": _metrics(channel.restarted),
            "off_s": channel.off_s,
            "whiteness": {"outside": white.outside, "ljung_box": white.ljung_box, "p": white.p},
            "correlated_with": {c.signal: c.value for c in channel.cross},
        }
    return out | {"breakaway": [vars(b) | {"error": b.error} for b in record.breakaways]}


def _metrics(found: Metrics) -> dict[str, object]:
    return {name: value for name, value in vars(found).items() if np.isfinite(value)}
