"""Request for a run and for comparisons with the run, and the shell and Python lines that repeat it.

The comparisons are other drives and runs, a band of many members, p-V loops, an animation and an energy balance.
"""

from __future__ import annotations

import math
import re
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, StrictFloat, StrictInt, StrictStr, field_validator

from pneudrive.arrays import Columns, Ints, Keyed, Plain
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.files.load import described_in
from pneudrive.describe.formulas import FILE_PREFIX
from pneudrive.describe.tables.parts import chamber_volumes, double_acting
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.platforms import Platform, platforms
from pneudrive.platforms.kinematics import motion_of, platform_outputs, pose_columns
from pneudrive.progress import Flag, Watch
from pneudrive.simulation.run_view import run_view
from pneudrive.simulation.simulate import Run, positive, run
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns
from pneudrive.units import parse, readable
from pneudrive.views import STATES, Finding, View, worst
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.messages import PageRequest, Pixels, Value, call, shell
from pneudrive.web.workspace import COMMANDS, DESCRIPTIONS, NewNames, Workspace, is_in_catalogue

Described = Drive | Circuit

MOST_SAMPLES = 1_000_000
MOST_SECONDS = 2.0  # longest computing time of a run: the page waits for it
_KEPT = 500  # number of kept descriptions
#: Pattern of a command that is not a file: a number, or times with values, optionally after the name of a component.
_COMMAND = re.compile(r"\s*+(?:[A-Za-z_][\w-]*+(?:\.command)?\s*+:)?\s*+[-+.\d][^/\\]*+", re.DOTALL)
#: Pattern of a command that is a file of the workspace, optionally after the name of a component.
_FILE = re.compile(r"(\s*+(?:[A-Za-z_][\w-]*+(?:\.command)?\s*+:)?\s*+)(\S.*\.csv)\s*+", re.IGNORECASE)


def check_changes(changes: Plain) -> Plain:
    """Reject changed values that name a file.

    Raises
    ------
    CommandError
        A value names a file.
    """
    for key, value in changes.items():
        if isinstance(value, str) and FILE_PREFIX in value:
            raise CommandError(f"{key} = {value[:80]!r} names a file", remedy="Change it in the text of the file.")
    return changes


#: Changed values that a page sends: dotted key -> number or text.
Changes = Annotated[dict[str, Value], AfterValidator(check_changes)]


class RunLimit:
    """Cancel flag of a run. It is set by the reader of the result, or after the time limit."""

    def __init__(self, seconds: float = MOST_SECONDS) -> None:
        self.cancelled = False
        self.allow(seconds)

    def allow(self, seconds: float) -> None:
        """Set the flag after this many seconds."""
        self.seconds, self.end = seconds, time.monotonic() + seconds

    def is_set(self) -> bool:
        """Return whether the run should end."""
        return self.cancelled or time.monotonic() > self.end


