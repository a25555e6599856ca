"""Commands that the page starts. The form, the copied command, the copied Python and the job come from one table."""

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
from pneudrive.signals.load import is_trajectory
from pneudrive.simulation.trajectory import SUFFIXES, columns_in, meaning
from pneudrive.sizing.folder import LOCK
from pneudrive.sizing.search import DRAWS_BEST_OF
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.jobs import RESULTS, RIG, JobRequest, PageJobs, design_python, existing_folder, folder_name
from pneudrive.web.lineage import is_fit
from pneudrive.web.measured.recordings import layout_in
from pneudrive.web.requests import call, words, wrong_request
from pneudrive.web.workspace import DESCRIPTIONS, TABLES, Workspace, is_in_catalogue

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

MOST_NEXT, MOST_LEAST, MOST_TUNED, MOST_DRAWS = 200, 100, 10_000, 4096
MOST_RECORDINGS = 500
LAYOUT = "layout"  # missing from a recording whose channels are not known
#: Endings of files, by the kind of an input.
FILES = {"map": (".parquet", ".csv"), **dict.fromkeys(("model", "fit", "task"), DESCRIPTIONS)}
TYPES = {"flag": bool, "recordings": list, "number": int}


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
        Parameter of the command. Without one, the input is an argument.
    start : object
        Value that a form begins with.
    choices : tuple of (str, str)
        Values and their titles.
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
    choices: tuple[tuple[str, str], ...] = ()
    most: int = 0
    hint: str = ""
    suffix: str = ""
    only: tuple[str, ...] = ()

    def read(self, given: Any, workspace: Workspace) -> Any:  # noqa: ANN401 - of the kind of the input
        """Check a value of a request and return it.

        Raises
        ------
        PneudriveError
            The value is of another kind, unknown, out of bounds, or a file that is not in the workspace.
        """
        if given is None and self.start is None:
            return None
        value = self.start if given is None else given
        if type(value) is not TYPES.get(self.kind, str):
            raise CommandError(f"{self.key} is missing, or of another kind", value=str(value)[:80])
        match self.kind:
            case "name":
                folder_name(value)
            case "out":
                workspace.path(value, DESCRIPTIONS)
            case "drive":
                described_at(workspace, value)
            case "recordings":
                _check_recordings(value, workspace, self.hint)
            case "number" if not 1 <= value <= self.most:
                raise CommandError(f"{self.key} = {value} is out of bounds", rule=f"a whole number, 1 to {self.most}")
            case "choice" if value not in dict(self.choices):
                raise CommandError(f"{self.key} = {value[:80]!r} is not known", rule=", ".join(dict(self.choices)))
            case "keys":
                value = ", ".join(key.strip() for key in value.split(",") if key.strip())
                if not value:
                    raise CommandError("no changeable value is named", remedy=f"Write {self.hint}, for instance.")
            case kind if kind in FILES:
                _check_file(value, workspace, self)
        return value


def _check_file(given: str, workspace: Workspace, of: CommandInput) -> None:
    """Refuse a file that does not exist."""
    if of.kind == "model" and is_in_catalogue(given):
        if given.partition(":")[2] not in entries():
            raise CommandError(f"the catalogue has no drive {given[:80]}")
    elif not workspace.path(given, FILES[of.kind]).is_file():
        raise CommandError(f"there is no {of.label.lower()} {given[:200]}", remedy="Save it, or choose another one.")


def _check_recordings(given: list[Any], workspace: Workspace, hint: str) -> None:
    """Refuse recordings without a layout and without the columns of such a recording."""
    if not 0 < len(given) <= MOST_RECORDINGS or not all(isinstance(name, str) for name in given):
        raise CommandError("no recording is named", remedy="Choose at least one.")
    for name in given:
        path = workspace.path(name, TABLES)
        if not path.is_file():
            raise CommandError(f"there is no recording {name}")
        missing = _missing(path, workspace, hint)
        if missing == [LAYOUT]:
            raise CommandError(f"{name} has no layout in the workspace", remedy="Propose a layout and accept it.")
        if missing:
            raise CommandError(
                f"{name} lacks {', '.join(missing)}",
                rule="a drive is compared with command, position and both pressures",
                remedy="Choose a recording of this drive, or name these channels in its layout.",
            )


def _missing(path: Path, workspace: Workspace, hint: str) -> list[str]:
    """Return the channels that a command needs and a recording lacks; only ``layout`` if nothing tells its channels."""
    if path.suffix in SUFFIXES:
        columns = columns_in(path, NEEDED)
        if is_trajectory(path) if hint == "rig" else len(columns) == len(NEEDED):
            return []
    layout = layout_in(workspace, path)
    if layout is None:
        return [LAYOUT]
    known = layout.tree.get("columns", {})
    return [] if hint == "rig" else [role for role in (meaning(name)[0] for name in NEEDED) if role not in known]


