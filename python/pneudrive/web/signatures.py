"""Commands that the page starts, each with a signature: its fields, its command line and its Python lines.

The form of the page, the copied command, the copied Python and the started process are all derived from one entry of
`SIGNATURES`.
"""

from __future__ import annotations

from dataclasses import dataclass
from posixpath import dirname
from typing import TYPE_CHECKING, Any

from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.files.writing import is_held
from pneudrive.fmu.package import VERSIONS
from pneudrive.identify.static.laws import CANDIDATES
from pneudrive.identify.static.model import PRESSURE_FORMS
from pneudrive.report.page import REPORT
from pneudrive.signals.drive_recording import NEEDED
from pneudrive.signals.trajectories import is_trajectory
from pneudrive.simulation.trajectory import SUFFIXES, columns_in, meaning
from pneudrive.sizing.folder import LOCK
from pneudrive.sizing.search import DRAWS_BEST_OF
from pneudrive.web.drive.drives import is_fit
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.jobs import RESULTS, RIG, JobRequest, folder_name
from pneudrive.web.measured.recordings import layout_in
from pneudrive.web.requests import WRONG_REQUEST
from pneudrive.web.workspace import DESCRIPTIONS, TABLES, is_in_catalogue, safe

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from pneudrive.web.workspace import Workspace

    Values = dict[str, Any]

MAPS = (".parquet", ".csv")
MOST_NEXT, MOST_LEAST, MOST_TUNED, MOST_DRAWS = 200, 100, 10_000, 4096
MOST_RECORDINGS = 500
LAYOUT = "layout"  # missing from a recording whose channels are not known


@dataclass(frozen=True)
class CommandInput:
    """One input of a command.

    Attributes
    ----------
    key : str
        Key in a request of the page.
    label : str
    kind : str
        ``"drive"`` (a drive or a circuit), ``"model"`` (a drive, or the fit of one), ``"map"``, ``"fit"``, ``"task"``,
        ``"recordings"``, ``"choice"``, ``"text"``, ``"number"`` (a whole one), ``"flag"``, ``"keys"``
        (of values, between commas), ``"name"`` (of the result) or ``"out"`` (a new TOML file).
    option : str
        Option of the command. Without one, the input is an argument.
    start : object
        Value that a form begins with.
    choices : tuple of str
    titles : tuple of str
        Of the choices; empty: the choices themselves.
    most : int
        Upper bound of a number, whose lower bound is 1.
    hint : str
    suffix : str
        Ending of a name, which the form shows behind it.
    only : tuple of str
        Key of a choice and its value, without which the input does not apply.
    """

    key: str
    label: str
    kind: str
    option: str = ""
    start: Any = ""
    choices: tuple[str, ...] = ()
    titles: tuple[str, ...] = ()
    most: int = 0
    hint: str = ""
    suffix: str = ""
    only: tuple[str, ...] = ()

    def read(self, given: object, workspace: Workspace) -> Any:  # noqa: ANN401 - of the kind of the input
        """Check a value of a request and return it.

        Raises
        ------
        PneudriveError
            The value is of another kind, unknown, out of bounds, or a file that is not in the workspace.
        """
        given = self.start if given is None else given
        kind = {"flag": bool, "recordings": list, "number": int}.get(self.kind, str)
        if given is None and self.kind == "number":
            return None
        if type(given) is not kind:
            raise CommandError(f"{self.key} is missing, or of another kind", value=str(given)[:80])
        return _READERS.get(self.kind, lambda value, *_: value)(given, workspace, self)

    def words(self, value: Any) -> list[str]:  # noqa: ANN401 - of the kind of the input
        """Return the words of the command for a value."""
        if self.kind in ("name", "out") or value in (None, "", False):
            return []
        if self.kind == "flag":
            return [self.option]
        if isinstance(value, list):
            return list(map(safe, value))
        return [self.option, str(value)] if self.option else [safe(value)]

    def about(self) -> dict[str, Any]:
        """Return the field of a form."""
        choices = list(zip(self.choices, self.titles or self.choices, strict=True))
        return {**{key: value for key, value in vars(self).items() if key != "titles"}, "choices": choices}


_ENDINGS = {"model": DESCRIPTIONS, "map": MAPS, "fit": DESCRIPTIONS, "task": DESCRIPTIONS}


def _number(given: int, _: Workspace, of: CommandInput) -> int:
    if not 1 <= given <= of.most:
        raise CommandError(f"{of.key} = {given} is out of bounds", rule=f"a whole number, 1 to {of.most}")
    return given


def _choice(given: str, _: Workspace, of: CommandInput) -> str:
    if given not in of.choices:
        raise CommandError(f"{of.key} = {given[:80]!r} is not known", rule=", ".join(of.choices))
    return given


