"""modelDescription.xml of FMI 2.0 and 3.0, from a template."""

from __future__ import annotations

import re
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree
from xml.sax.saxutils import escape

from pneudrive import __version__
from pneudrive.errors import CommandError, DescriptionError, package_table
from pneudrive.files.content import check_file, rendered

if TYPE_CHECKING:
    from pneudrive.fmu.variables import FmuCode, FmuPlan


# --- Units in the form of FMI: exponents of base units, and the display unit.

_UNITS = package_table(__file__, "units.toml")
#: Unit -> exponents of base units.
_KNOWN: dict[str, dict[str, int]] = _UNITS["exponents"]
#: SI unit -> name of the displayed unit, and factor and offset from the SI unit to it.
DISPLAYED: dict[str, tuple[str, float, float]] = _UNITS["displayed"]
_ONE = re.compile(r"(?P<unit>[A-Za-z]+)(?:\^?(?P<power>-?\d+))?")


def exponents(unit: str) -> dict[str, int]:
    """Return the exponents of base units of an SI unit.

    Raises
    ------
    DescriptionError
        A part of the unit is unknown.

    Examples
    --------
    >>> exponents("m^3/(s Pa)")
    {'m': 4, 's': 1, 'kg': -1}
    >>> exponents("1")
    {}
    """
    out: dict[str, int] = {}
    above, *below = unit.replace(" ANR", "").split("/")
    for sign, part in ((1, above), *((-1, one) for one in below)):
        for word in part.strip("() ").split():
            if word == "1":
                continue
            found = _ONE.fullmatch(word)
            if found is None or found["unit"] not in _KNOWN:
                raise DescriptionError(f"the unit {unit} cannot be expressed in an FMU")
            for base, power in _KNOWN[found["unit"]].items():
                out[base] = out.get(base, 0) + sign * power * int(found["power"] or 1)
    return {base: power for base, power in out.items() if power}


# --- modelDescription.xml of FMI 2.0 and 3.0.

TEMPLATE = Path(__file__).with_name("modelDescription.xml.j2")
#: Name of the library without its suffix, in every FMU.
IDENTIFIER = "pneudrive"
_STRUCTURED = re.compile(r"(der\()?[A-Za-z_]\w*(\.[A-Za-z_]\w*)*(\[\d+\])?\)?")
#: Characters that are not allowed in XML, not even escaped.
_FOREIGN = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ESCAPES = {'"': "&quot;", "\t": "&#09;", "\n": "&#10;", "\r": "&#13;"}
_ABOUT = (
    "Pressures are absolute. Positions and velocities grow towards the end of chamber b. In model exchange a step of "
    "the command has to be an event of the input: a steep ramp in its place gives wrong results without a message."
)
_ABOUT_LAW = (
    "Pressures are absolute. Samples are taken at each multiple of {period} s, with the inputs at the beginning of a "
    "step: step the controller before its drive, with that period or a part of it."
)


def description(plan: FmuPlan, version: str) -> bytes:
    """Return modelDescription.xml.

    Parameters
    ----------
    plan : FmuPlan
    version : str
        ``"2.0"`` or ``"3.0"``.
    """
    places = {one.name: place for place, one in enumerate(plan.variables)}
    outputs = [places[one.name] for one in plan.variables if one.causality == "output"]
    rates = [places[one.name] for one in plan.variables if one.rate_of]
    is_structured = all(map(_STRUCTURED.fullmatch, places))
    text = rendered(
        TEMPLATE,
        {"quoted": _quoted, "real": lambda number: repr(float(number))},
        plan=plan,
        version=version,
        is_two=version == "2.0",
        library=IDENTIFIER,
        tool=f"pneudrive {__version__}",
        about=_ABOUT if plan.period_s is None else _ABOUT_LAW.format(period=plan.period_s),
        naming="structured" if is_structured else "flat",
        files=() if plan.code is None else compiled_files(plan.code, version),
        units={one.unit: exponents(one.unit) for one in plan.variables},
        displayed=DISPLAYED,
        places=places,
        outputs=outputs,
        rates=rates,
        unknown=sorted({*outputs, *rates, *(places[one.rate_of] for one in plan.variables if one.rate_of)}),
        events=[places[one.name] for one in plan.variables if one.role["role"] == "event"],
    )
    return _FOREIGN.sub("\ufffd", text).encode()


def _quoted(text: str) -> str:
    """Return a text as the value of an attribute."""
    return f'"{escape(text, _ESCAPES)}"'


def compiled_files(code: FmuCode, version: str) -> tuple[str, ...]:
    """Return the names of the C files that a tool compiles."""
    return (f"fmi{version[0]}.c", *(name for name, _ in code.files if name.endswith(".c")))


def build_description(code: FmuCode) -> bytes:
    """Return sources/buildDescription.xml of FMI 3.0."""
    root = ElementTree.Element("fmiBuildDescription", fmiVersion="3.0")
    build = ElementTree.SubElement(root, "BuildConfiguration", modelIdentifier=code.identifier)
    files = ElementTree.SubElement(build, "SourceFileSet", language="C99")
    for name in compiled_files(code, "3.0"):
        ElementTree.SubElement(files, "SourceFile", name=name)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)


# --- Content of an FMU from its description: its version, inputs, outputs and parameters.

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
        The file is not an FMU, or its description is too large, or defines XML entities.
    """
    check_file(path, CommandError)
    try:
        with zipfile.ZipFile(path) as archive, archive.open(DESCRIPTION) as file:
            text = file.read(MOST_BYTES + 1)
        if len(text) > MOST_BYTES or b"\0" in text or b"<!" in text.replace(b"<!--", b""):
            raise CommandError.of("fmu.unreadable-description", path=path)
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
