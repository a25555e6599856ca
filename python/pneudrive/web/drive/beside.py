"""Comparisons with a run in Simulate: other drives and runs, a band of many members, p-V loops, animation."""

from __future__ import annotations

import math
import re
import shlex
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field, StrictStr, field_validator

from pneudrive.describe.tables.geometry import chamber_sizes
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.progress import Watch
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns
from pneudrive.units import parse
from pneudrive.web.drive.platforms import platform_motion
from pneudrive.web.drive.run_request import RunRequest, described_at
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.requests import WRONG_REQUEST, PageRequest
from pneudrive.web.workspace import DESCRIPTIONS, NewNames, is_in_catalogue, safe

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.ensemble.study import EnsembleStudy
    from pneudrive.simulation.simulate import Run
    from pneudrive.web.drive.run_request import RunLimit
    from pneudrive.web.workspace import Workspace

    Array = NDArray[Any]

MOST_OTHERS = 7  # with the run itself, as many as there are line styles
MEMBERS, BAND_SAMPLES = 200, 200  # samples of a band: its plot is about 400 pixels wide
#: Of its members: against 1e-8 its edges move by at most 0.3 of a pixel, for each of the catalogue's seven drives.
BAND_RTOL = 1e-4
BAND = (0.05, 0.95)  # quantiles of the members at the edges of the band
MOST_SECONDS = 10.0  # time for a band, s: the first one imports modules
#: Columns that the drawing shows, and the samples of each.
_ANIMATED, MOTION_SAMPLES = re.compile(r"(?:pressure|mass_flow)\w*$|\.position$|position_m$|command$"), 400
TRAJECTORIES = (".parquet", ".csv", ".nc")
_KEY, _UNIT = re.compile(r"[A-Za-z_][\w-]*(?:\.[\w-]+)*"), re.compile(r"[A-Za-z°%][\w /^*.()°%-]*|")
#: Columns of a cylinder behind its name, of a circuit and of a drive: position, pressures of chambers a and b.
_PLACES = (("{}.position_m", "{}.a.pressure_pa", "{}.b.pressure_pa"), ("position_m", "pressure_a_pa", "pressure_b_pa"))


