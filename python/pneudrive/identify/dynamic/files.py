"""fit.toml of a drive: values with intervals, covariance and provenance, and the drive that the search started from."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe import Drive, toml
from pneudrive.errors import FitError
from pneudrive.identify.diagnose import Undetermined
from pneudrive.identify.dynamic.recordings import CHANNELS
from pneudrive.trajectory import meaning, whole

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
        "# Identified drive. SI units, pressures absolute; intervals are 95 %: what noise leaves; model_error is how",
        "# far a value moves as each number that was held is off by 1 %.",
        *_table("", {"schema": SCHEMA, "kind": "drive", "converged": fit.converged, "fits": fit.fits}),
        *_table("", {"notes": list(fit.notes)}),
    ]
    for group, values in (("values", fit.values), ("sensors", fit.sensors)):
        for name, value in values.items():
            entry: dict[str, Any] = {"value": value, "unit": fit.units[name]}
            if name in fit.intervals:
                entry |= {"interval": list(fit.intervals[name]), "standard_error": fit.standard_errors[name]}
            if name in fit.model_errors:
                entry["model_error"] = fit.model_errors[name]
            if name in fit.values:
                entry |= {"determined": name in fit.determined, "sources": list(fit.sources[name])}
            out += _table(f"{group}.{json.dumps(name)}", entry)
    out += _table("covariance", {"names": list(fit.free), "matrix": fit.covariance.tolist()})
    for s in fit.undetermined:
        out += ["", "[[undetermined]]", *_entries({"parameter": s.parameter, "reason": s.reason, "remedy": s.remedy})]
    out += _table("statistics", {json.dumps(key): value for key, value in fit.statistics.items()})
    recordings = fit.provenance.get("recordings", [])
    out += _table("provenance", {k: v for k, v in fit.provenance.items() if k not in {"recordings", "start"}})
    out += _table("provenance.start", {json.dumps(k): v for k, v in fit.provenance.get("start", {}).items()})
    for recording in recordings:
        out += ["", "[[provenance.recordings]]", *_entries(recording)]
    out += ["", toml.write({"drive": fit.start.to_dict()})]
    return "\n".join(out).lstrip("\n")


def read_fit(path: str | Path) -> DriveFit:
    """Read a file that `write_fit` wrote: all but the recordings' series and the linearised problem.

    Raises
    ------
    FitError
        The file cannot be read, or is no fit of a drive.
    """
    content, _ = toml.read(path, FitError, "pneudrive identify --out writes the fit of a drive.")
    where = str(path)
    if content.get("kind") != "drive":
        raise FitError("this is no fit of a drive", where=where, rule="what `pneudrive identify --out` wrote")
    if content.get("schema") != SCHEMA:
        raise FitError(
            "the fit has another schema", where=where, value=content.get("schema"), rule=f"schema = {SCHEMA}"
        )
    try:
        return _from_content(content)
    except (KeyError, TypeError, ValueError) as error:
        raise FitError("the fit is not complete", where=where, value=f"{type(error).__name__}: {error}") from error


def _from_content(content: Mapping[str, Any]) -> DriveFit:
    from pneudrive.identify.dynamic.result import DriveFit

    values, sensors = content["values"], content.get("sensors", {})
    both = {**values, **sensors}
    statistics = {key: float(value) for key, value in content["statistics"].items()}
    seen = [key.removeprefix("rms.") for key in statistics if key.startswith("rms.")]
    return DriveFit(
        values={name: float(entry["value"]) for name, entry in values.items()},
        units={name: entry["unit"] for name, entry in both.items()} | {c: meaning(CHANNELS[c])[1] for c in seen},
        sensors={name: float(entry["value"]) for name, entry in sensors.items()},
        free=tuple(content["covariance"]["names"]),
        covariance=np.array(content["covariance"]["matrix"], dtype=np.float64),
        intervals={
            name: (float(low), float(high))
            for name, entry in both.items()
            if "interval" in entry
            for low, high in [entry["interval"]]
        },
        fits=bool(content.get("fits", True)),
        model_errors={name: float(entry["model_error"]) for name, entry in both.items() if "model_error" in entry},
        sources={name: tuple(entry["sources"]) for name, entry in values.items()},
        undetermined=tuple(Undetermined(**entry) for entry in content.get("undetermined", [])),
        notes=tuple(content["notes"]),
        statistics=statistics,
        converged=bool(content["converged"]),
        provenance=dict(content["provenance"]),
        start=Drive.model_validate(content["drive"]),
    )


def fit_hash(provenance: Mapping[str, Any], values: Mapping[str, float]) -> str:
    """Return a hash by which a fit is found again: of its recordings, options and values."""
    text = json.dumps({"provenance": dict(provenance), "values": dict(values)}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _table(name: str, entries: Mapping[str, Any]) -> list[str]:
    return ([] if not name else ["", f"[{name}]"]) + _entries(entries)


def _entries(entries: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {toml.value_text(value)}" for key, value in entries.items()]
