"""Export of FMUs for FMI 2.0 and 3.0: modelDescription.xml from a template, the library of the system, the archive."""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections import Counter
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any
from xml.etree import ElementTree
from xml.sax.saxutils import escape

from pneudrive import __version__
from pneudrive.errors import CommandError, DescriptionError, nearest, package_table
from pneudrive.files.content import check_file, rendered
from pneudrive.files.writing import make_result_folder
from pneudrive.fmu.variables import FmuPlan, FmuVariable, plan_of
from pneudrive.repr_tables import Shown
from pneudrive.simulation.simulate import require
from pneudrive.simulation.start import DriveOrCircuit, StartState
from pneudrive.simulation.trajectory import check_target, whole

# --- Units in the form of FMI: exponents of base units, and the display unit.

_UNITS = package_table(__file__, "units.toml")
#: Unit -> exponents of base units.
_KNOWN: dict[str, dict[str, int]] = _UNITS["exponents"]
#: SI unit -> name of the displayed unit, and factor and offset of the conversion from SI.
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
    out = Counter[str]()
    above, *below = unit.replace(" ANR", "").split("/")
    for sign, part in ((1, above), *((-1, one) for one in below)):
        for word in part.strip("() ").split():
            if word == "1":
                continue
            found = _ONE.fullmatch(word)
            if found is None or found["unit"] not in _KNOWN:
                raise DescriptionError(f"the unit {unit} cannot be expressed in an FMU")
            for base, power in _KNOWN[found["unit"]].items():
                out[base] += sign * power * int(found["power"] or 1)
    return {base: power for base, power in out.items() if power}


# --- modelDescription.xml of FMI 2.0 and 3.0.

TEMPLATE, BUILD = (Path(__file__).with_name(f"{name}Description.xml.j2") for name in ("model", "build"))
_STRUCTURED = re.compile(r"(der\()?[A-Za-z_]\w*(\.[A-Za-z_]\w*)*(\[\d+\])?\)?")
#: Characters that are not allowed in XML, not even escaped.
_FOREIGN = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_ESCAPES = {'"': "&quot;", "\t": "&#09;", "\n": "&#10;", "\r": "&#13;"}
_ABOUT = (
    "Pressures are absolute. Positions and velocities grow towards the end of chamber b. In model exchange a step of "
    "the command must be an event of the input: a steep ramp instead gives wrong results without a message."
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
        {"quoted": lambda text: f'"{escape(text, _ESCAPES)}"', "real": lambda number: repr(float(number))},
        plan=plan,
        version=version,
        is_two=version == "2.0",
        tool=f"pneudrive {__version__}",
        about=_ABOUT if plan.period_s is None else _ABOUT_LAW.format(period=plan.period_s),
        naming="structured" if is_structured else "flat",
        files=compiled_files(plan, version) if plan.code else (),
        units={one.unit: exponents(one.unit) for one in plan.variables},
        displayed=DISPLAYED,
        places=places,
        outputs=outputs,
        rates=rates,
        unknown=sorted({*outputs, *rates, *(places[one.rate_of] for one in plan.variables if one.rate_of)}),
        events=[places[one.name] for one in plan.variables if one.role["role"] == "event"],
    )
    return _FOREIGN.sub("\ufffd", text).encode()


def compiled_files(plan: FmuPlan, version: str) -> tuple[str, ...]:
    """Return the names of the C files of a controller that the importing tool compiles."""
    return (f"fmi{version[0]}.c", *(name for name, _ in plan.code if name.endswith(".c")))


# --- Content of an FMU from its description: its version, inputs, outputs and parameters.

DESCRIPTION = "modelDescription.xml"
MOST_BYTES = 16_000_000  # bytes of the largest description; a drive needs 0.1 MB
_KINDS = ("CoSimulation", "ModelExchange")
_SHOWN = ("input", "output", "parameter")


