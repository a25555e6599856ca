"""Schema of a fit.toml, checked before its values are used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictStr, ValidationError

from pneudrive.describe.files import toml
from pneudrive.errors import FitError
from pneudrive.identify.determined import Undetermined

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping

Number = Annotated[float, Field(strict=True)]
#: Kinds of pydantic's errors -> rule in words.
_RULES = {
    "missing": "is missing",
    "string_type": "must be a text",
    "bool_type": "must be true or false",
    "float_type": "must be a number",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "model_attributes_type": "must be a table",
}


class _Table(BaseModel):
    model_config = ConfigDict(extra="allow")


class _Value(_Table):
    """Value of a fit with its interval."""

    value: Number
    unit: StrictStr
    determined: StrictBool = True
    standard_error: Number = 0.0
    u_systematic: Number = 0.0
    interval: tuple[Number, Number] = (0.0, 0.0)
    model_error: Number = 0.0
    sources: list[StrictStr] = Field(default_factory=list)


class _Covariance(_Table):
    names: list[StrictStr]
    matrix: list[list[Number]]


class _Recording(_Table):
    name: StrictStr
    seconds: Number = 0.0


class _Provenance(_Table):
    recordings: list[StrictStr | _Recording] = Field(default_factory=list)


class _Undetermined(_Table):
    parameter: StrictStr
    reason: StrictStr
    remedy: StrictStr


class _FitFile(_Table):
    notes: list[StrictStr] = Field(default_factory=list)
    converged: StrictBool = True
    covariance: _Covariance | None = None
    undetermined: list[StrictStr | _Undetermined] = Field(default_factory=list)
    statistics: dict[StrictStr, Number]
    provenance: _Provenance


class _Values(_Table):
    values: dict[StrictStr, _Value]


def check_shape(content: Mapping[str, Any], title: str, groups: Iterable[str], where: str, text: str) -> None:
    """Check keys and types of a file of a fit.

    Parameters
    ----------
    content : mapping
        Tables of the file.
    title : str
        Name of this kind of fit in messages.
    groups : iterable of str
        Names of its tables of values; all but the first may be missing.
    where, text : str
        Path and text of the file, for the line of the first wrong key.

    Raises
    ------
    FitError
        A key is missing, or its value has another type.
    """
    first, *others = groups
    try:
        _FitFile.model_validate(content)
        for group in (first, *(name for name in others if name in content)):
            if group not in content:
                raise _error(title, group, "is missing", where, text)
            try:
                _Values.model_validate({"values": content[group]})
            except ValidationError as error:
                problem = _deepest(error)
                raise _error(title, _key((group, *problem["loc"][1:])), _rule(problem), where, text) from None
    except ValidationError as error:
        problem = _deepest(error)
        raise _error(title, _key(problem["loc"]), _rule(problem), where, text) from None


def fields_of(content: Mapping[str, Any], entries: Mapping[str, Mapping[str, Any]], first: str) -> dict[str, Any]:
    """Return the fields of a fit from the tables of its file.

    Parameters
    ----------
    content : mapping
        Tables of the file.
    entries : mapping
        Entries of all values, by name.
    first : str
        Table of the values.

    Raises
    ------
    KeyError, ValueError
        An entry is missing, or the covariance does not fit the values.
    """
    names = content.get("covariance", {}).get("names", list(entries))
    matrix = np.array(content.get("covariance", {}).get("matrix", []), dtype=np.float64)
    if matrix.size and matrix.shape != (len(names), len(names)):
        raise ValueError(f"covariance of shape {matrix.shape} for {len(names)} parameters")
    return {
        "values": {name: float(entry["value"]) for name, entry in content[first].items()},
        "units": {name: str(entry["unit"]) for name, entry in entries.items()},
        "free": tuple(names),
        "covariance": matrix,
        "intervals": {n: (e["interval"][0], e["interval"][1]) for n, e in entries.items() if "interval" in e},
        "systematic": {n: float(e["u_systematic"]) for n, e in entries.items() if "u_systematic" in e},
        "model_errors": {n: float(e["model_error"]) for n, e in entries.items() if "model_error" in e},
        "sources": {n: tuple(e["sources"]) for n, e in entries.items() if "sources" in e},
        "undetermined": tuple(Undetermined(**entry) for entry in content.get("undetermined", [])),
        "notes": tuple(content.get("notes", ())),
        "statistics": {name: float(value) for name, value in content["statistics"].items()},
        "provenance": dict(content["provenance"]),
        "converged": bool(content.get("converged", True)),
    }


def _deepest(error: ValidationError) -> Mapping[str, Any]:
    """Return the problem with the longest key: it belongs to the alternative that fits best."""
    return max(error.errors(include_url=False), key=lambda problem: len(problem["loc"]))


def _key(place: Iterable[object]) -> str:
    """Return the dotted key of a location, without the names of pydantic's alternatives."""
    return ".".join(str(part) for part in place if part not in ("_Recording", "_Undetermined", "str"))


def _rule(problem: Mapping[str, Any]) -> str:
    return _RULES.get(str(problem["type"]), str(problem["msg"]))


def _error(title: str, key: str, rule: str, where: str, text: str) -> FitError:
    line = toml.line_of(text, key)
    return FitError(
        f"the file is not a complete {title}: {key} {rule}",
        where=f"{where}:{line}" if line else where,
        remedy="Give a fit.toml as pneudrive fit or pneudrive identify wrote it.",
    )