class RunRequest(PageRequest):
    """Request for a run, checked as far as possible before its drive is read.

    Attributes
    ----------
    path : str
        Name in the workspace, or ``catalogue:NAME``.
    text : str or None
        Text of the file, if the page has unsaved changes of it.
    changes : dict
        Dotted keys and values, in the form of `replace`.
    command : str or list of str
        As for `pneudrive.simulate`. A file is given by its name in the workspace. A list has one text for each valve of
        a circuit.
    duration, rate, initial : str
        As for `pneudrive.simulate`. An empty `initial` is the default start.
    pixels : int
        Width of the drawing. At most two samples for each pixel are sent.
    """

    path: StrictStr = ""
    text: StrictStr | None = None
    changes: Changes = Field(default_factory=dict)
    command: StrictStr | list[StrictStr] = ""
    duration: StrictStr = ""
    rate: StrictStr = "1 kHz"
    initial: StrictStr = ""
    pixels: Pixels = 1000

    @field_validator("command")
    @classmethod
    def _check_command(cls, command: str | list[str]) -> str | list[str]:
        """Check that each line is a command or the name of a file; remove empty lines of a list."""
        lines = command if isinstance(command, list) else [command]
        for line in lines:
            if line.strip() and not (_FILE if line.lower().rstrip().endswith(".csv") else _COMMAND).fullmatch(line):
                raise CommandError.of("web.command", line=line)
        return [line for line in lines if line.strip()] if isinstance(command, list) else command

    def with_path(self, path: str) -> RunRequest:
        """Return this request for another drive or circuit, without its edited text and its changes of values."""
        return self.model_copy(update={"path": path, "text": None, "changes": {}})

    def run(self, workspace: Workspace, described: Described, cancel: Flag) -> Run:
        """Simulate the drive or circuit `described`, and return its run.

        Raises
        ------
        PneudriveError
            As for `pneudrive.simulate`, or the run is too long for a page.
        Cancelled
            The flag was set, or the time limit is reached.
        """
        check_samples(positive(self.duration, "s", "duration") * positive(self.rate, "1/s", "sample_rate"))
        options: Plain = {"initial": self.initial or None, "sample_rate": self.rate, "watch": Watch(cancel=cancel)}
        return run(described, self.command_of(described, workspace), self.duration, **options)

    def command_of(self, described: Described, workspace: Workspace) -> Any:  # noqa: ANN401 - any form of a command
        """Return the command in the form of a description; files are given by their path.

        Raises
        ------
        CommandError
            The name refers to a file outside the workspace.
        """
        if "" not in described.commandable:
            return [_placed(line, workspace) for line in self.lines] or None
        return _placed(self.command if isinstance(self.command, str) else ", ".join(self.command), workspace)

    def as_command(self, out: str) -> str:
        """Return the shell line that makes the same run in the folder of the workspace, into a file `out`."""
        changes = [f"{key} = {value}" for key, value in self.changes.items()]
        times = {"duration": self.duration, "sample_rate": self.rate}
        return shell("simulate", self.path, command=self.lines, **times, initial=self.initial, set=changes, out=out)

    @property
    def lines(self) -> list[str]:
        """Commands that are not empty."""
        each = self.command if isinstance(self.command, list) else [self.command]
        return [line for line in each if line.strip()]

    def as_python(self, described: Described, number: str = "") -> str:
        """Return the Python lines that make the same run. The names of the variables end with `number`."""
        lines = [f"drive{number} = pn.{type(described).__name__}.load({self.path!r})"]
        if self.changes:
            lines.append(f"drive{number} = drive{number}.replace({dict(self.changes)!r})")
        return "\n".join([*lines, f"run{number} = {self.call('pn.simulate', number, sample_rate=self.rate)}"])

    def call(self, function: str, number: str = "", **options: Any) -> str:  # noqa: ANN401 - any value
        """Return a call in Python with the drive, its command, its duration and its start state."""
        values = (f"drive{number}", repr(self.command or None), repr(self.duration))
        return call(function, *values, initial=self.initial, **options)

    def stem(self) -> str:
        """Return the first part of a file name, for files that are made from the description."""
        return re.sub(r"[^\w.-]+", "-", Path(self.path.rpartition(":")[2]).stem).lstrip("-") or "run"


def check_samples(samples: float) -> None:
    """Reject a run that is too long for the page."""
    if not math.isfinite(samples) or samples > MOST_SAMPLES:
        raise CommandError.of("web.samples", samples=samples, most=MOST_SAMPLES)


def _placed(command: str, workspace: Workspace) -> str:
    """Return a command unchanged, or the path if the command is a file."""
    found = _FILE.fullmatch(command)
    return f"{found[1]}{workspace.path(found[2], COMMANDS)}" if found else command


def described_at(workspace: Workspace, path: str, text: str | None = None) -> Described:
    """Read a drive or a circuit from the workspace, from the catalogue, or from a given text.

    Results are cached, except for descriptions that refer to files.

    Raises
    ------
    CommandError, DescriptionError
        The name refers to a file outside the workspace, or the description is not valid.
    """
    if text is None and not is_in_catalogue(path):
        text = workspace.read(path)[0]
    read = _described.__wrapped__ if text is not None and FILE_PREFIX in text else _described
    return read(workspace, path, text)


@lru_cache(_KEPT)
def _described(workspace: Workspace, path: str, text: str | None) -> Described:
    if text is None:
        return Drive.load(path)
    place = workspace.root / "unnamed.toml" if is_in_catalogue(path) else workspace.path(path)
    name = place.relative_to(workspace.root).as_posix()
    return described_in(text, place, lambda tables: workspace.check_named(name, tables))