class ExtrasRequest(PageRequest):
    """Requested comparisons with a run.

    Attributes
    ----------
    others : tuple of str
        Drives and circuits, run with the same command, and trajectory files; of the workspace or the catalogue.
    spreads : dict
        Key of a value -> its two ends as text, between which members lie evenly.
    loops, motion, energy : bool
        Whether to return p-V loops, the data for an animation of the cylinders, and the balance of energy.
    """

    others: Annotated[tuple[StrictStr, ...], Field(max_length=MOST_OTHERS)] = ()
    spreads: dict[str, Any] = Field(default_factory=dict)
    loops: bool = False
    motion: bool = False
    energy: bool = False

    @field_validator("spreads")
    @classmethod
    def _read_spreads(cls, spreads: dict[str, Any]) -> dict[str, tuple[str, str]]:
        return {key: _ends(key, ends) for key, ends in spreads.items()}

    def answer(
        self,
        workspace: Workspace,
        asked: RunRequest,
        described: Drive | Circuit,
        run: Run,
        shown: Sequence[str],
        limit: RunLimit,
    ) -> tuple[dict[str, Any], dict[str, Array]]:
        """Return head and arrays of the comparisons with the run of `described`. `shown` are the drawn columns.

        Raises
        ------
        PneudriveError
            A name leads out of the workspace, a description is not valid, or a run fails.
        Cancelled
            The time is over, or the page no longer waits.
        """
        arrays: dict[str, Array] = {}
        others = []
        for number, path in enumerate(self.others, start=1):
            columns = _other(workspace, asked, path, ["time_s", *shown], limit)
            arrays |= {f"{number}/{name}": values for name, values in drawn_columns(columns, asked.pixels).items()}
            others.append({"path": path, **_differences(run.columns, columns)})
        head: dict[str, Any] = {"others": others}
        if self.motion:
            head["cylinders"] = list(_cylinders(described, run.columns))
            rows = np.linspace(0, len(run.columns["time_s"]) - 1, MOTION_SAMPLES).round().astype(int)
            arrays |= _moving(run.columns, rows)
            head["platforms"], own = platform_motion(described, run.columns, rows)
            arrays |= own
        if self.loops:
            found = _loops(described, run.columns, asked.pixels)
            head["loops"] = list(found)
            arrays |= {f"loop/{name}/{axis}": values for name, pair in found.items() for axis, values in pair.items()}
        if self.energy:
            limit.allow(MOST_SECONDS)
            head["energy"] = _energy(described, asked.command_of(described, workspace), asked, limit)
        if self.spreads:
            limit.allow(MOST_SECONDS)
            band, of = self._band(workspace, described, asked, shown, limit)
            head["band"], arrays = band, arrays | of
        return head, arrays

    def _band(
        self, workspace: Workspace, described: Drive | Circuit, asked: RunRequest, shown: Sequence[str], limit: RunLimit
    ) -> tuple[dict[str, Any], dict[str, Array]]:
        from pneudrive.ensemble.engine import DONE
        from pneudrive.ensemble.many import Gathered, results, study_of
        from pneudrive.ensemble.rows import TableRows

        names = [meaning(column)[0] for column in shown]
        study = study_of(
            described,
            asked.command_of(described, workspace),
            asked.duration,
            vary=self._vary(),
            n=MEMBERS,
            outputs=[self._output(asked, name) for name in names],
            initial=asked.initial or None,
            rtol=BAND_RTOL,
            refuse=False,
        )
        rows, why = _valid(study, limit)
        head = {"members": MEMBERS, "share": BAND, "ends": {}, "failed": MEMBERS, "why": why, "refused": bool(why)}
        if not len(rows):
            return head, {}
        study = replace(study, rows=TableRows(tuple(study.variation.names), rows))
        many = Gathered(study)
        for result in results(study, None, None, None, Watch(cancel=limit)):
            many.take(result)
        whole = many.status == DONE
        head["why"] = why or next(filter(None, many.reason), "")
        if not whole.any():
            return head, {}
        arrays = {"band/time_s": study.sample_times(study.outputs[0].rate_hz)}
        ends = {}
        for column, values in zip(shown, many.values, strict=True):
            ordered = np.sort(values[whole].T, axis=1)
            low, high = (_quantile(ordered, share) for share in BAND)
            arrays |= {f"band/{column}/low": low, f"band/{column}/high": high}
            ends[column] = [float(low[-1]), float(high[-1])]
        return head | {"failed": MEMBERS - int(whole.sum()), "ends": ends}, arrays

    def _vary(self) -> dict[str, str]:
        return {key.removeprefix("components."): f"uniform({low}, {high})" for key, (low, high) in self.spreads.items()}

    @staticmethod
    def _output(asked: RunRequest, name: str) -> str:
        return f"samples({name}, {BAND_SAMPLES / parse(asked.duration, 's')!r} Hz)"

    def as_command(self, asked: RunRequest, shown: Sequence[str], out: str, names: NewNames) -> str:
        """Return the shell lines that make the comparisons with the run written to `out`."""
        others = [asked.with_path(path) for path in self.others if _is_described(path)]
        lines = [one.as_command(names.of(one.stem())) for one in others]
        lines += [f"{asked.as_command(out)} --energy"] if self.energy else []
        if self.spreads:
            words = ["pneudrive", "sweep", safe(asked.path), "--duration", asked.duration, *asked.command_words()]
            words += ["--initial", asked.initial] if asked.initial else []
            for key, value in asked.changes.items():
                words += ["--set", f"{key} = {value}"]
            for key, text in self._vary().items():
                words += ["--vary", f"{key} = {text}"]
            for column in shown:
                words += ["--output", self._output(asked, meaning(column)[0])]
            words += ["--members", str(MEMBERS), "--rtol", str(BAND_RTOL)]
            lines.append(shlex.join([*words, "--out", names.of(f"{asked.stem()}-band")]))
        return "\n".join(lines)

    def as_python(self, workspace: Workspace, asked: RunRequest, shown: Sequence[str]) -> str:
        """Return the Python lines that make the comparisons, after those of the run."""
        lines = []
        for number, path in enumerate(self.others, start=1):
            if _is_described(path):
                one = asked.with_path(path)
                own = one.as_python(described_at(workspace, path)).splitlines()[2:]
                lines += [line.replace("drive", f"drive_{number}", 1) for line in own[:-1]]
                lines.append(own[-1].replace("run =", f"run_{number} =").replace("(drive,", f"(drive_{number},"))
            else:
                lines += _reading(f"run_{number}", path)
        if self.energy:
            command, initial = asked.python_options()
            lines.append(f"energy = pn.energy_balance(drive, {command!r}, {asked.duration!r}{initial})")
        if self.spreads:
            outputs = [self._output(asked, meaning(column)[0]) for column in shown]
            command = asked.command if not isinstance(asked.command, list) or asked.command else None
            options = f"vary={self._vary()!r}, n={MEMBERS}, outputs={outputs!r}, rtol={BAND_RTOL!r}"
            options += f", initial={asked.initial!r}" if asked.initial else ""
            lines.append(f"many = pn.simulate_many(drive, {command!r}, {asked.duration!r}, {options})")
            each = f'name: many[name].quantile({list(BAND)!r}, "member")'
            lines.append(f"band = {{{each} for name in many.data_vars if many[name].dims == ('member', 'time')}}")
        return "\n".join([*lines, ""]) if lines else ""


