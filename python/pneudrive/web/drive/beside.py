"""Comparisons with a run in Simulate: other drives and runs, a band of many members, p-V loops, animation."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, StrictStr, field_validator

from pneudrive.describe.tables.geometry import chamber_volumes, double_acting
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.platforms import Platform, platforms
from pneudrive.platforms.kinematics import motion_of, platform_outputs, pose_columns
from pneudrive.progress import Watch
from pneudrive.simulation.run_view import run_view
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns
from pneudrive.units import parse, readable
from pneudrive.views import STATES, Finding, View, worst
from pneudrive.web.drive.run_request import Described, Run, RunLimit, RunRequest, described_at
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.messages import shell, wrong_request
from pneudrive.web.workspace import DESCRIPTIONS, NewNames, Workspace, is_in_catalogue

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pneudrive.arrays import Columns, Ints, Plain

MOST_OTHERS = 7  # with the run itself, as many as there are line styles
MEMBERS, BAND_SAMPLES = 200, 200  # samples of a band: its plot is about 400 pixels wide
#: Relative tolerance of the members of a band. Compared with 1e-8, the edges of the band move by at most 0.3 pixels for
#: each drive of the catalogue.
BAND_RTOL = 1e-4
BAND = (0.05, 0.95)  # quantiles of the members at the edges of the band
MOST_SECONDS = 10.0  # time for a band, s: the first one imports modules
#: Columns shown in the drawing, and number of samples of each.
_ANIMATED, MOTION_SAMPLES = re.compile(r"(?:pressure|mass_flow)\w*$|\.position$|position_m$|command$"), 400
PATH_SAMPLES, MOST_REACHED = 200, 32  # points of the path of another run; mechanisms whose workspace is kept
#: Pattern of a hazard of one cylinder: first word, name of the cylinder, and the rest.
_OF_CYLINDER = re.compile(r"(\w[\w ]*: )([A-Za-z_]\w*): (.*)", re.DOTALL)
TRAJECTORIES = (".parquet", ".csv", ".nc")
_KEY, _UNIT = re.compile(r"[A-Za-z_][\w-]*(?:\.[\w-]+)*"), re.compile(r"[A-Za-z°%][\w /^*.()°%-]*|")
#: Columns of a cylinder, in a circuit (with its name) and in a drive: position, pressures of chambers a and b.
_PLACES = (("{}.position_m", "{}.a.pressure_pa", "{}.b.pressure_pa"), ("position_m", "pressure_a_pa", "pressure_b_pa"))


class ExtrasRequest(RunRequest):
    """A run and the requested comparisons with it.

    Attributes
    ----------
    others : tuple of str
        Drives and circuits to run with the same command, and trajectory files; from the workspace or the catalogue.
    spreads : dict
        Key of a value -> text with both ends of its range. The members are spaced evenly over this range.
    loops, motion, energy : bool
        Whether to return p-V loops, the data for an animation of the cylinders, and the energy balance.
    """

    others: Annotated[tuple[StrictStr, ...], Field(max_length=MOST_OTHERS)] = ()
    spreads: dict[str, Any] = Field(default_factory=dict)
    loops: bool = False
    motion: bool = False
    energy: bool = False

    @field_validator("spreads")
    @classmethod
    def _read_spreads(cls, spreads: Plain) -> Plain:
        return {key: _ends(key, ends) for key, ends in spreads.items()}

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
            limit.allow(MOST_SECONDS)
            from pneudrive.datasheet.characteristics.air import energy_balance

            command, initial = self.command_of(described, workspace), self.initial or None
            balance = energy_balance(described, command, self.duration, initial=initial, cancel=limit)
            head["energy"] = balance.view().data()
        if self.spreads:
            limit.allow(MOST_SECONDS)
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
        if not len(time) or not (np.isfinite(time).all() and (np.diff(time) >= 0.0).all()):
            raise CommandError(f"the times in {path} do not increase", remedy="Choose another file.")
        return found

    def _band(
        self, workspace: Workspace, described: Described, shown: Sequence[str], limit: RunLimit
    ) -> tuple[Plain, Columns]:
        from pneudrive.ensemble.design import Rows, design_of
        from pneudrive.ensemble.many import Members, results, study_of
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
            watch, kept, why = Watch(cancel=limit), [], error.what
            for row in rows:
                watch.tell(len(kept), len(rows), "members read")
                with suppress(PneudriveError):
                    member, initial = study.variation.single(row)
                    member.core_json()
                    member.core_initial(initial)
                    kept.append(row)
            rows = np.array(kept)
        head = {"members": MEMBERS, "share": BAND, "ends": {}, "failed": MEMBERS, "why": why, "refused": bool(why)}
        if not len(rows):
            return head, {}
        study = replace(study, rows=Rows.table(study.variation.names, rows))
        many = Members.of(study, results(study, None, None, None, Watch(cancel=limit)))
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
        return {key.removeprefix("components."): f"uniform({low}, {high})" for key, (low, high) in self.spreads.items()}

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
        elif other.endswith(".nc"):
            code += ["import xarray as xr", f"run_{number} = xr.load_dataset({other!r})"]
        else:
            code += ["import polars as pl", f"run_{number} = pl.read_{other.rpartition('.')[2]}({other!r})"]
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


def _ends(key: object, given: object) -> tuple[str, str]:
    """Read a spread of two numbers and a unit, and return both ends as texts."""
    if not isinstance(key, str) or not _KEY.fullmatch(key) or not isinstance(given, list) or len(given) != 3:
        raise wrong_request()
    low, high, unit = given
    are_finite = all(type(end) in (int, float) and math.isfinite(end) for end in (low, high))
    if not are_finite or not isinstance(unit, str) or not _UNIT.fullmatch(unit):
        raise CommandError(f"the spread of {key} must be two numbers", remedy="Give two numbers.")
    if not low < high:
        raise CommandError(f"the spread of {key} is empty", value=f"{low:g} to {high:g}", rule="low < high")
    return f"{low!r} {unit}".strip(), f"{high!r} {unit}".strip()


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
    """Return the column of the reference of a coordinate in a run under control."""
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