def with_changes(described: Described, changes: Keyed) -> Described:
    """Return a drive or a circuit with changed values, which have passed `check_changes`.

    Raises
    ------
    CommandError, DescriptionError
        A value is not valid.
    """
    try:
        return described.replace(dict(changes)) if changes else described
    except TypeError:  # a key below a value; fields of the page have no such keys
        raise CommandError(f"{', '.join(changes)[:200]} cannot be changed here", remedy="Reload the page.") from None


# --- Comparisons with a run: other drives and runs, a band of many members, p-V loops, animation.

MOST_OTHERS = 7  # with the run itself, as many as there are line styles
MEMBERS, BAND_SAMPLES = 200, 200  # samples of a band: its plot is about 400 pixels wide
#: Relative tolerance of the members of a band. For each drive of the catalogue, the edges of the band differ by at most
#: 0.3 pixels from those at a tolerance of 1e-8.
BAND_RTOL = 1e-4
BAND = (0.05, 0.95)  # quantiles of the members at the edges of the band
MOST_BAND_SECONDS = 10.0  # time for a band or an energy balance, s: the first one imports modules
#: Columns shown in the drawing, and number of samples of each.
_ANIMATED, MOTION_SAMPLES = re.compile(r"(?:pressure|mass_flow)\w*$|\.position$|position_m$|command$"), 400
PATH_SAMPLES, MOST_REACHED = 200, 32  # points of the path of another run; mechanisms whose workspace is kept
#: Pattern of a hazard of one cylinder: first word, name of the cylinder, and the rest.
_OF_CYLINDER = re.compile(r"(\w[\w ]*: )([A-Za-z_]\w*): (.*)", re.DOTALL)
TRAJECTORIES = (".parquet", ".csv", ".nc")
#: Key of a value, end of its spread, and its unit.
Key = Annotated[StrictStr, Field(pattern=r"^[A-Za-z_][\w-]*(?:\.[\w-]+)*$")]
Number = StrictInt | Annotated[StrictFloat, Field(allow_inf_nan=False)]
Unit = Annotated[StrictStr, Field(pattern=r"^(?:[A-Za-z°%][\w /^*.()°%-]*)?$")]
#: Columns of a cylinder, in a circuit (with its name) and in a drive: position, pressures of chambers a and b.
_PLACES = (("{}.position_m", "{}.a.pressure_pa", "{}.b.pressure_pa"), ("position_m", "pressure_a_pa", "pressure_b_pa"))


