"""Result of a fit of any kind, and its file: values with intervals and covariance, undetermined values, sources."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import BaseModel, ConfigDict, Field, StrictBool, StrictStr, ValidationError
from typing_extensions import Self

from pneudrive.arrays import Array, Interval, NamedIntervals, NamedNumbers, Pair, Plain
from pneudrive.describe.files import toml
from pneudrive.errors import FitError, nearest, package_table
from pneudrive.estimate.estimates import student, whole_interval
from pneudrive.files.inputs import INPUTS, located, stored_beside
from pneudrive.identify.export import Exported, SlidingCurve, export
from pneudrive.identify.identified import FittedData, Identified, comparison_figure
from pneudrive.lazy_names import upper
from pneudrive.numbers import plain
from pneudrive.simulation.trajectory import write_whole
from pneudrive.units import readable
from pneudrive.views import MOST_LEADING, Finding, ShownFigure, ShownValue, View, Viewed

#: Note of a fit of simulated data.
SIMULATED = "from simulated recordings"
#: Explanation of the numbers after "model ±".
MODEL_ERROR_WORDS = (
    "95 %: interval from noise; model ±: change of the value if each held number has an error of 1 % (assumed)"
)


@dataclass(frozen=True)
class Undetermined:
    """Parameter that the data do not determine.

    Attributes
    ----------
    parameter : str
    reason : str
        Reason in words.
    remedy : str
        Measurement that would determine the parameter.
    """

    parameter: str
    reason: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.parameter} cannot be determined: {self.reason}. Remedy: {self.remedy}."


class Intervals(dict[str, tuple[float, float]]):
    """95 % intervals by name, in SI. Undetermined values have no interval.

    Every result of a fit uses this type, so that no code can print, write or apply an interval of an undetermined
    value.
    """

    def __missing__(self, name: str) -> Interval:
        raise KeyError(f"{name} has no interval: the data do not determine it, or the search did not converge")


def recording_tables(records: Iterable[Any]) -> list[Plain]:
    """Return name, hash, file and duration of each recording, for the provenance of a fit."""
    return [{"name": r.name, "sha256": r.sha256, "file": str(r.source or ""), "seconds": r.duration_s} for r in records]


def names_of(undetermined: Iterable[str | Undetermined]) -> set[str]:
    """Return the names of undetermined values."""
    return {str(getattr(one, "parameter", one)) for one in undetermined}


Number = Annotated[float, Field(strict=True)]
#: Error type of pydantic -> rule in words.
_RULES = {
    "missing": "is missing",
    "string_type": "must be a text",
    "bool_type": "must be true or false",
    "float_type": "must be a number",
    **dict.fromkeys(["list_type", "tuple_type"], "must be a list"),
    **dict.fromkeys(["dict_type", "model_type", "model_attributes_type", "dataclass_type"], "must be a table"),
}


class _Table(BaseModel):
    model_config = ConfigDict(extra="allow")


class FitEntry(_Table):
    """Value of a fit with its interval."""

    value: Number
    unit: StrictStr
    determined: StrictBool = True
    standard_error: Number | None = None
    u_systematic: Number | None = None
    interval: tuple[Number, Number] | None = None
    model_error: Number | None = None


class _Covariance(_Table):
    names: list[StrictStr]
    matrix: list[list[Number]]


class _Recording(_Table):
    name: StrictStr
    seconds: Number = 0.0


class _Provenance(_Table):
    recordings: list[StrictStr | _Recording] = Field(default_factory=list)


class FitFile(_Table):
    """Content of a fit.toml of any kind, checked before its values are used.

    Attributes
    ----------
    groups : list of dict
        Tables of values (name -> entry); the first table has the values of the drive.
    content : dict
        All tables of the file.
    """

    notes: tuple[StrictStr, ...] = ()
    converged: StrictBool = True
    covariance: _Covariance | None = None
    undetermined: list[StrictStr | Undetermined] = Field(default_factory=list)
    statistics: dict[StrictStr, Number]
    provenance: _Provenance
    groups: list[dict[StrictStr, FitEntry]]
    content: dict[str, Any]

    @property
    def entries(self) -> dict[str, FitEntry]:
        """Return the entries of all values, by name."""
        return {name: entry for group in self.groups for name, entry in group.items()}

    @classmethod
    def read(
        cls,
        content: Plain,
        title: str,
        groups: Sequence[str],
        where: str,
        text: str,
    ) -> FitFile:
        """Check keys and types of a file. All groups of values except the first are optional.

        Parameters
        ----------
        content : dict
            Tables of the file.
        title : str
            Name of this kind of fit in messages.
        groups : sequence of str
            Names of the tables with values.
        where, text : str
            Path and text of the file; errors name the line of the first wrong key.

        Raises
        ------
        FitError
            A key is missing, or its value has another type.
        KeyError
            The first table of values is missing.
        """
        values = [content[groups[0]], *(content.get(group, {}) for group in groups[1:])]
        try:
            return cls.model_validate({**content, "groups": values, "content": content})
        except ValidationError as error:
            # The alternative that fits best reports the problem with the longest key.
            problem = max(error.errors(include_url=False), key=lambda one: len(one["loc"]))
            of_values = problem["loc"][0] == "groups"
            parts = (groups[int(problem["loc"][1])], *problem["loc"][2:]) if of_values else problem["loc"]
            name = ".".join(str(part) for part in parts if part not in ("_Recording", "Undetermined", "str"))
            rule = _RULES.get(str(problem["type"]), str(problem["msg"]))
            if line := toml.line_of(text, name):
                where = f"{where}:{line}"
            raise FitError.of("identify.incomplete", where=where, title=title, what=f"{name} {rule}") from None


SCHEMA = 1
#: Key of a value -> its table in older files. Older files also have statistics in percent.
OLDER = {
    "unit": "units",
    "interval": "intervals",
    "model_interval": "model_intervals",
    "spread": "spreads",
    "parts": "parts",
    "run_to_run": "spread",
}
SHARES = ("rms", "held", "predicted")
#: Number of digits of a fit's hash, taken from the start of `sha256sum fit.toml`.
HASH_DIGITS = 16


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Fit(Viewed):
    """Result of a fit: values with their uncertainty, in SI; pressures are absolute unless stated otherwise.

    Attributes
    ----------
    values : dict
        Name -> value; NaN for a value that the fit could not estimate.
    units : dict
        Name -> SI unit.
    free : tuple of str
        Order of `covariance`.
    covariance : ndarray, shape (p, p)
        First-order covariance of the free values, without directions that the data do not determine.
    intervals : dict
        Determined free value -> (lower, upper), 95 %. Other values have no interval.
    systematic : dict
        Free value -> standard uncertainty from errors shared by all rows (sensor gain, pressure, area).
    model_errors : dict
        Name -> lower limit of the model error, if known.
    undetermined : tuple of Undetermined
        Undetermined values, each with reason and remedy.
    notes : tuple of str
        Notes on omissions, held values and assumptions.
    statistics : dict
    provenance : dict
        Version, hash of the data, options.
    converged : bool
        False if the search ended early; the values are then the best so far.
    details : dict
        Name -> further entries of a value in the file, specific to this kind of fit.
    profiler : callable or None
        Free value -> its interval by profile likelihood; None if the fit was read from a file, or has no profile.
    fitted : dict
        Name -> measured and modelled values; empty if the fit was read from a file.
    file : str
        File from which the fit was read, or to which it was written.
    """

    #: Name of this kind of fit in files and in messages, and its table in kinds.toml.
    KIND: ClassVar[str]
    TITLE: ClassVar[str]
    WORDS: ClassVar[Plain]

    values: NamedNumbers
    units: dict[str, str]
    free: tuple[str, ...]
    covariance: Array
    intervals: NamedIntervals
    systematic: NamedNumbers = field(default_factory=dict)
    model_errors: NamedNumbers = field(default_factory=dict)
    undetermined: tuple[Any, ...] = ()
    notes: tuple[str, ...] = ()
    statistics: NamedNumbers
    provenance: Plain
    converged: bool = True
    details: dict[str, Plain] = field(default_factory=dict)
    profiler: Callable[[str], Interval] | None = field(default=None, repr=False)
    fitted: dict[str, FittedData] = field(default_factory=dict, repr=False)
    file: str = field(default="", repr=False)

    def __init_subclass__(cls, kind: str = "") -> None:
        """Read the texts for this kind of fit from kinds.toml."""
        words = {"title": "", "groups": ["values"], "details": {}, "has_profile": True}
        cls.WORDS = words | package_table(__file__, "kinds.toml").get(kind, {})
        cls.KIND, cls.TITLE = kind, cls.WORDS["title"]

    def __post_init__(self) -> None:
        """Remove the intervals of undetermined values."""
        lost = names_of(self.undetermined)
        every = self.intervals.items() if self.converged else ()
        ends = {name: (float(low), float(high)) for name, (low, high) in every if name not in lost}
        object.__setattr__(self, "intervals", Intervals(ends))

    @property
    def determined(self) -> tuple[str, ...]:
        """Names of `values` that the data determine, without held values."""
        return tuple(name for name in self.values if self._is_determined(name))

    def _is_determined(self, name: str) -> bool:
        is_free = name in self.free and name not in names_of(self.undetermined)
        return is_free and bool(np.isfinite(self.free_values()[name]))

    @property
    def recordings(self) -> tuple[str, ...]:
        """Names of the fitted recordings, if known."""
        said = self.provenance.get("recordings", ())
        return tuple(str(one["name"] if isinstance(one, dict) else one) for one in said)

    @property
    def hashes(self) -> dict[str, str]:
        """Recordings of the fit with their hashes, empty if unknown."""
        tables = [one for one in self.provenance.get("recordings", ()) if isinstance(one, dict)]
        return {str(one["name"]): str(one.get("sha256", "")) for one in tables}

    @property
    def synthetic(self) -> bool:
        """Whether the data are marked as simulated."""
        return SIMULATED in self.notes

    @property
    def standard_errors(self) -> NamedNumbers:
        """First-order statistical standard error of each free value with an interval; empty without a covariance."""
        every = zip(self.free, np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist(), strict=False)
        return {name: error for name, error in every if name in self.intervals}

    @property
    def reach(self) -> float:
        """Half width of a first-order 95 % interval in standard errors: Student's t."""
        if "degrees_of_freedom" in self.statistics:
            return student(self.statistics["degrees_of_freedom"])
        name, (low, high) = next(iter(self.intervals.items()))
        return 0.5 * (high - low) / self.standard_errors[name]

    @property
    def correlation(self) -> Array:
        """Correlation matrix in the order of `free`; 0 for values without variance."""
        return self._correlation(0.0)

    def _correlation(self, systematic: ArrayLike) -> Array:
        """Return the correlation matrix. Independent systematic uncertainties reduce the correlations."""
        spread = np.hypot(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)), systematic)
        out = self.covariance / np.outer(*[np.where(spread > 0.0, spread, np.inf)] * 2)
        np.fill_diagonal(out, 1.0)
        return out

    def expanded_uncertainty(self, name: str) -> float:
        """Return U = sqrt(statistical^2 + (2 systematic)^2) of one free value (k = 2).

        The statistical part is twice the standard error, or the longer side of the 95 % interval if that is larger. The
        interval includes the uncertainty of the curve's shape.

        Raises
        ------
        FitError
            The value was not free, or the data do not determine it.
        """
        if name not in self.free:
            raise FitError.of("identify.not_free", name=name, free=", ".join(self.free))
        if name not in self.intervals:
            raise FitError(f"{name} has no uncertainty: the data do not determine it")
        value = self.free_values()[name]
        low, high = self.intervals[name]
        statistical = max(2.0 * self.standard_errors[name], high - value, value - low)
        return float(np.hypot(statistical, 2.0 * self.systematic.get(name, 0.0)))

    def profile(self, names: Sequence[str] | None = None) -> NamedIntervals:
        """Return 95 % intervals by profile likelihood: one value is held while all others are fitted again.

        Undetermined values also have an interval here. An open end is infinite, or equals the bound of the value.

        Parameters
        ----------
        names : sequence of str, optional
            Names of free values. Default: all; for the fit of a drive, all except values of sensors.

        Returns
        -------
        dict
            Name -> (lower, upper), in SI.

        Raises
        ------
        FitError
            This kind of fit has no profile, the fit was read from a file without its data, its search did not converge,
            or a value was not free.
        """
        if not self.WORDS["has_profile"]:
            raise FitError.of("identify.no_profile", title=self.TITLE)
        sensors = getattr(self, "sensors", ())
        names = [name for name in self.free if name not in sensors] if names is None else list(names)
        for name in names:
            if name not in self.free:
                raise FitError(f"{name} was not free in this fit", remedy=nearest(name, self.free))
        if self.profiler is None:
            raise FitError.of("identify.without_data", title=self.TITLE)
        if not self.converged:
            raise FitError.of("identify.not_converged")
        return {name: self.profiler(name) for name in names}

    def findings(self) -> tuple[Finding, ...]:
        """Return undetermined values and their remedies; values with the same reason share one finding."""
        shared: dict[tuple[str, str], list[str]] = {}
        for one in (one for one in self.undetermined if isinstance(one, Undetermined)):
            shared.setdefault((one.reason, one.remedy), []).append(one.parameter)
        return tuple(
            Finding(f"{', '.join(names)} cannot be determined: {reason}.", "open", f"Remedy: {remedy}.")
            for (reason, remedy), names in shared.items()
        )

    def statements(self) -> list[str]:
        """Return the findings as sentences."""
        return [f"{finding.text} {finding.remedy}".strip() for finding in self.findings()]

    def curve(
        self,
        gauge_a_pa: float | None = None,
        gauge_b_pa: float | None = None,
        speeds_m_s: Interval | None = None,
    ) -> SlidingCurve:
        """Return the curve to export. Defaults: the middle of the measured pressures, and the range of measured speeds.

        Raises
        ------
        FitError
            The fit has no friction, or no range of measured speeds.
        """
        measured = (self.provenance.get(f"gauge_{side}_pa") for side in "ab")
        a, b = (0.5 * (float(m[0]) + float(m[1])) if isinstance(m, (list, tuple)) else 0.0 for m in measured)
        gauges_pa = a if gauge_a_pa is None else gauge_a_pa, b if gauge_b_pa is None else gauge_b_pa
        return self._curve(speeds_m_s or self.provenance.get("speed_m_s"), gauges_pa)

    def _curve(self, speeds_m_s: Any, gauges_pa: Pair) -> SlidingCurve:  # noqa: ANN401 - checked below
        """Return the curve between two speeds at the gauge pressures of the chambers."""
        del speeds_m_s, gauges_pa
        raise FitError(f"the {self.TITLE} has no friction to export", rule="a fit of friction or of a drive")

    def export(
        self,
        to: str,
        out: str | Path | None = None,
        *,
        gauge_a_pa: float | None = None,
        gauge_b_pa: float | None = None,
        speeds_m_s: Interval | None = None,
    ) -> Exported:
        """Export the friction as a law of another tool.

        Parameters
        ----------
        to : str
            ``simscape``, ``modelica`` or ``csv``.
        out : path-like, optional
            File to write.
        gauge_a_pa, gauge_b_pa : float, optional
            Gauge pressures of the curve. The default is the middle of the measured pressures, or 0 for the fit of a
            drive.
        speeds_m_s : tuple of float, optional
            Lowest and highest speed of the curve; the default is the measured range. Required for the fit of a
            drive.

        Returns
        -------
        Exported
            Parameters, largest deviation of the other tool's curve, and effects that the conversion leaves out.

        Raises
        ------
        FitError
            The tool is unknown, or the fit has no range of measured speeds.
        """
        done = export(self.curve(gauge_a_pa, gauge_b_pa, speeds_m_s), to)
        if out is not None:
            done.write(out)
        return done

    def compared(self) -> dict[str, FittedData]:
        """Return measured and modelled values, by name. Empty if the fit was read from a file."""
        return self.fitted

    def report(self, folder: str | Path = "report") -> Path:
        """Write a page about the fit (report.html) and its figures into a folder; return the path of the page.

        The page shows values with intervals and recordings, undetermined values, and residuals. A fit from a file has
        no residuals.

        Raises
        ------
        CommandError
            The folder cannot be written to.
        """
        return upper("write_fit_report")(self, folder)

    def identified_as(self, keys: Mapping[str, str]) -> Identified:
        """Return the values under their names in a drive file.

        Parameters
        ----------
        keys : mapping
            Name in the fit -> name in the drive file.
        """
        wide = {name: self.systematic.get(name, 0.0) for name in (*self.free, *keys)}
        sure = {name: key for name, key in keys.items() if name in self.intervals}
        rows = self.free if self.covariance.size else ()  # a fit without values has no covariance
        known = {key: rows.index(name) for name, key in sure.items() if name in rows}
        shares = self._correlation([wide[name] for name in self.free]) if known else self.covariance
        return Identified(
            values={key: self.values[name] for name, key in keys.items()},
            intervals={k: whole_interval(self.values[n], self.intervals[n], wide[n]) for n, k in sure.items()},
            recordings=self.recordings,
            fit=str(self.provenance.get("fit_hash", ""))
            or hashlib.sha256(self.toml().encode()).hexdigest()[:HASH_DIGITS],
            file=self.file,
            model_errors={keys[name]: error for name, error in self.model_errors.items() if name in keys},
            correlations={
                one: {two: float(shares[i, j]) for two, j in known.items() if two != one} for one, i in known.items()
            },
        )

    # -- the file ---------------------------------------------------------------------------------------------

    def _groups(self) -> tuple[NamedNumbers, ...]:
        """Return the values, one dict for each table of the file."""
        return (self.values,)

    def free_values(self) -> NamedNumbers:
        """Return all values that can be in `free`, such as values of the drive and of its sensors."""
        return {name: value for group in self._groups() for name, value in group.items()}

    def _first(self) -> Plain:
        """Return the top-level entries of the file, except schema and kind."""
        return {"kind": self.KIND, "converged": self.converged, "notes": list(self.notes)}

    def _last(self) -> Plain:
        """Return the tables at the end of the file: start values of the search."""
        return {}

    def _entry(self, name: str, value: float) -> Plain:
        """Return the table of a value; `FitEntry` reads it."""
        entry: Plain = {"value": value, "unit": self.units[name], "determined": self._is_determined(name)}
        if name in self.intervals:
            entry["standard_error"] = self.standard_errors.get(name)
            entry |= {"u_systematic": self.systematic.get(name), "interval": list(self.intervals[name])}
        return entry | {"model_error": self.model_errors.get(name)} | self.details.get(name, {})

    def toml(self, folder: Path | None = None) -> str:
        """Return the text of fit.toml. It lists the inputs of the fit only if `folder` is given."""
        tables: Plain = {"schema": SCHEMA, **self._first()}
        for table, values in zip(self.WORDS["groups"], self._groups(), strict=True):
            tables |= {f"{table}.{toml.key_text(name)}": self._entry(name, value) for name, value in values.items()}
        if self.covariance.size:
            tables["covariance"] = {"names": list(self.free), "matrix": self.covariance.tolist()}
        if self.undetermined:
            tables["undetermined"] = [vars(one) if isinstance(one, Undetermined) else one for one in self.undetermined]
        about = {key: value for key, value in self.provenance.items() if key != INPUTS or folder is not None}
        tables |= {"statistics": self.statistics, "provenance": stored_beside(about, folder or Path())}
        text = "\n".join([self.WORDS["head"], *toml.sections(tables)]) + "\n"
        return text + (f"\n{toml.write(self._last())}" if self._last() else "")

    def to_toml(self, path: str | Path) -> None:
        """Write the fit with intervals, covariance and provenance; :meth:`from_toml` reads it back.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        write_whole(Path(path), self.toml(Path(path).parent))
        object.__setattr__(self, "file", str(path))

    @classmethod
    def from_toml(cls, path: str | Path) -> Self:
        """Read a fit from a file written by :meth:`to_toml`. The file does not contain the data.

        Raises
        ------
        FitError
            The file does not exist, is not TOML, is another kind of fit, or is incomplete.
        """
        where = str(path)
        content, text = toml.read(path, FitError, "pneudrive fit and pneudrive identify write a fit.toml.")
        kind = content.get("kind", "friction map")
        if kind != cls.KIND:
            raise FitError.of("identify.other_kind", where=where, kind=kind, needed=cls.KIND, title=cls.TITLE)
        if content.get("schema", SCHEMA) != SCHEMA:
            raise FitError.of("identify.other_schema", where=where, value=content["schema"], schema=SCHEMA)
        try:
            file = FitFile.read(cls._present(content), cls.TITLE, cls.WORDS["groups"], where, text)
            fields = cls._fields(file)
            fields["provenance"] = located(fields["provenance"], Path(path).parent)
            found = cls(**fields, file=str(path))
            _ = str(found), found.toml()  # a key that only some fits need raises here
        except (KeyError, TypeError, ValueError, IndexError, AttributeError) as error:
            what = f'"{error.args[0]}" is missing' if isinstance(error, KeyError) else str(error)
            remedy = "Give a fit.toml that pneudrive fit or pneudrive identify has written."
            raise FitError(f"the file is not a complete {cls.TITLE}", where=where, value=what, remedy=remedy) from error
        return found

    @classmethod
    def is_file(cls, path: object) -> bool:
        """Return whether a path is a file of this kind of fit."""
        return toml.tables_in(path, FitError).get("kind") == cls.KIND

    @classmethod
    def _present(cls, content: Plain) -> Plain:
        """Return a file's tables in the present form. Older files have one table for each property of a value."""
        if "provenance" in content or "intervals" not in content:
            return content
        content = {"units": cls.WORDS.get("older_units", {})} | content
        values = {
            name: {"value": value} | {key: content[t][name] for key, t in OLDER.items() if name in content.get(t, ())}
            for name, value in content["values"].items()
        }
        statistics = {key: content[f"{key}_percent"] / 100.0 for key in SHARES if f"{key}_percent" in content}
        statistics |= {key: content[key] for key in ("correlation",) if key in content}
        hashes = [{"name": name, "sha256": digest} for name, digest in content.get("sha256", {}).items()]
        recordings = content.get("recordings") or hashes or list(content["runs"])
        return content | {"values": values, "statistics": statistics, "provenance": {"recordings": recordings}}

    @classmethod
    def _fields(cls, file: FitFile) -> Plain:
        """Return the fields of a fit from its file.

        Raises
        ------
        KeyError, ValueError
            An entry is missing, or the covariance does not match the values.
        """
        entries = file.entries
        names = tuple(entries if file.covariance is None else file.covariance.names)
        matrix = np.array([] if file.covariance is None else file.covariance.matrix, dtype=float)
        if matrix.size and matrix.shape != (len(names), len(names)):
            raise ValueError(f"covariance of shape {matrix.shape} for {len(names)} parameters")

        def stated(key: str) -> Plain:
            values = {name: getattr(entry, key) for name, entry in entries.items()}
            return {name: value for name, value in values.items() if value is not None}

        return {
            "values": {name: entry.value for name, entry in file.groups[0].items()},
            "units": stated("unit"),
            "free": names,
            "covariance": matrix,
            "intervals": stated("interval"),
            "systematic": stated("u_systematic"),
            "model_errors": stated("model_error"),
            "undetermined": tuple(file.undetermined),
            "notes": file.notes,
            "statistics": file.statistics,
            "provenance": dict(file.content["provenance"]),
            "converged": file.converged,
            "details": {name: entry.model_extra for name, entry in entries.items() if entry.model_extra},
        }

    # -- display ----------------------------------------------------------------------------------------

    def view(self) -> View:
        """Return a view: values with intervals, undetermined values, notes, and measured and modelled values."""
        every, lost = self.compared(), names_of(self.undetermined)
        caption = f"Measured and modelled values, and their difference, which should look like noise: {len(every)}."
        rows = []
        for name, value in self._shown().items():
            unit, ends = self.units[name], self.intervals.get(name)
            size = readable(unit)[0]
            rows.append(ShownValue(name, name, "value", value, unit, ends, "data" if name in self.free else "stated"))
            cells = {}  # further columns of the row: state, U (k = 2), model error and details
            if name in lost or not np.isfinite(value):
                cells["state"] = "not determined"
            elif name not in self.free:
                cells["state"] = "fixed"
            if ends is not None and self.systematic.get(name, 0.0) > 0.0:
                cells["U (k = 2)"] = plain(self.expanded_uncertainty(name) / size, 2)
            if ends is not None and name in self.model_errors:
                cells["model ±"] = plain(self.model_errors[name] / size, 2)
            for key, words in self.WORDS["details"].items():
                found = self.details.get(name, {}).get(key)
                if isinstance(found, float):
                    cells[words] = f"{100 * found:.0f} %"
                elif found is not None:
                    cells[words] = " .. ".join(plain(v / size, 5) for v in found)
            rows += [ShownValue(f"{name}.{key}", name, key, text, origin="text") for key, text in cells.items()]
        known = [replace(row, quantity=row.label) for row in rows if row.interval is not None]
        is_wrong = not self.converged or not getattr(self, "fits", True)
        words = [MODEL_ERROR_WORDS] if self.intervals and self.model_errors else []
        is_tested = self.statistics.get("degrees_of_freedom") != 0.0 or "untested" not in self.WORDS
        title = self.WORDS["headline" if is_tested else "untested"]
        return View(
            title.format(fit=self, s=self.statistics, count=len(self.recordings)),
            tuple(rows),
            notes=(*self._residual_lines(), *words, *self.notes),
            state="bad" if is_wrong else "open" if self.undetermined else "good",
            leading=known[:MOST_LEADING],
            findings=self.findings(),
            figures=(ShownFigure("residuals", caption, comparison_figure(every)),) if every else (),
        )

    def _residual_lines(self) -> list[str]:
        """Return the notes of the view on the residuals."""
        return []

    def _shown(self) -> NamedNumbers:
        """Return the values that the view shows."""
        return self.free_values()