@dataclass(frozen=True)
class SeenFmu:
    """Content of an FMU that is visible to other tools.

    Attributes
    ----------
    title, tool, version, token : str
        Name of the model, generating tool, version of FMI, token.
    kinds : tuple of str
        ``"CoSimulation"``, ``"ModelExchange"``.
    variables : tuple of FmuVariable
        Inputs, outputs and parameters, without roles. A start value that is not a number is left out.
    """

    title: str
    tool: str
    version: str
    token: str
    kinds: tuple[str, ...]
    variables: tuple[FmuVariable, ...]


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
            raise CommandError.of("fmu.unreadable-description", path=path)
        root = ElementTree.fromstring(text)
    except CommandError:
        raise
    except Exception as error:  # the exceptions of the archive and XML libraries for damaged bytes are not documented
        raise CommandError(f"{path.name} cannot be read as an FMU: {error}") from None
    variables = []
    for one in root.iterfind("ModelVariables/*"):
        if one.get("causality") not in _SHOWN:
            continue
        # In FMI 2.0, unit and start are attributes of a type element.
        typed = one if one.get("unit") is not None or not len(one) else one[0]
        name, meaning, causality = (one.get(key, "") for key in ("name", "description", "causality"))
        start = None
        with suppress(ValueError):  # a text, a truth value, several numbers, or none
            start = float(typed.get("start", ""))
        variables.append(FmuVariable(name, typed.get("unit", ""), meaning, causality, {}, start))
    return SeenFmu(
        title=root.get("modelName", ""),
        tool=root.get("generationTool", ""),
        version=root.get("fmiVersion", ""),
        token=root.get("instantiationToken") or root.get("guid", ""),
        kinds=tuple(kind for kind in _KINDS if root.find(kind) is not None),
        variables=tuple(variables),
    )


# --- The library inside every FMU and every C program of a drive.

#: Platform -> suffix of a library, folder of FMI 2.0, folder of FMI 3.0.
PLATFORMS = {
    "linux": (".so", "linux64", "x86_64-linux"),
    "darwin": (".dylib", "darwin64", "x86_64-darwin"),
    "win32": (".dll", "win64", "x86_64-windows"),
}


def binary_name() -> str:
    """Return the file name of the FMU library on this platform."""
    return f"libpneudrive{PLATFORMS.get(sys.platform, PLATFORMS['linux'])[0]}"


@lru_cache(maxsize=1)
def binary_path() -> Path:
    """Return the path of the FMU library of this installation.

    Raises
    ------
    CommandError
        This installation does not include a library for this platform.
    """
    path = Path(__file__).with_name(binary_name())
    if not path.is_file():
        raise CommandError.of("fmu.no-library", where=str(path), platform=sys.platform)
    return path


@lru_cache(maxsize=1)
def load_library() -> ctypes.CDLL:
    """Return the FMU library, loaded into this process."""
    library = ctypes.CDLL(str(binary_path()))
    library.fmi3InstantiateModelExchange.restype = ctypes.c_void_p
    return library


_LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


def try_plan(json: str, token: str, states: int) -> tuple[int, list[float]]:
    """Start a plan in the library, and return its number of event indicators and the nominal values of its states.

    Parameters
    ----------
    json, token : str
        Results of `FmuPlan.json` and `FmuPlan.token`.
    states : int
        Number of states that the other tool integrates.

    Returns
    -------
    int
        Number of event indicators.
    list of float
        Nominal values of the states, in SI.

    Raises
    ------
    DescriptionError
        The library rejects the plan.
    """
    library, messages = load_library(), []

    def log(_environment: Any, _status: int, _category: bytes, message: bytes) -> None:  # noqa: ANN401
        messages.append(message.decode())

    callback = _LOG(log)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "drive.json").write_text(json, encoding="utf-8")
        text = [ctypes.c_char_p(one.encode()) for one in ("export", token, folder)]
        instance = ctypes.c_void_p(library.fmi3InstantiateModelExchange(*text, False, False, None, callback))
    count, sizes = ctypes.c_size_t(), (ctypes.c_double * states)()
    try:
        start = (instance, False, ctypes.c_double(0.0), ctypes.c_double(0.0), False, ctypes.c_double(0.0))
        if instance.value is None or any(  # a status other than 0 is an error
            (
                library.fmi3EnterInitializationMode(*start),
                library.fmi3ExitInitializationMode(instance),
                library.fmi3GetNumberOfEventIndicators(instance, ctypes.byref(count)),
                library.fmi3GetNominalsOfContinuousStates(instance, sizes, ctypes.c_size_t(states)),
            )
        ):
            raise DescriptionError("the library rejects the drive: " + "; ".join(dict.fromkeys(messages)))
    finally:
        library.fmi3FreeInstance(instance)
    return count.value, list(sizes)