class ExtrasRequest(RunRequest):
    """A run and the requested comparisons with it.

    Attributes
    ----------
    others : tuple of str
        Drives and circuits to run with the same command, and trajectory files; from the workspace or the catalogue.
    spreads : dict
        Key of a value -> both ends of its range, and their unit. The members are spaced evenly over this range.
    loops, motion, energy : bool
        Whether to return p-V loops, the data for an animation of the cylinders, and the energy balance.
    """

    others: Annotated[tuple[StrictStr, ...], Field(max_length=MOST_OTHERS)] = ()
    spreads: dict[Key, tuple[Number, Number, Unit]] = Field(default_factory=dict)
    loops: bool = False
    motion: bool = False
    energy: bool = False

    def answer(
        self,
        workspace: Workspace,
        described: Described,
        run: Run,
        shown: Sequence[str],
        limit: RunLimit,
    ) -> tuple[Plain, Columns]:
        """Return head and arrays of the comparisons with the run of `described`. `shown` lists the drawn columns.

        Raises
        ------
        PneudriveError
            A name refers to a file outside the workspace, a description is not valid, or a run fails.
        Cancelled
            The time limit is reached, or the page no longer waits.
        """
        arrays: Columns = {}
        others, compared = [], {}
        references = list(map(_reference, shown)) if self.motion else []
        for number, path in enumerate(self.others, start=1):
            compared[path] = self._other(workspace, path, ["time_s", *shown, *references], limit)
            columns = {name: values for name, values in compared[path].items() if name not in references}
            arrays |= {f"{number}/{name}": values for name, values in drawn_columns(columns, self.pixels).items()}
            others.append({"path": path, **_differences(run.columns, columns)})
        head: Plain = {"others": others, "cylinders": [one for _, one in _cylinders(described, run.columns)]}
        if self.motion:
            rows = np.linspace(0, len(run.columns["time_s"]) - 1, MOTION_SAMPLES).round().astype(int)
            moving = [column for column in run.columns if column == "time_s" or _ANIMATED.search(column)]
            arrays |= {f"motion/{name}": run.columns[name][rows] for name in moving}
            head["platforms"], own = platform_motion(described, run, rows, compared)
            arrays |= own
        if self.loops:
            found = _loops(described, run.columns, self.pixels)
            head["loops"] = list(found)
            arrays |= {f"loop/{name}/{axis}": values for name, pair in found.items() for axis, values in pair.items()}
        if self.energy:
            limit.allow(MOST_BAND_SECONDS)
            from pneudrive.datasheet.characteristics.air import energy_balance

            command, initial = self.command_of(described, workspace), self.initial or None
            balance = energy_balance(described, command, self.duration, initial=initial, cancel=limit)
            head["energy"] = balance.view().data()
        if self.spreads:
            limit.allow(MOST_BAND_SECONDS)
            band, of = self._band(workspace, described, shown, limit)
            head["band"], arrays = band, arrays | of
        return head, arrays

    def _other(self, workspace: Workspace, path: str, columns: Sequence[str], limit: RunLimit) -> Columns:
        """Return columns of another drive with the same command, or of a trajectory file."""
        if _is_described(path):
            try:
                found = self.with_path(path).run(workspace, described_at(workspace, path), limit).columns
            except PneudriveError as error:
                error.where = error.where or path  # the file is not that of the run
                raise
            return {name: found[name] for name in columns if name in found}
        place = workspace.path(path, TRAJECTORIES)
        names = columns_in(place, columns)
        if "time_s" not in names or len(names) < 2:
            raise CommandError.of("web.columns", path=path)
        found = read_columns(place, names)
        time = found["time_s"]
        if not (len(time) and np.isfinite(time).all() and (np.diff(time) >= 0.0).all()):
            raise CommandError(f"the times in {path} do not increase", remedy="Choose another file.")
        return found

    def _band(
        self, workspace: Workspace, described: Described, shown: Sequence[str], limit: RunLimit
    ) -> tuple[Plain, Columns]:
        from pneudrive.ensemble.design import Rows, design_of
        from pneudrive.ensemble.many import run_study, study_of
        from pneudrive.ensemble.variation import DONE

        study = study_of(
            described,
            self.command_of(described, workspace),
            self.duration,
            vary=design_of(self.vary, MEMBERS),
            outputs=self.outputs(shown),
            initial=self.initial or None,
            rtol=BAND_RTOL,
            refuse=False,
        )
        rows, why = study.rows.take(0, study.rows.size), ""
        try:
            study.rows.check(study.variation)
        except CommandError as error:  # only the valid members are run
            why, kept, watch = error.what, [], Watch(cancel=limit)
            for row in rows:
                watch.tell(len(kept), len(rows), "members read")
                if study.variation.fault(row) is None:
                    kept.append(row)
            rows = np.array(kept)
        head = {"members": MEMBERS, "share": BAND, "ends": {}, "failed": MEMBERS, "why": why, "refused": bool(why)}
        if not len(rows):
            return head, {}
        study = replace(study, rows=Rows.table(study.variation.names, rows))
        many = run_study(study, Watch(cancel=limit))
        whole = many.frame["status"].to_numpy() == DONE
        head["why"] = why or next(filter(None, many.frame["reason"]), "")
        if not whole.any():
            return head, {}
        arrays = {"band/time_s": study.sample_times(study.outputs[0].rate_hz)}
        ends = {}
        for column, values in zip(shown, many.values, strict=True):
            low, high = np.quantile(values[whole], BAND, axis=0)
            arrays |= {f"band/{column}/low": low, f"band/{column}/high": high}
            ends[column] = [low[-1], high[-1]]
        return head | {"failed": MEMBERS - int(whole.sum()), "ends": ends}, arrays

    @property
    def vary(self) -> Plain:
        """Range of each varied value, as `pneudrive.simulate_many` takes it."""
        ends = {key: [f"{end!r} {unit}".strip() for end in of] for key, (*of, unit) in self.spreads.items()}
        return {key.removeprefix("components."): f"uniform({', '.join(texts)})" for key, texts in ends.items()}

    def outputs(self, columns: Sequence[str]) -> list[str]:
        """Return the outputs of the members for drawn columns."""
        rate = BAND_SAMPLES / parse(self.duration, "s")
        return [f"samples({meaning(column)[0]}, {rate!r} Hz)" for column in columns]


