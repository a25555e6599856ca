"""The friction of a rig file: as in a drive file, each value with its source."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.describe.friction import Friction, friction_laws
from pneudrive.describe.law import FrictionLaw
from pneudrive.errors import DescriptionError, Problems, together
from pneudrive.rig.reader import bare

if TYPE_CHECKING:
    from pneudrive.rig.reader import Reader


def read_friction(reader: Reader, law: str | FrictionLaw, given: dict[str, Any]) -> dict[str, Any]:
    """Read the parameters of a law and the tables of what acts on it.

    Parameters
    ----------
    reader : Reader
        Notes the sources.
    law : str or FrictionLaw
    given : dict
        The friction table without its law.

    Returns
    -------
    dict
        parameters, pressure, dependences: SI, as the core takes them; a law of one's own is among the last.

    Raises
    ------
    DescriptionError
        If a key is unknown or missing, or a value lacks its source or its unit.
    """
    entry = law.entry if isinstance(law, FrictionLaw) else friction_laws()[law]
    known = {p["key"] for p in entry["parameters"]}
    tables = {key for key in Friction.model_fields if key not in ("law", "formula", "parameters", "given")}
    rule = f"keys: {', '.join(sorted(known | tables))}"
    plain, problems = {}, Problems()
    for key, about in given.items():
        with problems.caught():
            if key not in known | tables:
                raise DescriptionError(f"friction.{key} is unknown", where=reader.where, rule=rule)
            plain[key] = _plain(reader, f"friction.{key}", about)
    problems.tell()
    try:
        friction = Friction.model_validate({"law": law} | plain)
    except DescriptionError as error:
        told = [DescriptionError(e.what, where=reader.where, rule=e.rule, remedy=e.remedy) for e in error.each()]
        raise together(told) from None
    core = friction.core()
    others = {key: table for key, table in core.items() if key not in ("law", "parameters", "pressure")}
    return {"parameters": core["parameters"], "pressure": core["pressure"], "dependences": others}


def _plain(reader: Reader, name: str, entry: Any) -> Any:  # noqa: ANN401
    """Take the sources off: what remains is written as in a drive file."""
    if isinstance(entry, list):
        return [_plain(reader, f"{name}.{i}", one) for i, one in enumerate(entry)]
    if isinstance(entry, dict) and isinstance(entry.get("value"), list):
        rest = {key: about for key, about in entry.items() if key != "value"}
        return [_plain(reader, f"{name}.{i}", one | rest) for i, one in enumerate(entry["value"])]
    if isinstance(entry, dict) and "value" not in entry and "source" in entry:
        rest = {key: entry[key] for key in ("source", "reason") if key in entry}
        parts = {key: value for key, value in entry.items() if key not in rest}
        return {key: bare(reader.text(f"{name}.{key}", {**rest, "value": value})) for key, value in parts.items()}
    if isinstance(entry, dict) and "value" not in entry:
        return {key: _plain(reader, f"{name}.{key}", one) for key, one in entry.items()}
    return bare(reader.text(name, entry))