def copied(workspace: Workspace, given: Mapping[str, Any]) -> dict[str, str]:
    """Return a run and its comparisons as lines of a shell and as Python."""
    asked, beside = RunRequest.of(given), ExtrasRequest.of(given)
    asked.check_saved(workspace)
    columns = given.get("columns", [])
    columns = [name for name in columns if isinstance(name, str)] if isinstance(columns, list) else []
    python = asked.as_python(described_at(workspace, asked.path, asked.text)) + beside.as_python(
        workspace, asked, columns
    )
    names = NewNames(workspace)
    out = names.of(asked.stem())
    return {
        "command": f"{asked.as_command(out)}\n{beside.as_command(asked, columns, out, names)}".strip(),
        "python": python,
    }


def _valid(study: EnsembleStudy, limit: RunLimit) -> tuple[Array, str]:
    """Return the valid rows of a study, and the reason why the first invalid row is not valid."""
    rows = study.rows.take(0, study.rows.size)
    try:
        study.variation.check(rows)
    except CommandError as error:
        watch, kept = Watch(cancel=limit), []
        for row in rows:
            watch.tell(len(kept), len(rows), "members read")
            with suppress(PneudriveError):
                study.variation.try_row(row)
                kept.append(row)
        return np.array(kept), error.what
    return rows, ""


def _reading(name: str, path: str) -> list[str]:
    """Return the lines of Python that read a trajectory file."""
    if path.endswith(".nc"):
        return ["import xarray as xr", f"{name} = xr.load_dataset({path!r})"]
    return ["import polars as pl", f"{name} = pl.read_{path.rpartition('.')[2]}({path!r})"]


def _quantile(ordered: Array, share: float) -> Array:
    """Return a quantile of each sorted row, with the same bits as `numpy.quantile` in a fifth of its time."""
    part, place = math.modf(share * (ordered.shape[1] - 1))
    below, above = ordered[:, int(place)], ordered[:, min(int(place) + 1, ordered.shape[1] - 1)]
    step = above - below
    return below + step * part if part < 0.5 else above - step * (1.0 - part)


def _ends(key: object, given: object) -> tuple[str, str]:
    """Read the ends of a spread: two numbers and their unit."""
    if not isinstance(key, str) or not _KEY.fullmatch(key) or not isinstance(given, list) or len(given) != 3:
        raise CommandError(WRONG_REQUEST, remedy="Reload the page.")
    low, high, unit = given
    numbers = all(
        isinstance(one, int | float) and not isinstance(one, bool) and math.isfinite(one) for one in (low, high)
    )
    if not numbers or not isinstance(unit, str) or not _UNIT.fullmatch(unit):
        raise CommandError(f"the spread of {key} must be two numbers", remedy="Give two numbers.")
    if not low < high:
        raise CommandError(f"the spread of {key} is empty", value=f"{low:g} to {high:g}", rule="low < high")
    return f"{low!r} {unit}".strip(), f"{high!r} {unit}".strip()