def _keys(given: str, _: Workspace, of: CommandInput) -> str:
    keys = [one.strip() for one in given.split(",") if one.strip()]
    if not keys:
        raise CommandError("no changeable value is named", remedy=f"Write {of.hint}, for instance.")
    return ", ".join(keys)


def _out(given: str, workspace: Workspace, _: CommandInput) -> str:
    workspace.path(given, DESCRIPTIONS)
    return given


def _drive(given: str, workspace: Workspace, _: CommandInput) -> str:
    described_at(workspace, given)
    return given


def _file(given: str, workspace: Workspace, of: CommandInput) -> str:
    if of.kind == "model" and is_in_catalogue(given):
        if given.partition(":")[2] not in entries():
            raise CommandError(f"the catalogue has no drive {given[:80]}")
    elif not workspace.path(given, _ENDINGS[of.kind]).is_file():
        raise CommandError(f"there is no {of.label.lower()} {given[:200]}", remedy="Save it, or choose another one.")
    return given


def _recordings(given: list[Any], workspace: Workspace, of: CommandInput) -> list[str]:
    """Return the names of recordings that have a layout or the columns of such a recording."""
    if not 0 < len(given) <= MOST_RECORDINGS or not all(isinstance(one, str) for one in given):
        raise CommandError("no recording is named", remedy="Choose at least one.")
    for name in given:
        path = workspace.path(name, TABLES)
        if not path.is_file():
            raise CommandError(f"there is no recording {name}")
        missing = _missing(path, workspace, of)
        if missing == [LAYOUT]:
            raise CommandError(f"{name} has no layout in the workspace", remedy="Propose a layout and accept it.")
        if missing:
            raise CommandError(
                f"{name} lacks {', '.join(missing)}",
                rule="a drive is compared with command, position and both pressures",
                remedy="Choose a recording of this drive, or name these channels in its layout.",
            )
    return given


def _missing(path: Path, workspace: Workspace, of: CommandInput) -> list[str]:
    """Return the channels that a command needs and a recording lacks; only ``layout`` if nothing tells its channels."""
    if path.suffix in SUFFIXES:
        columns = columns_in(path, NEEDED)
        if is_trajectory(path) if of.hint == "rig" else len(columns) == len(NEEDED):
            return []
    layout = layout_in(workspace, path)
    if layout is None:
        return [LAYOUT]
    known = layout.tree.get("columns", {})
    return [] if of.hint == "rig" else [role for role in (meaning(name)[0] for name in NEEDED) if role not in known]


_READERS: dict[str, Callable[[Any, Workspace, CommandInput], Any]] = {
    "name": lambda given, *_: folder_name(given),
    "number": _number,
    "choice": _choice,
    "keys": _keys,
    "out": _out,
    "drive": _drive,
    "recordings": _recordings,
    **dict.fromkeys(_ENDINGS, _file),
}


@dataclass(frozen=True)
class Signature:
    """A command that a page starts.

    Attributes
    ----------
    title : str
        Text of the button.
    inputs : tuple of CommandInput
    out : callable
        Values -> result of the command.
    python : callable
        Values, the result and the workspace -> lines of Python with the same numbers.
    more : tuple of str
        Words of the command that no input gives.
    """

    title: str
    inputs: tuple[CommandInput, ...]
    out: Callable[[Values], str]
    python: Callable[[Values, str, Workspace], str]
    more: tuple[str, ...] = ()

    def job(self, kind: str, given: Mapping[str, Any], workspace: Workspace) -> JobRequest:
        """Return the job of a request."""
        values: Values = {}
        for one in self.inputs:
            is_asked = not one.only or values[one.only[0]] == one.only[1]
            values[one.key] = one.read(given.get(one.key), workspace) if is_asked else None
        out = self.out(values)
        words = [kind, *(word for one in self.inputs for word in one.words(values[one.key])), *self.more, "--out", out]
        return JobRequest(tuple(words), out, python=f"import pneudrive as pn\n{self.python(values, out, workspace)}")


def _below(values: Values) -> str:
    return f"{RESULTS}/{values['name']}"


def _sizing(values: Values) -> str:
    out = _below(values)
    if out.lower().endswith(DESCRIPTIONS):
        raise CommandError(f"{out} is the name of a task, not of a folder", remedy="Leave out the ending.")
    return out


def _loaded(drive: str, workspace: Workspace) -> str:
    """Return the lines of Python that read a drive, or the fit of one."""
    if not is_in_catalogue(drive) and is_fit(workspace.path(drive)):
        return f"from pneudrive.identify.files import read_fit\n\ndrive = read_fit({drive!r})\n"
    return f"\ndrive = pn.Drive.load({drive!r})\n"


