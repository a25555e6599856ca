"""fit.toml: a fit with covariance and provenance, written and read."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe import toml
from pneudrive.errors import FitError
from pneudrive.identify.diagnose import Undetermined
from pneudrive.identify.model import FrictionModel, unit_of
from pneudrive.identify.result import FrictionFit
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Mapping

SCHEMA = 1
#: What a fit that is read back has to be of, and what is needed of its statistics.
LAWS = ("coulomb", "stribeck")
STATISTICS = ("values", "degrees_of_freedom", "scale", "variance", "rms_n")


def write_fit(fit: FrictionFit, path: str | Path) -> None:
    """Write `fit` as TOML: SI values, 95 % intervals, covariance, statements, provenance.

    Raises
    ------
    CommandError
        If the file cannot be written.
    """
    with whole(Path(path)) as temporary:
        temporary.write_text(fit_toml(fit), encoding="utf-8")


def fit_toml(fit: FrictionFit) -> str:
    """Return the text of fit.toml."""
    out = [
        "# Friction fit. SI units; intervals are 95 %, statistical; u_systematic is a standard uncertainty.",
        *_table("", {"schema": SCHEMA, "law": fit.law, "notes": list(fit.notes)}),
        *_table("model", _model_table(fit.model)),
    ]
    for name, value in fit.parameters.items():
        entry: dict[str, object] = {"value": value, "unit": unit_of(name), "determined": name in fit.determined}
        out += _table(f"parameters.{name}", entry | _uncertainty(fit, name))
    for name in (n for n in fit.free if n.endswith("_ab")):  # half the sum of two slopes, which is determined
        value = fit.free_values()[name]
        entry = {"value": value, "unit": unit_of(name), "determined": name in fit.intervals}
        out += _table(f"shared.{name}", entry | _uncertainty(fit, name))
    out += _table("covariance", {"names": list(fit.free), "matrix": fit.covariance.tolist()})
    for statement in fit.undetermined:
        out += _table(
            "undetermined",
            {"parameter": statement.parameter, "reason": statement.reason, "remedy": statement.remedy},
            array=True,
        )
    out += _table("statistics", fit.statistics)
    out += _table("provenance", fit.provenance)
    return "\n".join(out).lstrip("\n") + "\n"


def _uncertainty(fit: FrictionFit, name: str) -> dict[str, object]:
    """Uncertainty of what is determined; nothing for all else."""
    if name not in fit.intervals:
        return {}
    errors: dict[str, object] = {"standard_error": fit.standard_errors[name], "u_systematic": fit.systematic[name]}
    return errors | {"interval": list(fit.intervals[name])}


def read_fit(path: str | Path) -> FrictionFit:
    """Read a file that :func:`write_fit` wrote.

    Raises
    ------
    FitError
        If the file is not there, is no TOML, or lacks what a fit needs.
    """
    where = str(path)
    content, _ = toml.read(path, FitError, "pneudrive fit writes a fit.toml.")
    if "kind" in content:
        raise FitError(
            f"this is the fit of a {content['kind']}, not of a friction map by fit_friction",
            where=where,
            rule="what follows needs the coulomb or stribeck law that fit_friction or pneudrive fit wrote",
        )
    try:
        if content["schema"] != SCHEMA:
            raise FitError(
                "the fit has another schema", where=where, value=content["schema"], rule=f"schema = {SCHEMA}"
            )
        return _from_content(content)
    except (KeyError, TypeError, ValueError) as error:
        raise FitError(
            "the file is no complete friction fit", where=where, value=f"{type(error).__name__}: {error}"
        ) from error


def _from_content(content: dict) -> FrictionFit:
    free = tuple(content["covariance"]["names"])
    entries = content["parameters"]
    of = {name: _entry(content, name) for name in (*entries, *free)}
    model = dict(content["model"])
    exponent = model["stribeck_exponent"]
    covariance = np.array(content["covariance"]["matrix"], dtype=float)
    if covariance.shape != (len(free), len(free)):
        raise ValueError(f"covariance of shape {covariance.shape} for {len(free)} parameters")
    fitted = FrictionModel(
        model["law"],
        None if exponent == "free" else float(exponent),
        tuple(model["chambers"]),
        model["viscous"],
        bool(model.get("lorentzian", False)),
        str(model.get("pressure", "linear")),
        model.get("knee_pa"),
    )
    if fitted.law not in LAWS or fitted.names != free:
        raise ValueError(f"law, chambers and parameters do not fit together: {', '.join(free)}")
    statistics = {name: float(value) for name, value in content["statistics"].items()}
    if not all(math.isfinite(statistics[name]) and statistics[name] >= 0.0 for name in STATISTICS):
        raise ValueError(f"statistics: {', '.join(STATISTICS)} are numbers of zero and above")
    return FrictionFit(
        law=content["law"],
        parameters={name: float(entry["value"]) for name, entry in entries.items()},
        free=free,
        covariance=covariance,
        intervals={n: (e["interval"][0], e["interval"][1]) for n, e in of.items() if "standard_error" in e},
        systematic={name: float(of[name].get("u_systematic", 0.0)) for name in free},
        undetermined=tuple(Undetermined(**entry) for entry in content.get("undetermined", [])),
        notes=tuple(content["notes"]),
        statistics=statistics,
        provenance={"direction": content["provenance"]["direction"], **content["provenance"]},
        model=fitted,
    )


def _entry(content: dict, name: str) -> dict[str, Any]:
    """Table of a parameter; that of a slope that both chambers share may stand under each of them, in older files."""
    shared = content.get("shared", {})
    return shared[name] if name in shared else content["parameters"][name.replace("_ab", "_a")]


def _model_table(model: FrictionModel) -> dict[str, object]:
    return {
        "law": model.law,
        "stribeck_exponent": "free" if model.exponent is None else model.exponent,
        "chambers": list(model.chambers),
        "viscous": model.viscous,
        "lorentzian": model.lorentzian,
        "pressure": model.pressure,
        **({} if model.knee_pa is None else {"knee_pa": model.knee_pa}),
    }


def _table(name: str, entries: Mapping[str, object], *, array: bool = False) -> list[str]:
    head = [] if not name else ["", f"[[{name}]]" if array else f"[{name}]"]
    return head + [f"{key} = {toml.value_text(value)}" for key, value in entries.items()]