def _is_described(path: str) -> bool:
    return is_in_catalogue(path) or path.lower().endswith(DESCRIPTIONS)


def _other(
    workspace: Workspace, asked: RunRequest, path: str, columns: Sequence[str], limit: RunLimit
) -> dict[str, Array]:
    """Return columns of another drive with the same command, or of a trajectory file."""
    if _is_described(path):
        try:
            found = asked.with_path(path).run(workspace, limit).columns
        except PneudriveError as error:
            error.where = error.where or path  # the file is not that of the run
            raise
        return {name: np.asarray(found[name]) for name in columns if name in found}
    place = workspace.path(path, TRAJECTORIES)
    names = columns_in(place, columns)
    if "time_s" not in names or len(names) < 2:
        raise CommandError(
            f"{path} is not a trajectory of such a drive", rule="a file with the columns of pneudrive simulate"
        )
    found = read_columns(place, names)
    time = found["time_s"]
    if not len(time) or not (np.isfinite(time).all() and (np.diff(time) >= 0.0).all()):
        raise CommandError(f"{path} has no samples whose times rise", remedy="Choose another file.")
    return found


def _differences(run: Mapping[str, Array], other: Mapping[str, Array]) -> dict[str, dict[str, float]]:
    """Return the last values of another run, and the largest differences from a run at its times inside both.

    NaN is left out.
    """
    ends, largest = {}, {}
    time, own = np.asarray(other["time_s"]), np.asarray(run["time_s"])
    inside = (own >= time[0]) & (own <= time[-1])
    for name, values in other.items():
        if name != "time_s":
            ends[name] = float(values[-1])
            off = np.abs(np.interp(own[inside], time, values) - np.asarray(run[name])[inside])
            largest[name] = float(off.max()) if len(off) else math.nan
    told = {"ends": ends, "largest": largest}
    return {what: {name: one for name, one in of.items() if math.isfinite(one)} for what, of in told.items()}


def _moving(columns: Mapping[str, Array], rows: NDArray[np.int64]) -> dict[str, Array]:
    """Return pressures, flows and valve positions at some samples, for an animation of the drawing."""
    names = [column for column in columns if column == "time_s" or _ANIMATED.search(column)]
    return {f"motion/{name}": np.asarray(columns[name], dtype=np.float64)[rows] for name in names}


def _cylinders(described: Drive | Circuit, columns: Mapping[str, Array]) -> Iterator[dict[str, Any]]:
    """Yield name, stroke and columns of each double-acting cylinder."""
    for name, sizes in chamber_sizes(described.circuit.core_json()).items():
        for place in _PLACES:
            position, *pressures = (one.format(name) for one in place)
            if all(one in columns for one in (position, *pressures)):
                yield {"name": name, "stroke_m": sizes.stroke_m, "position": position, "pressures": pressures}
                break


def _energy(described: Drive | Circuit, command: Any, asked: RunRequest, limit: RunLimit) -> dict[str, Any]:  # noqa: ANN401 - any form of a command
    """Return the balance of energy of the run as plain data."""
    from pneudrive.datasheet.characteristics.air import energy_balance

    found = energy_balance(described, command, asked.duration, initial=asked.initial or None, cancel=limit)
    return {**vars(found), "air_litres_anr": found.air_litres_anr}


def _loops(described: Drive | Circuit, columns: Mapping[str, Array], pixels: int) -> dict[str, dict[str, Array]]:
    """Return volume and pressure of each chamber. Long runs are thinned."""
    each = chamber_sizes(described.circuit.core_json())
    count = len(columns["time_s"])
    part = slice(None) if count <= 2 * pixels + 1 else np.linspace(0, count - 1, 2 * pixels).astype(int)
    out = {}
    for one in _cylinders(described, columns):
        volumes = each[one["name"]].volumes_m3(np.asarray(columns[one["position"]])[part])
        for end, volume, pressure in zip("ab", volumes, one["pressures"], strict=True):
            out[f"{one['name']}.{end}"] = {"volume_m3": volume, "pressure_pa": np.asarray(columns[pressure])[part]}
    return out