def _fit_python(values: Values, _out: str, _: Workspace) -> str:
    law, form = CANDIDATES[values["law"]], values["pressure"]
    options = (
        f"stribeck_exponent={law.exponent}, stribeck_shape={'lorentzian' if law.lorentzian else None!r}, any_shape=True"
    )
    options += "" if form == "none" else f", pressure_dependence=True, pressure={form!r}"
    read = f"from pneudrive.friction.friction_map import read_map\n\ncurves = read_map({values['map']!r})\n"
    return f"{read}fit = pn.fit_friction(curves, {law.law!r}, {options})\n"


def _design_python(values: Values, out: str, _: Workspace) -> str:
    return (
        "from pneudrive.campaign.planning.next_points import limits_of\n"
        "from pneudrive.identify.static.result import FrictionFit\nfrom pneudrive.rig import load_rig\n\n"
        f"fit, rig = FrictionFit.from_toml({values['fit']!r}), load_rig({RIG!r})\n"
        f"plan = pn.next_measurements(fit, limits_of(fit, rig.identity(), rig.limits()), points={values['points']})\n"
        "print(plan)\n"
    )


def _validate_python(values: Values, _out: str, workspace: Workspace) -> str:
    return f"{_loaded(values['drive'], workspace)}found = pn.validate(drive, {values['recordings']!r})\n"


def _identify_python(values: Values, _out: str, workspace: Workspace) -> str:
    free = values["free"].split(", ")
    return f"{_loaded(values['drive'], workspace)}fit = pn.identify(drive, {values['recordings']!r}, {free!r})\n"


def _apply_python(values: Values, _out: str, workspace: Workspace) -> str:
    read = "" if is_fit(workspace.path(values["drive"])) else "from pneudrive.identify.files import read_fit\n"
    return f"{read}{_loaded(values['drive'], workspace)}after = read_fit({values['fit']!r}).apply(drive)\n"


def _export_python(values: Values, out: str, _: Workspace) -> str:
    options = [f"version={values['fmi']!r}"] if values["to"] == "fmu" else []
    options += ["actuator=True"] if values["actuator"] else []
    options += [f"initial={values['initial']!r}"] if values["initial"] else []
    call = ", ".join(["drive", repr(out), *options])
    loaded = (
        f"from pneudrive.describe.files.load import load_described\n\ndrive = load_described({values['drive']!r})\n"
    )
    return f"{loaded}done = pn.export_{values['to']}({call})\n"


def _datasheet_python(values: Values, _out: str, _: Workspace) -> str:
    loaded = (
        "from pneudrive.datasheet.sheet import build\nfrom pneudrive.describe.files.load import load_described\n"
        "from pneudrive.progress import Watch\n\n"
    )
    return f"{loaded}sheet = build(load_described({values['drive']!r}), [], None, Watch())\n"


def _size_python(values: Values, _out: str, _: Workspace) -> str:
    counts = f"least={values['least']}, most={values['most']}, draws={values['draws']}"
    counts += f", draws_best={DRAWS_BEST_OF * values['draws']}"
    return f"\nfound = pn.size({values['task']!r}, {counts})\n"