def copied(workspace: Workspace, request: ExtrasRequest, columns: tuple[str, ...] = ()) -> dict[str, str]:
    """Return a run and its comparisons as lines of a shell and as Python."""
    path, text = request.path, request.text
    if text is not None and (is_in_catalogue(path) or workspace.read(path)[0] != text):
        raise CommandError.of("web.unsaved", path=path)  # the copied command reads the file
    names = NewNames(workspace)
    out = names.of(request.stem())
    run = request.as_python(described_at(workspace, path, text))
    lines, code = [request.as_command(out)], ["import pneudrive as pn", "", run]
    for number, other in enumerate(request.others, start=1):
        if _is_described(other):
            same = request.with_path(other)
            lines.append(same.as_command(names.of(same.stem())))
            code.append(same.as_python(described_at(workspace, other), f"_{number}"))
        else:
            code.append(f"run_{number} = pn.load({other!r})")
    if request.energy:
        lines.append(f"{lines[0]} --energy")
        code.append(f"energy = {request.call('pn.energy_balance')}")
    if request.spreads:
        vary, outputs = request.vary, request.outputs(columns)
        sweep = shell(
            "sweep",
            path,
            duration=request.duration,
            command=request.lines,
            initial=request.initial,
            set=[f"{key} = {value}" for key, value in request.changes.items()],
            vary=[f"{key} = {text}" for key, text in vary.items()],
            output=outputs,
            members=MEMBERS,
            rtol=BAND_RTOL,
            out=names.of(f"{request.stem()}-band"),
        )
        lines.append(sweep)
        many = request.call("pn.simulate_many", vary=vary, n=MEMBERS, outputs=outputs, rtol=BAND_RTOL)
        each = f'name: many[name].quantile({list(BAND)!r}, "member")'
        band = f"band = {{{each} for name in many.data_vars if many[name].dims == ('member', 'time')}}"
        code += [f"many = {many}", band]
    return {"command": "\n".join(lines).strip(), "python": "\n".join([*code, ""])}


def _is_described(path: str) -> bool:
    return is_in_catalogue(path) or path.lower().endswith(DESCRIPTIONS)


def _differences(run: Columns, other: Columns) -> dict[str, dict[str, float]]:
    """Return the last values of another run, and its largest differences from a run over their common time.

    Samples with NaN are left out.
    """
    ends, largest = {}, {}
    time, own = other["time_s"], run["time_s"]
    inside = (own >= time[0]) & (own <= time[-1])
    for name, values in other.items():
        if name != "time_s":
            ends[name] = values[-1]
            off = np.abs(np.interp(own[inside], time, values) - run[name][inside])
            largest[name] = off.max() if len(off) else math.nan
    told = {"ends": ends, "largest": largest}
    return {what: {name: one for name, one in of.items() if math.isfinite(one)} for what, of in told.items()}


def _cylinders(described: Described, columns: Columns) -> Iterator[tuple[Plain, Plain]]:
    """Yield each double-acting cylinder, and its name, stroke and columns."""
    for name, cylinder in double_acting(described.circuit.core_json()).items():
        for place in _PLACES:
            position, *pressures = (one.format(name) for one in place)
            if all(one in columns for one in (position, *pressures)):
                stroke = cylinder["numbers"]["stroke"]
                yield cylinder, {"name": name, "stroke_m": stroke, "position": position, "pressures": pressures}
                break


def _loops(described: Described, columns: Columns, pixels: int) -> dict[str, Columns]:
    """Return volume and pressure of each chamber. Long runs are thinned."""
    count = len(columns["time_s"])
    part = slice(None) if count <= 2 * pixels + 1 else np.linspace(0, count - 1, 2 * pixels).astype(int)
    out = {}
    for cylinder, one in _cylinders(described, columns):
        volumes = chamber_volumes(cylinder, columns[one["position"]][part])
        for end, volume, pressure in zip("ab", volumes, one["pressures"], strict=True):
            out[f"{one['name']}.{end}"] = {"volume_m3": volume, "pressure_pa": columns[pressure][part]}
    return out


