"""Commands that the page can start; each has a form, a copied command, copied Python and a job.

Arguments, options and defaults are those of the command's function.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from inspect import Parameter, signature
from posixpath import basename, dirname
from typing import Any

from pneudrive.arrays import Keyed, Plain, attributes_of
from pneudrive.cli.main import COMMANDS
from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import CommandError, PneudriveError, package_table
from pneudrive.files.writing import is_held
from pneudrive.fmu.package import VERSIONS
from pneudrive.identify.static.model import CANDIDATES, PRESSURE_FORMS
from pneudrive.signals.drive_recording import NEEDED
from pneudrive.signals.load import is_trajectory
from pneudrive.simulation.trajectory import SUFFIXES, columns_in, meaning
from pneudrive.sizing.result import LOCK
from pneudrive.sizing.search import DRAWS_BEST_OF
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.jobs import RESULTS, RIG, JobRequest, check_folder, folder_name
from pneudrive.web.measured.recordings import layout_in
from pneudrive.web.messages import keywords, python, words, wrong_request
from pneudrive.web.workspace import DESCRIPTIONS, TABLES, Workspace, is_in_catalogue

MOST_RECORDINGS = 500
#: Kind of an input -> suffixes of its files.
FILES = {"map": (".parquet", ".csv"), **dict.fromkeys(("model", "fit", "task"), DESCRIPTIONS)}
TYPES = {"flag": bool, "recordings": list, "number": int}


@cache
def parameters_of(command: str) -> Mapping[str, Parameter]:
    """Return the parameters of a command: an argument is positional, an option keyword-only."""
    return signature(getattr(import_module(COMMANDS[command]), command)).parameters


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
        ``"recordings"``, ``"choice"``, ``"text"``, ``"number"`` (an integer), ``"flag"``, ``"keys"``
        (keys of values, separated by commas), ``"name"`` (of the result) or ``"out"`` (a new TOML file).
    option : str
        Parameter of the command; empty if it equals the key.
    start : object
        Initial value in a form.
    choices : tuple of (str, str)
        Values and their titles.
    most : int
        Upper bound of a number, whose lower bound is 1.
    hint, suffix : str
        Example in an empty field, and extension of a file name.
    only : tuple of str
        Key and value of a choice. The input applies only if the choice has this value.
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
        value = self.start if given is None else given
        if value is None:
            return None
        if type(value) is not TYPES.get(self.kind, str):
            raise CommandError(f"{self.key} is missing or has another type", value=str(value)[:80])
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
                    raise CommandError("no value to be identified is given", remedy=f"Write {self.hint}, for instance.")
            case kind if kind in FILES:
                self._check_file(value, workspace)
        return value

    def _check_file(self, name: str, workspace: Workspace) -> None:
        if self.kind == "model" and is_in_catalogue(name):
            if name.partition(":")[2] not in entries():
                raise CommandError(f"the catalogue has no drive {name[:80]}")
        elif not workspace.path(name, FILES[self.kind]).is_file():
            raise CommandError.of("web.no-input", kind=self.label.lower(), name=name[:200])


def _check_recordings(given: list[Any], workspace: Workspace, hint: str) -> None:
    """Check the channels of recordings."""
    if not 0 < len(given) <= MOST_RECORDINGS or not all(isinstance(name, str) for name in given):
        raise CommandError("no recording is named", remedy="Choose at least one.")
    for name in given:
        _check_channels(name, workspace, hint)


def _check_channels(name: str, workspace: Workspace, hint: str) -> None:
    """Reject a recording without the needed channels, or with neither a layout nor the column names of pneudrive."""
    path = workspace.path(name, TABLES)
    if not path.is_file():
        raise CommandError(f"there is no recording {name}")
    if path.suffix in SUFFIXES:
        columns = columns_in(path, NEEDED)
        if is_trajectory(path) if hint == "rig" else len(columns) == len(NEEDED):
            return
    layout = layout_in(workspace, path)
    if layout is None:
        raise CommandError(f"{name} has no layout in the workspace", remedy="Propose a layout and accept it.")
    known = layout.tree.get("columns", {})
    missing = [role for role in (meaning(column)[0] for column in NEEDED) if role not in known]
    if missing and hint != "rig":
        raise CommandError.of("web.channels", name=name, missing=", ".join(missing))


def _job_of(kind: str, given: Keyed, workspace: Workspace, folder: str = "") -> JobRequest:
    """Return the job of a request for a command of `SIGNATURES`. If a folder is given, the job continues in it."""
    form, values = SIGNATURES[kind], Plain()
    for each in form["inputs"]:
        applies = not each.only or values[each.only[0]] == each.only[1]
        values[each.key] = each.read(given.get(each.key), workspace) if applies else None
    places = {"folder": dirname(values.get("map", "")), "suffix": ".fmu" if values.get("to") == "fmu" else ""}
    out = folder or form["out"].format(**values, **places).lstrip("/")
    if kind == "size" and values["name"].lower().endswith(DESCRIPTIONS):
        raise CommandError(f"{out} is the name of a task file, not of a folder", remedy="Leave out the extension.")
    named = {each.option or each.key: values[each.key] for each in form["inputs"]}
    named |= {"rig": RIG} if kind == "design" else {}
    names: list[str] = []
    options: Plain = {}
    for name, parameter in parameters_of(kind).items():
        value = named.get(name)
        if parameter.kind is Parameter.KEYWORD_ONLY:
            options[name] = value
        elif value is not None:
            names += value if isinstance(value, list) else [value]
    lines = form["python"].format(**{**values, **_python(kind, values), "out": out})
    options.pop("out", None)  # the last word of a command
    return JobRequest(words(kind, *names, **options, out=out), out, is_new=not folder, python=lines)


def _python(kind: str, values: Keyed) -> Plain:
    """Return the values for the placeholders in the Python lines of a command. Empty options are left out."""
    found: Plain = {}
    match kind:
        case "fit":
            if (form := values["pressure"]) != "none":
                found = {"pressure_dependence": True, "pressure": form}
            return {"options": repr(values["law"]) + keywords(**found)}
        case "size":
            found = {name: values[name] for name in ("most", "draws")}
            found["draws_best"] = DRAWS_BEST_OF * values["draws"]
        case "export":
            found = {"version": values["fmi"], "actuator": values["actuator"], "initial": values["initial"]}
        case "identify":
            return {"names": values["free"].split(", ")}
        case "design":
            return {"plan": python("design", fit=values["fit"], rig=RIG, points=values["points"])}
    return {"options": keywords(**found)}


#: Key of a choice -> values with their titles.
CHOICES = {
    "law": tuple((law, law) for law in CANDIDATES),
    "pressure": tuple((form, form) for form in ("none", *PRESSURE_FORMS)),
    "fmi": tuple((version, version) for version in VERSIONS),
    "to": (("fmu", "FMU"), ("c", "Library with header for C")),
}
#: Kind of an input -> initial value of its field if the command has no default.
STARTS = {"number": None, "flag": False}


def _inputs(command: str, given: list[Any], shared: Keyed) -> Iterator[CommandInput]:
    """Yield the inputs of a command. Fields start with the defaults of the command."""
    for one in given:
        table = {"key": one} | shared[one] if isinstance(one, str) else one
        key, kind = table["key"], table["kind"]
        parameter = parameters_of(command).get(table.get("option", key))
        default = parameter.default if parameter is not None else None
        start = default if isinstance(default, str | int) and default else STARTS.get(kind, "")
        table = {"start": start, "choices": CHOICES.get(key, ()), **table, "only": tuple(table.get("only", ()))}
        yield CommandInput(**table)


_FORMS = package_table(__file__, "forms.toml")
#: Command -> its table in ``forms.toml`` (text of the button, forms of result and Python lines), and its inputs.
SIGNATURES = {
    command: form | {"inputs": list(_inputs(command, form["inputs"], _FORMS["shared"]))}
    for command, form in _FORMS.items()
    if command != "shared"
}


def forms(workspace: Workspace) -> Plain:
    """Return the form of each command. A field of recordings offers recordings that have the needed channels."""
    files, offered = workspace.files(), Plain()
    validations = {dirname(file.path) for file in files if file.kind == "validation"}
    for hint in ("rig", ""):
        paths = offered[hint] = []
        for file in files:
            # The runs of a validation are not offered.
            is_run = basename(file.path).startswith("run-") and dirname(file.path) in validations
            if file.kind == "recording" and not is_run and len(paths) < MOST_RECORDINGS:
                with suppress(PneudriveError):  # a damaged file, too, is not offered
                    _check_channels(file.path, workspace, hint)
                    paths.append((file.path, file.path))

    def about(field: CommandInput) -> Plain:
        return vars(field) | ({"choices": offered[field.hint]} if field.kind == "recordings" else {})

    fields = {kind: list(map(about, of["inputs"])) for kind, of in SIGNATURES.items()}
    return {kind: {"title": SIGNATURES[kind]["title"], "fields": own} for kind, own in fields.items()}


def copied_job(workspace: Workspace, given: Plain) -> Plain:
    """Return a job as lines of a shell and as Python."""
    return attributes_of(requested_job(workspace, given), "command", "python")


def requested_job(workspace: Workspace, given: Plain) -> JobRequest:
    """Return the job of a request. The request may name a campaign, or the folder of a search to be continued.

    Raises
    ------
    PneudriveError
        The command is unknown, or an input is not valid.
    """
    kind = given.get("kind", "characterise")
    if not isinstance(kind, str) or kind not in SIGNATURES:
        raise wrong_request()
    if kind == "characterise" and isinstance(campaign := given.get("campaign"), str):
        out = f"{RESULTS}/{folder_name(given.get('name'))}"
        check_folder(workspace, campaign, "campaign")
        return JobRequest(words(kind, campaign, out=out), out, python=python("campaign", folder=campaign))
    if kind == "size" and (folder := given.get("resume")) is not None:
        if is_held(workspace.folder(folder) / LOCK):
            raise CommandError(f"a process searches in {folder} already", remedy="Wait until this process ends.")
        check_folder(workspace, folder)
        return _job_of(kind, {**given, "name": "sizing"}, workspace, folder)
    return _job_of(kind, given, workspace)