# --- Source code in an FMU, and the library that this machine's compiler builds from it.

_HERE = Path(__file__).parent / "sources"
#: File with test values for checking a compiled copy. Compilers ignore the file.
_CHECK = "conformance.txt"
#: Compiler options that reproduce the results of the core bit by bit.
_OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")


def _compiled(files: dict[str, bytes], sources: tuple[str, ...]) -> bytes | None:
    """Return the library that the C compiler of this machine builds, or None without a compiler."""
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        command = [compiler, *_OPTIONS, *sources, "-o", "library", "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            message = done.stderr.strip().splitlines()
            raise CommandError("the C compiler rejects the code", where=compiler, value=message[0] if message else "")
        return (Path(folder) / "library").read_bytes()


# --- FMUs as files: the description, the plan and the library in one archive.

VERSIONS = ("2.0", "3.0")
#: Fixed date in archives, so that equal drives give equal bytes.
_DATE = (1980, 1, 1, 0, 0, 0)
_EXECUTABLE = 0o755 << 16


@dataclass(frozen=True, repr=False)
class FmuFile(Shown):
    """A written FMU file.

    Attributes
    ----------
    path : Path
    version : str
    inputs, outputs, parameters : tuple of FmuVariable
    token : str
        Token of the plan.
    notes : tuple of str
        Warnings and assumed values of the drive.
    """

    path: Path
    version: str
    inputs: tuple[FmuVariable, ...]
    outputs: tuple[FmuVariable, ...]
    parameters: tuple[FmuVariable, ...]
    token: str
    notes: tuple[str, ...]


def complete_plan(drive: DriveOrCircuit, initial: StartState, *, actuator: bool = False) -> FmuPlan:
    """Return the plan of a drive with its event indicators, checked by the library."""
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    plan = plan_of(drive, initial, actuator=actuator)
    states = [one.rate_of for one in plan.variables if one.rate_of]
    count, sizes = try_plan(plan.json(), plan.token, len(states))
    if actuator and count > 0:
        raise DescriptionError.of("fmu.sticking-mode", drive=drive)
    what = "above zero while the present mode of friction or of a valve holds"
    roles = [(f"event_indicator[{i + 1}]", {"role": "event", "of": i}) for i in range(count)]
    events = [FmuVariable(name, "1", what, "local", role) for name, role in roles]
    nominals = dict(zip(states, sizes, strict=True))
    sized = (replace(one, nominal=nominals.get(one.name)) for one in plan.variables)
    return replace(plan, variables=(*sized, *events))


def export_fmu(
    drive: DriveOrCircuit,
    path: str | Path,
    *,
    version: str = "2.0",
    actuator: bool = False,
    initial: StartState = None,
) -> FmuFile:
    """Write a drive or a circuit as a Functional Mock-up Unit for co-simulation and model exchange.

    Inputs are the command and the external force in N. Outputs are the variables of a trajectory in SI. Parameters are
    the numbers of the drive file by their keys, and ``start.position``, ``start.pressure_a`` and so on. Pressures are
    absolute. Each parameter is independent: in the FMU, a derived value stays constant if the value on which it depends
    is changed.

    Parameters
    ----------
    drive : Drive or Circuit
    path : path-like
        File ending in ``.fmu``.
    version : str
        Version of the Functional Mock-up Interface, ``"2.0"`` or ``"3.0"``.
    actuator : bool
        Whether the other tool moves the piston. Position and velocity are then inputs, and the force on the moved body
        is an output. This requires model exchange, and a friction law with bristles.
    initial : Initial, dict or str, optional
        Start state, as for `pneudrive.simulate`.

    Returns
    -------
    FmuFile

    Raises
    ------
    CommandError
        The version or the path is not valid, the file cannot be written, or this installation does not include the
        library.
    DescriptionError
        The start state does not fit, or the drive cannot be an actuator.
    """
    target = check_fmu(path, version)
    return write_fmu(complete_plan(drive, initial, actuator=actuator), target, version)


def check_fmu(path: str | Path, version: str) -> Path:
    """Return the path of a new FMU, or raise a CommandError."""
    if version not in VERSIONS:
        raise CommandError(f'FMI "{version}" is not available', remedy=nearest(version, VERSIONS))
    return check_target(path, (".fmu",))


def write_fmu(plan: FmuPlan, target: Path, version: str) -> FmuFile:
    """Write an FMU: its description, and either the plan and the library or the source code of a controller."""
    suffix, *folders = PLATFORMS.get(sys.platform, PLATFORMS["linux"])
    place = f"binaries/{folders[version != '2.0']}/{plan.identifier}{suffix}"
    if not plan.code:
        entries = [("resources/drive.json", plan.json().encode()), (place, binary_path().read_bytes())]
    else:  # without a C compiler no library is written, and the other tool compiles the code
        files = {name: text.encode() for name, text in plan.code}
        check = files.pop(_CHECK)
        files["variables.h"] = rendered(_HERE / "variables.h.j2", {}, plan=plan, name=plan.identifier).encode()
        files |= {name: (_HERE / name).read_bytes() for name in ("instance.h", f"fmi{version[0]}.c")}
        compiled = compiled_files(plan, version)
        library = _compiled(files, compiled)
        if version != "2.0":
            build = rendered(BUILD, {}, identifier=plan.identifier, files=compiled)
            files["buildDescription.xml"] = build.rstrip().encode()
        entries = [(f"sources/{name}", content) for name, content in files.items()]
        entries.append((f"resources/{_CHECK}", check))
        entries += [] if library is None else [(place, library)]
    with whole(target) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (("modelDescription.xml", description(plan, version)), *entries):
            entry = zipfile.ZipInfo(name, _DATE)
            entry.external_attr = _EXECUTABLE if name == place else 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    inputs, outputs, parameters = (tuple(one for one in plan.variables if one.causality == kind) for kind in _SHOWN)
    return FmuFile(target, version, inputs, outputs, parameters, plan.token, plan.notes)


# --- A drive for C programs: a folder with the header, the library, the plan and an example.

HEADER, EXAMPLE, PLAN = "pneudrive.h", "example.c", "drive.json"


def export_c(drive: DriveOrCircuit, folder: str | Path, *, initial: StartState = None) -> tuple[Path, ...]:
    """Write a drive or a circuit for C programs: pneudrive.h, the library, drive.json and example.c.

    Parameters
    ----------
    drive : Drive or Circuit
    folder : path-like
        Created if it does not exist. Existing files with the names above are replaced.
    initial : Initial, dict or str, optional
        Start state, as for `pneudrive.simulate`.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    CommandError
        The folder cannot be written, or this installation does not include the library.
    DescriptionError
        The start state does not fit.
    """
    plan = complete_plan(drive, initial)
    target, own = Path(folder), Path(__file__).parent
    library = binary_path().read_bytes()
    make_result_folder(target)
    files = {PLAN: plan.json().encode(), HEADER: (own / HEADER).read_bytes(), binary_name(): library}
    # The example has the names of the drive: its commands, positions and pressures.
    text = (own / EXAMPLE).read_text("utf-8")
    for kind, ends, table in (("input", ("command",), "COMMANDS"), ("output", ("position", "pressure"), "SHOWN")):
        chosen = [v.name for v in plan.variables if v.causality == kind and v.name.rpartition(".")[2].startswith(ends)]
        names = "".join(f'"{name}", ' for name in chosen)
        text = re.sub(rf"{table}\[\] = {{.*}}", f"{table}[] = {{{names}NULL}}", text)
    files[EXAMPLE] = text.encode()
    for name, data in files.items():
        with whole(target / name) as temporary:
            temporary.write_bytes(data)
    return tuple(target / name for name in (HEADER, binary_name(), PLAN, EXAMPLE))