@dataclass(frozen=True)
class Signature:
    """A command that a page starts.

    Attributes
    ----------
    title : str
        Text of the button.
    out : str
        Form of the result, from the values of the inputs.
    inputs : tuple of CommandInput
    """

    title: str
    out: str
    inputs: tuple[CommandInput, ...]

    def job(self, kind: str, given: Mapping[str, Any], workspace: Workspace) -> JobRequest:
        """Return the job of a request."""
        values: dict[str, Any] = {}
        for each in self.inputs:
            is_asked = not each.only or values[each.only[0]] == each.only[1]
            values[each.key] = each.read(given.get(each.key), workspace) if is_asked else None
        folder, suffix = dirname(values.get("map", "")), ".fmu" if values.get("to") == "fmu" else ""
        out = self.out.format(**values, folder=folder, suffix=suffix).lstrip("/")
        if kind == "size" and out.lower().endswith(DESCRIPTIONS):
            raise CommandError(f"{out} is the name of a task, not of a folder", remedy="Leave out the ending.")
        names: list[str] = []
        options: dict[str, Any] = {}
        for each in (each for each in self.inputs if each.kind not in ("name", "out")):
            value = values[each.key]
            if each.option:
                options |= {each.option: value}
            else:
                names += value if isinstance(value, list) else [value]
        options |= {"rig": RIG} if kind == "design" else {}
        python = f"import pneudrive as pn\n{_python(kind, values, out, workspace)}\n"
        return JobRequest(words(kind, *names, **options, out=out), out, python=python)


def _python(kind: str, values: Mapping[str, Any], out: str, workspace: Workspace) -> str:
    """Return lines of Python with the same numbers as a command."""
    drive, fit, recordings = (values.get(key, "") for key in ("drive", "fit", "recordings"))
    described = "from pneudrive.describe.files.load import load_described\n"
    reads_fit = "from pneudrive.identify.files import read_fit\n"
    if drive and not is_in_catalogue(drive) and kind in ("validate", "identify", "apply"):
        is_of_fit = is_fit(workspace.path(drive))
    else:
        is_of_fit = False
    loaded = f"{reads_fit}\ndrive = read_fit({drive!r})\n" if is_of_fit else f"\ndrive = pn.Drive.load({drive!r})\n"
    match kind:
        case "characterise":
            return f"\ncurves = pn.characterise({recordings!r})"
        case "fit":
            law, form = CANDIDATES[values["law"]], values["pressure"]
            shape = f"stribeck_exponent={law.exponent}, stribeck_shape={'lorentzian' if law.lorentzian else None!r}"
            pressure = "" if form == "none" else f", pressure_dependence=True, pressure={form!r}"
            read = f"from pneudrive.friction.friction_map import read_map\n\ncurves = read_map({values['map']!r})\n"
            return f"{read}fit = pn.fit_friction(curves, {law.law!r}, {shape}, any_shape=True{pressure})"
        case "design":
            return design_python(fit, values["points"])
        case "validate":
            return f"{loaded}found = pn.validate(drive, {recordings!r})"
        case "identify":
            return f"{loaded}fit = pn.identify(drive, {recordings!r}, {values['free'].split(', ')!r})"
        case "apply":
            return f"{'' if is_of_fit else reads_fit}{loaded}after = read_fit({fit!r}).apply(drive)"
        case "size":
            counts = {name: values[name] for name in ("least", "most", "draws")}
            counts["draws_best"] = DRAWS_BEST_OF * values["draws"]
            return f"\nfound = {call('pn.size', repr(values['task']), **counts)}"
        case "export":
            fmi = values["fmi"] if values["to"] == "fmu" else ""
            options = {"version": fmi, "actuator": values["actuator"], "initial": values["initial"]}
            done = call(f"pn.export_{values['to']}", "drive", repr(out), **options)
            return f"{described}\ndrive = load_described({drive!r})\ndone = {done}"
        case _:
            build = "from pneudrive.datasheet.sheet import build\n"
            sheet = f"sheet = build(load_described({drive!r}), [], None, Watch())"
            return f"{build}{described}from pneudrive.progress import Watch\n\n{sheet}"


def _same(*names: str) -> tuple[tuple[str, str], ...]:
    return tuple(zip(names, names, strict=True))


