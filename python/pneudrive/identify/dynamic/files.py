"""fit.toml of a drive: values with intervals, covariance and provenance."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.describe import toml
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.identify.dynamic.result import DriveFit

SCHEMA = 1


def write_fit(fit: DriveFit, path: str | Path) -> None:
    """Write `fit` as TOML: SI values, 95 % intervals, covariance, statements, provenance.

    Raises
    ------
    CommandError
        The file cannot be written.
    """
    with whole(Path(path)) as temporary:
        temporary.write_text(fit_toml(fit), encoding="utf-8")


def fit_toml(fit: DriveFit) -> str:
    """Return the text of fit.toml."""
    out = [
        "# Identified drive. SI units, pressures absolute; intervals are 95 %.",
        *_table("", {"schema": SCHEMA, "kind": "drive", "converged": fit.converged, "notes": list(fit.notes)}),
    ]
    for group, values in (("values", fit.values), ("sensors", fit.sensors)):
        for name, value in values.items():
            entry: dict[str, Any] = {"value": value, "unit": fit.units[name]}
            entry |= {"interval": list(fit.intervals[name]), "standard_error": fit.standard_errors[name]}
            if name in fit.values:
                entry |= {"determined": name in fit.determined, "sources": list(fit.sources[name])}
            out += _table(f"{group}.{json.dumps(name)}", entry)
    out += _table("covariance", {"names": list(fit.free), "matrix": fit.covariance.tolist()})
    for s in fit.undetermined:
        out += ["", "[[undetermined]]", *_entries({"parameter": s.parameter, "reason": s.reason, "remedy": s.remedy})]
    out += _table("statistics", {key.replace(".", "_"): value for key, value in fit.statistics.items()})
    recordings = fit.provenance.get("recordings", [])
    out += _table("provenance", {k: v for k, v in fit.provenance.items() if k not in {"recordings", "start"}})
    out += _table("provenance.start", {json.dumps(k): v for k, v in fit.provenance.get("start", {}).items()})
    for recording in recordings:
        out += ["", "[[provenance.recordings]]", *_entries(recording)]
    return "\n".join(out).lstrip("\n") + "\n"


def fit_hash(provenance: Mapping[str, Any], values: Mapping[str, float]) -> str:
    """Return a hash by which a fit is found again: of its recordings, options and values."""
    text = json.dumps({"provenance": dict(provenance), "values": dict(values)}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _table(name: str, entries: Mapping[str, Any]) -> list[str]:
    return ([] if not name else ["", f"[{name}]"]) + _entries(entries)


def _entries(entries: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {toml.value_text(value)}" for key, value in entries.items()]
