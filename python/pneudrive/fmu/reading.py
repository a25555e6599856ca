"""Content of an FMU from its description: its version, inputs, outputs and parameters."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from pneudrive.errors import CommandError
from pneudrive.files.content import check_file

if TYPE_CHECKING:
    from pathlib import Path

DESCRIPTION = "modelDescription.xml"
MOST_BYTES = 16_000_000  # largest description; that of a drive has 0.1 MB
_KINDS = ("CoSimulation", "ModelExchange")
_SHOWN = ("input", "output", "parameter")


@dataclass(frozen=True)
class SeenVariable:
    """A variable of an FMU, with its unit as written in the description."""

    name: str
    unit: str
    meaning: str
    causality: str
    start: str


@dataclass(frozen=True)
class SeenFmu:
    """Content of an FMU that is visible to other tools.

    Attributes
    ----------
    title, tool, version, token : str
        Name of the model, generating tool, version of FMI, token.
    kinds : tuple of str
        ``"CoSimulation"``, ``"ModelExchange"``.
    variables : tuple of SeenVariable
        Inputs, outputs and parameters.
    """

    title: str
    tool: str
    version: str
    token: str
    kinds: tuple[str, ...]
    variables: tuple[SeenVariable, ...]


def read_fmu(path: Path) -> SeenFmu:
    """Read the description of an FMU without running it.

    Raises
    ------
    CommandError
        The file is not an FMU, or its description is too large or defines XML entities.
    """
    check_file(path, CommandError)
    try:
        with zipfile.ZipFile(path) as archive, archive.open(DESCRIPTION) as file:
            text = file.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES or b"\0" in text or b"<!" in text.replace(b"<!--", b""):
            raise CommandError(
                f"{path.name}: pneudrive cannot read its description",
                rule="XML in UTF-8 without entities, up to 16 MB",
            )
        root = ElementTree.fromstring(text)
    except CommandError:
        raise
    except Exception as error:  # the exceptions of the archive and XML libraries for damaged bytes are not documented
        raise CommandError(f"{path.name} is not an FMU that can be read: {error}") from None
    return SeenFmu(
        title=root.get("modelName", ""),
        tool=root.get("generationTool", ""),
        version=root.get("fmiVersion", ""),
        token=root.get("instantiationToken") or root.get("guid", ""),
        kinds=tuple(kind for kind in _KINDS if root.find(kind) is not None),
        variables=tuple(_seen(one) for one in root.iterfind("ModelVariables/*") if one.get("causality") in _SHOWN),
    )


def _seen(one: ElementTree.Element) -> SeenVariable:
    """Return a variable. In FMI 2.0, unit and start are attributes of a type element."""
    typed = one if one.get("unit") is not None or not len(one) else one[0]
    keys = ("name", "description", "causality")
    name, meaning, causality = (one.get(key, "") for key in keys)
    return SeenVariable(name, typed.get("unit", ""), meaning, causality, typed.get("start", ""))