BELOW = f"{RESULTS}/{{name}}"
NAME = CommandInput("name", "Into results/", "name")
DRIVE = CommandInput("drive", "Drive or circuit", "drive")
MODEL = CommandInput("drive", "Drive or fit of a drive", "model")
RECORDINGS = CommandInput("recordings", "Recordings with command, position and both pressures", "recordings")
FIT = CommandInput("fit", "Fit", "fit")
OUT = CommandInput("out", "Into", "out")
ACTUATOR = "The other tool moves the piston and gets its force (for multibody tools)"
TOOLS = (("fmu", "FMU"), ("c", "Library with header for C"))
POINTS = CommandInput("points", "Points, repeats included", "number", "points", None, most=MOST_NEXT, hint="auto")
LAWS, FORMS = _same(*CANDIDATES), _same("none", *PRESSURE_FORMS)
TUNED = "Largest number of tuned choices"
SIGNATURES = {
    "characterise": Signature(
        "Characterise", BELOW, (CommandInput("recordings", "Recordings", "recordings", hint="rig"), NAME)
    ),
    "fit": Signature(
        "Fit again",
        "{folder}/{name}.toml",
        (
            CommandInput("map", "Friction map", "map"),
            CommandInput("law", "Law", "choice", "laws", "stribeck gaussian", LAWS),
            CommandInput("pressure", "Pressure", "choice", "pressure", "none", FORMS),
            CommandInput("name", "Into", "name", start="fit-2", suffix=".toml"),
        ),
    ),
    "design": Signature(
        "Write the protocol",
        "{name}.toml",
        (FIT, POINTS, CommandInput("name", "Protocol", "name", start="next-points", suffix=".toml")),
    ),
    "validate": Signature("Validate", BELOW, (MODEL, RECORDINGS, NAME)),
    "identify": Signature(
        "Identify from these recordings",
        "{out}",
        (MODEL, RECORDINGS, CommandInput("free", "Identify", "keys", "free", hint="valve.conductance"), OUT),
    ),
    "apply": Signature("Apply to a new drive file", "{out}", (FIT, MODEL, OUT)),
    "size": Signature(
        "Size",
        BELOW,
        (
            CommandInput("task", "Task", "task"),
            CommandInput("least", "Least number of choices", "number", "min_candidates", 10, most=MOST_LEAST),
            CommandInput("most", TUNED, "number", "max_candidates", 160, most=MOST_TUNED),
            CommandInput("draws", "Samples of each", "number", "samples", 256, most=MOST_DRAWS),
            NAME,
        ),
    ),
    "export": Signature(
        "Export",
        f"{BELOW}{{suffix}}",
        (
            DRIVE,
            CommandInput("to", "As", "choice", "to", "fmu", TOOLS),
            CommandInput("fmi", "FMI", "choice", "fmi", "2.0", _same(*VERSIONS), only=("to", "fmu")),
            CommandInput("initial", "Start state", "text", "initial", hint="position = 50 mm"),
            CommandInput("actuator", ACTUATOR, "flag", "actuator", start=False, only=("to", "fmu")),
            NAME,
        ),
    ),
    "datasheet": Signature("Write the data sheet", f"{BELOW}/{REPORT}", (DRIVE, NAME)),
}


def forms(workspace: Workspace) -> dict[str, Any]:
    """Return the form of each command. A field of recordings offers those that have the needed channels."""
    offered = {hint: _same(*_offered(workspace, hint)) for hint in ("rig", "")}

    def about(field: CommandInput) -> dict[str, Any]:
        return vars(field) | ({"choices": offered[field.hint]} if field.kind == "recordings" else {})

    return {kind: {"title": of.title, "fields": list(map(about, of.inputs))} for kind, of in SIGNATURES.items()}


def _offered(workspace: Workspace, hint: str) -> list[str]:
    """Return the recordings with the channels of a command, at most as many as it takes."""
    paths = []
    for file in workspace.files():
        if file.kind == "recording" and len(paths) < MOST_RECORDINGS:
            try:
                missing = _missing(workspace.path(file.path, TABLES), workspace, hint)
            except PneudriveError:  # a damaged file is not offered
                continue
            paths += [] if missing else [file.path]
    return paths


def copied_job(workspace: Workspace, given: Mapping[str, Any]) -> dict[str, str]:
    """Return a job as lines of a shell and as Python."""
    job = _job(given, workspace)
    return {"command": job.command, "python": job.python}


def started_job(workspace: Workspace, given: Mapping[str, Any]) -> dict[str, Any]:
    """Start a job."""
    return workspace.state(PageJobs).start(_job(given, workspace))


def _job(given: Mapping[str, Any], workspace: Workspace) -> JobRequest:
    """Return the job of a request. It may name a campaign, or the folder of a search that it continues.

    Raises
    ------
    PneudriveError
        The command is unknown, or an input is not valid.
    """
    kind = given.get("kind", "characterise")
    signature = SIGNATURES.get(kind) if isinstance(kind, str) else None
    if signature is None:
        raise wrong_request()
    if kind == "characterise" and isinstance(campaign := given.get("campaign"), str):
        out = f"{RESULTS}/{folder_name(given.get('name'))}"
        existing_folder(workspace, campaign, "campaign")
        python = f"import pneudrive as pn\n\nfound = pn.campaign_friction({campaign!r})\n"
        return JobRequest(words(kind, campaign, out=out), out, python=python)
    if kind == "size" and (folder := given.get("resume")) is not None:
        if is_held(workspace.folder(folder) / LOCK):
            raise CommandError(f"a process searches in {folder} already", remedy="Wait until it ends.")
        existing_folder(workspace, folder)
        begun = signature.job(kind, {**given, "name": "sizing"}, workspace)
        return JobRequest([*begun.arguments[:-1], folder], folder, is_new=False, python=begun.python)
    return signature.job(kind, given, workspace)