def platform_motion(
    described: Described, run: Run, rows: Ints, others: Mapping[str, Columns]
) -> tuple[list[Plain], Columns]:
    """Return the platforms of a run as plain data, and arrays of their points and outputs at some of its samples."""
    if not (each := platforms(described)):
        return [], {}
    from pneudrive.report.platform import platform_lines, platform_run_view, run_columns  # it imports what draws

    sent, arrays = [], {}
    for own in each:
        poses = pose_columns(own)[0]
        known = [name for name in run_columns(own) if name in run.columns]
        some = {name: run.columns[name][rows] for name in known}
        outputs = {name: some[name] for name in poses} | platform_outputs(own, some)
        pose = motion_of(own, some)[0]
        *lines, (_, _, path) = platform_lines(own, pose)
        moving, parts = [], []
        for part, leg, points in lines:
            rests = len(points) == 1 < len(rows)
            at_rest, count = (points[0], 0) if rests else ([], points.shape[1])
            parts.append({"part": part, "leg": leg, "points": at_rest, "moving": count})
            moving += [] if rests else [points]
        points = np.concatenate([*moving, path, own.traced(pose)[:, None]], axis=1)
        arrays[f"platform/{own.name}"] = points.astype("f4").ravel()
        arrays |= {f"motion/{name}": values for name, values in outputs.items()}
        legs = [
            {"name": leg.name, "force": f"{own.name}.leg_{i}_force_n", "limits": limit}
            for i, (leg, limit) in enumerate(zip(own.legs, own.force_limits, strict=True), start=1)
        ]
        paths = []  # of each other run with this platform, and of its reference
        for path_of, columns in others.items():
            at = np.linspace(0, len(columns["time_s"]) - 1, PATH_SAMPLES).round().astype(int)
            for label, names in ((path_of, poses), (f"reference of {path_of}", list(map(_reference, poses)))):
                if all(name in columns for name in names):
                    known_poses = [np.asarray(columns[name], dtype=float)[at] for name in names]
                    paths.append({"label": label, "points": own.traced(np.column_stack(known_poses))})
        point = f"tip of the normal of {own.name}" if own.normal_m else f"origin of {own.name}"
        about = []
        for column in outputs:
            name, si_unit, _ = meaning(column)
            size, unit = readable(si_unit)
            label = name.partition(".")[2].replace("_", " ")
            about.append({"column": column, "label": label, "unit": unit, "size": size})
        view = _run_answer(platform_run_view(own, some), run)
        told = {"name": own.name, "traced": point, "view": view, "reach": _reach(own)}
        sent.append(told | {"parts": parts, "legs": legs, "paths": paths, "outputs": about})
    return sent, arrays


def _run_answer(view: View, run: Run) -> Plain:
    """Return sentence and numbers of a platform, with the strongest impact and the hazards of the run."""
    of_run = run_view(run.columns, run.provenance)
    hardest = tuple(one for one in of_run.leading if one.key == "hardest impact")
    alike: dict[str, list[str]] = {}  # what one leg does, the others often do too
    for text in (finding.text for finding in of_run.findings if finding.state == "bad"):
        hazard, name, rest = found.groups() if (found := _OF_CYLINDER.fullmatch(text)) else (text, "", "")
        alike.setdefault(f"{hazard}{{}}: {rest}" if name else text, []).append(name)
    findings = tuple(Finding(text.replace("{}", ", ".join(names), 1), "bad") for text, names in alike.items())
    state = max((view.state, worst(findings)), key=STATES.index)
    answer = View(view.title, state=state, leading=(*hardest, *view.leading), findings=findings)
    return answer.data()


def _reference(column: str) -> str:
    """Return the column with the reference of a coordinate, for a run under control."""
    name, _, unit = column.rpartition("_")
    return f"{name}_reference_{unit}"


_REACHED: dict[str, list[tuple[float, float, float]]] = {}


def _reach(own: Platform) -> list[tuple[float, float, float]]:
    """Return the outermost points (m) that a platform reaches. Cached: most sliders do not change the mechanism."""
    key = repr((own.core.joints, own.legs, own.home.tolist()))
    if key not in _REACHED:
        if len(_REACHED) >= MOST_REACHED:
            _REACHED.clear()
        _REACHED[key] = own.reach().tolist()
    return _REACHED[key]