NAME = CommandInput("name", "Into results/", "name")
DRIVE = CommandInput("drive", "Drive or circuit", "drive")
MODEL = CommandInput("drive", "Drive or fit of a drive", "model")
RECORDINGS = CommandInput("recordings", "Recordings with command, position and both pressures", "recordings")
FIT = CommandInput("fit", "Fit", "fit")
OUT = CommandInput("out", "Into", "out")
SIGNATURES = {
    "characterise": Signature(
        "Characterise",
        (CommandInput("recordings", "Recordings", "recordings", hint="rig"), NAME),
        _below,
        lambda values, *_: f"\ncurves = pn.characterise({values['recordings']!r})\n",
    ),
    "fit": Signature(
        "Fit again",
        (
            CommandInput("map", "Friction map", "map"),
            CommandInput("law", "Law", "choice", "--laws", "stribeck gaussian", tuple(CANDIDATES)),
            CommandInput("pressure", "Pressure", "choice", "--pressure", "none", ("none", *PRESSURE_FORMS)),
            CommandInput("name", "Into", "name", start="fit-2", suffix=".toml"),
        ),
        lambda values: f"{dirname(values['map'])}/{values['name']}.toml".lstrip("/"),
        _fit_python,
    ),
    "design": Signature(
        "Write the protocol",
        (
            FIT,
            CommandInput("points", "Points, repeats included", "number", "--points", None, most=MOST_NEXT, hint="auto"),
            CommandInput("name", "Protocol", "name", start="next-points", suffix=".toml"),
        ),
        lambda values: f"{values['name']}.toml",
        _design_python,
        ("--rig", RIG),
    ),
    "validate": Signature("Validate", (MODEL, RECORDINGS, NAME), _below, _validate_python),
    "identify": Signature(
        "Identify from these recordings",
        (MODEL, RECORDINGS, CommandInput("free", "Identify", "keys", "--free", hint="valve.conductance"), OUT),
        lambda values: values["out"],
        _identify_python,
    ),
    "apply": Signature(
        "Apply to a new drive file",
        (FIT, MODEL, OUT),
        lambda values: values["out"],
        _apply_python,
    ),
    "size": Signature(
        "Size",
        (
            CommandInput("task", "Task", "task"),
            CommandInput("least", "Least number of choices", "number", "--min-candidates", 10, most=MOST_LEAST),
            CommandInput("most", "Largest number of tuned choices", "number", "--max-candidates", 160, most=MOST_TUNED),
            CommandInput("draws", "Samples of each", "number", "--samples", 256, most=MOST_DRAWS),
            NAME,
        ),
        _sizing,
        _size_python,
    ),
    "export": Signature(
        "Export",
        (
            DRIVE,
            CommandInput("to", "As", "choice", "--to", "fmu", ("fmu", "c"), ("FMU", "Library with header for C")),
            CommandInput("fmi", "FMI", "choice", "--fmi", "2.0", tuple(VERSIONS), only=("to", "fmu")),
            CommandInput("initial", "Start state", "text", "--initial", hint="position = 50 mm"),
            CommandInput(
                "actuator",
                "The other tool moves the piston and gets its force (for multibody tools)",
                "flag",
                "--actuator",
                False,
                only=("to", "fmu"),
            ),
            NAME,
        ),
        lambda values: f"{_below(values)}{'.fmu' if values['to'] == 'fmu' else ''}",
        _export_python,
    ),
    "datasheet": Signature(
        "Write the data sheet", (DRIVE, NAME), lambda values: f"{_below(values)}/{REPORT}", _datasheet_python
    ),
}


def forms(workspace: Workspace) -> dict[str, Any]:
    """Return the form of each command. A field of recordings offers those that have the needed channels."""
    found: dict[str, Any] = {}
    for kind, signature in SIGNATURES.items():
        found[kind] = {"title": signature.title, "fields": [each.about() for each in signature.inputs]}
    offered = {hint: _offered(workspace, hint) for hint in ("rig", "")}
    for each in (field for form in found.values() for field in form["fields"] if field["kind"] == "recordings"):
        each["choices"] = [(path, path) for path in offered[each["hint"]]]
    return found


def _offered(workspace: Workspace, hint: str) -> list[str]:
    """Return the recordings with the channels of a command, at most as many as it takes."""
    paths = []
    for file in workspace.files():
        if file.kind == "recording" and len(paths) < MOST_RECORDINGS:
            try:
                missing = _missing(workspace.path(file.path, TABLES), workspace, CommandInput("", "", "", hint=hint))
            except PneudriveError:  # a damaged file is not offered
                continue
            paths += [] if missing else [file.path]
    return paths


def job_of(given: Mapping[str, Any], workspace: Workspace) -> JobRequest:
    """Return the job of a request.

    Raises
    ------
    PneudriveError
        The command is unknown, or an input is not valid.
    """
    kind = given.get("kind", "characterise")
    signature = SIGNATURES.get(kind) if isinstance(kind, str) else None
    if signature is None:
        raise CommandError(WRONG_REQUEST, remedy="Reload the page.")
    if kind == "characterise" and isinstance(campaign := given.get("campaign"), str):
        return _of_campaign(campaign, folder_name(given.get("name")), workspace)
    if kind == "size" and given.get("resume") is not None:
        return _resumed(given, workspace)
    return signature.job(kind, given, workspace)


def _of_campaign(campaign: str, name: str, workspace: Workspace) -> JobRequest:
    """Return the job that finds the friction of a campaign."""
    if not workspace.folder(campaign).is_dir():
        raise CommandError(f"there is no campaign {campaign}")
    out = f"{RESULTS}/{name}"
    python = f"import pneudrive as pn\n\nfound = pn.campaign_friction({campaign!r})\n"
    return JobRequest(("characterise", safe(campaign), "--out", out), out, python=python)


def _resumed(given: Mapping[str, Any], workspace: Workspace) -> JobRequest:
    """Return the job that continues a search in its folder."""
    folder = workspace.folder(given["resume"])
    if is_held(folder / LOCK):
        raise CommandError(f"a process searches in {given['resume']} already", remedy="Wait until it ends.")
    if not folder.is_dir():
        raise CommandError(f"there is no folder {given['resume']}")
    begun = SIGNATURES["size"].job("size", {**given, "name": "sizing"}, workspace)
    words = (*begun.arguments[:-1], given["resume"])
    return JobRequest(words, given["resume"], is_new=False, python=begun.python)
