"""Parts common to all fits: sentences, measured and modelled values, and identified values for a drive.

Fits of friction maps and of recordings both use `Identified`, so that a drive file can state the origin of each value.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any

from pneudrive import figures, units
from pneudrive.arrays import Array, Interval, Keyed, NamedNumbers, Plain
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.files import provenance
from pneudrive.describe.marks import Quantity, StatedPressure, parameter_quantities
from pneudrive.describe.tables.friction import assumed_with, friction_laws
from pneudrive.errors import FitError, nearest, package_table, warn
from pneudrive.estimate.estimates import CONFIDENCE
from pneudrive.figures import MODEL, RESIDUAL, SPEED, Axis, Figure, Line, Look, Mark, Markers, Panel, Rule, thin
from pneudrive.free.parameters import circuit_numbers, numbers_of, with_shape
from pneudrive.simulation.trajectory import meaning
from pneudrive.units import readable

# --- Sentences of fits, from sentences.toml.


def sentences(topic: str) -> Plain:
    """Return the sentences of a topic, by name."""
    return package_table(__file__, "sentences.toml")[topic]


def number_table(topic: str) -> Plain:
    """Return a table of tables.toml, such as the units of parameters, by its name."""
    return package_table(__file__, "tables.toml")[topic]


def stated(topic: str, key: str, /, **values: object) -> dict[str, str]:
    """Return the parts of a message, such as what, rule and remedy, filled with these values."""
    return {part: text.format(**values) for part, text in sentences(topic)[key].items()}


def sentence(topic: str, key: str, /, **values: object) -> str:
    """Return a sentence of a topic, filled with these values."""
    return sentences(topic)[key].format(**values)


_ANY = "record motion that depends on it, or fix it"


def remedy_for(name: str) -> str:
    """Return the recording that would determine a value, in words."""
    plain = name.partition(" [")[0]
    return next((text for pattern, text in sentences("remedies").items() if fnmatchcase(plain, pattern)), _ANY)


# --- Measured and modelled values, and their figure.

#: Number of samples above which values over time are drawn as a line, and largest number of rows of a figure.
MANY, MOST_ROWS = 200, 12
#: Column on the horizontal axis -> its axis.
AXES: dict[str, Axis | str] = {"speed_m_s": SPEED, "time_s": "time / s"}


@dataclass(frozen=True)
class FittedData:
    """Measured and modelled values in SI, each of shape (n,).

    ``x`` and ``y`` name the columns: ``time_s``, ``speed_m_s`` or ``reversal``, and ``position_m``, ``friction_n``, ...
    """

    x: str
    y: str
    at: Array
    measured: Array
    model: Array


def comparison_figure(every: Mapping[str, FittedData]) -> Figure:
    """Draw a row for each pair: measured and modelled values, and their difference."""
    panels = []
    for name in list(every)[thin(every, MOST_ROWS)]:
        data = every[name]
        column, si_unit, _ = meaning(data.y)
        unit, x = readable(si_unit)[1], AXES.get(data.x, data.x)
        at, measured, model = (values[thin(data.at)] for values in (data.at, data.measured, data.model))
        if data.at.size > MANY and data.x == "time_s":
            marks: list[Mark] = [Line(at, measured, "measured"), Line(at, model, "model", MODEL)]
            gap: Mark = Line(at, measured - model, look=RESIDUAL, width=0.6)
        else:
            crosses = Markers(at, model, "model", Look("orange", "-", "x"))
            marks = [Markers(at, measured, "measured", size=3.0), crosses]
            gap = Markers(at, measured - model, look=RESIDUAL, size=3.0)
        panels.append(Panel(marks, name, x, figures.label_of(column.replace("_", " "), unit)))
        panels.append(Panel([gap, Rule(y=0.0)], "measured - model", x, figures.label_of("difference", unit)))
    return Figure(panels, columns=2, row_in=1.7, rest_in=0.5)


# --- Identified values for a drive: values by their names in the drive file, intervals, recordings.

#: Written form of a value.
Written = Quantity | StatedPressure
#: Number of digits of interval bounds, which are rounded outwards, and of a value without an interval.
DIGITS = 5
#: Largest rounding error of a value, as a fraction of its interval; values with a wide interval keep two digits.
ROUNDED_SHARE = 1e-2
#: Distance from a bound below which a value is at the bound, as a fraction of its interval.
AT_BOUND = 1e-6
#: Digits of the lower limit of a model error.
MODEL_DIGITS = 2
#: Decimal places of a correlation.
CORRELATION_PLACES = 3
MOST_SOURCES = 6


@dataclass(frozen=True)
class Identified:
    """Identified values of a drive.

    Attributes
    ----------
    values : dict
        Dotted name in the drive file (``friction.coulomb``, ``cylinder.dead_volume.a``) -> value in SI; pressures are
        absolute.
    intervals : dict
        Name -> (lower, upper) in SI; infinite for open ends. A value without an interval (half of a sum, if only the
        sum is determined) gets no provenance.
    recordings : tuple of str
        Names of the recordings.
    fit : str
        Hash that identifies the fit.
    file : str
        File of the fit, if known.
    model_errors : dict
        Name -> lower limit of the model error in SI, if known.
    correlations : dict
        Name -> name of another value -> correlation of both values.
    """

    values: NamedNumbers
    intervals: Mapping[str, Interval]
    recordings: tuple[str, ...] = ()
    fit: str = ""
    file: str = ""
    model_errors: NamedNumbers = field(default_factory=dict)
    correlations: Mapping[str, NamedNumbers] = field(default_factory=dict)

    def origins(self, marks: Mapping[str, Written | None]) -> dict[str, Plain]:
        """Return the provenance of each value with an interval, in the units of `marks`."""
        out = {}
        for name, interval in self.intervals.items():
            mark = marks.get(name)
            origin = {"interval": _ends(interval, mark), "confidence": CONFIDENCE, "source": joined(self.recordings)}
            if name in self.model_errors:  # a difference: pressure without abs, temperature in K
                quantity, _ = _way(mark)
                size = Quantity("K", "K") if quantity.si_unit == "K" else quantity
                origin["model_error"] = _rounded(self.model_errors[name], None, size, MODEL_DIGITS)
            every = self.correlations.get(name, {}).items()
            shares = {other: short for other, share in every if (short := round(share, CORRELATION_PLACES))}
            known = {"correlation": shares, "fit": self.fit, "file": self.file}
            out[name] = origin | {key: value for key, value in known.items() if value}
        return out


def apply_identified(
    found: Identified,
    drive: Any,  # noqa: ANN401 - a drive or a circuit
    tables: Mapping[str, object] | None = None,
    beside: Dependences | None = None,
) -> Any:  # noqa: ANN401
    """Return a drive or a circuit with identified values, each with its interval and its recordings.

    Parameters
    ----------
    found : Identified
    drive : Drive or Circuit
    tables : mapping, optional
        Further changes, as for `Drive.replace`: a law, a shape.
    beside : Dependences, optional
        Measured friction modifiers. The effect of contact age in sliding is subtracted from the values.

    Warns
    -----
    PneudriveWarning
        A force that was not identified contradicts an identified force, and is set to the identified force.

    Raises
    ------
    FitError
        The drive has no parameter with the name of an identified value.
    DescriptionError
        A value is not valid for the drive.
    """
    changes: Plain = dict(tables or {})
    modifiers = beside or Dependences()
    forces = {f"friction.{name}": force for name, force in modifiers.sliding.items()}
    values, ends = dict(found.values), dict(found.intervals)
    for name in forces.keys() & values.keys():
        values[name] -= forces[name]
        if name in ends:
            ends[name] = ends[name][0] - forces[name], ends[name][1] - forces[name]
    found = replace(found, values=values, intervals=ends)
    law = changes.get("friction.law")
    if isinstance(drive, Circuit):
        known = {name: number.mark for name, number in circuit_numbers(drive).items()}
        own = {name: mark for name, mark in known.items() if not name.startswith("ambient.")}
    else:
        drive = _with_seals(with_shape(drive, found.values), found.values)
        known = provenance.marks(drive)
        entry = drive.friction.entry if law is None else friction_laws()[str(law)]
        known |= {f"friction.{key}": mark for key, mark in parameter_quantities(entry).items()}
        own = {name: p.mark for name, p in numbers_of(drive).items() if name.startswith(("tubing.", "flow_control."))}
        known |= own
    found = _off_bounds(found, known)
    for name, value in found.values.items():
        if name not in known:
            raise FitError(f"the fit has {name}, but this {drive.file_kind} does not", remedy=nearest(name, known))
        written = _rounded(value, found.intervals.get(name), known[name])
        changes[name] = {"value": written} | _said(found, name, own[name]) if name in own else written
    if isinstance(drive, Circuit):
        return drive.replace(changes).read_from(found.file)
    changes |= _within_limits(found, drive, changes)
    if law is None:
        changes |= _assumed(found, drive)
    changes |= {f"friction.{key}": table for key, table in modifiers.friction.items()}
    after = drive.replace(changes)
    marks = provenance.marks(after)
    origins = found.origins(marks)
    inside = {name: (low, high) for name, (_, low, high) in modifiers.intervals.items() if name in marks}
    origins |= replace(found, intervals=inside, recordings=(modifiers.source,)).origins(marks)
    origins = {name: origin for name, origin in origins.items() if name not in own}
    return after.replace({"provenance": origins}).read_from(found.file)


def _with_seals(drive: Drive, names: Iterable[str]) -> Drive:
    """Return a drive that states the slope over pressure of each force in `names`; missing slopes are set to zero."""
    stated = drive.friction.to_dict().get("pressure", {})
    forces = (name.split(".")[2] for name in names if name.startswith("friction.pressure."))
    missing = {f"friction.pressure.{force}": {"a": "0 N/Pa", "b": "0 N/Pa"} for force in forces if force not in stated}
    return drive.replace(missing) if missing else drive


def _off_bounds(found: Identified, known: Mapping[str, Written | None]) -> Identified:
    """Replace values at a bound that a drive does not accept, such as a force of 0 N, by a value just above it."""
    values = dict(found.values)
    for name, (low, high) in found.intervals.items():
        above = mark.bounds.above if isinstance(mark := known.get(name), Quantity) else None
        if above is not None and low < high < math.inf and values[name] - above < AT_BOUND * (high - low):
            values[name] = above + 10.0 ** math.floor(math.log10(ROUNDED_SHARE * (high - low)))
    return replace(found, values=values)


def _said(found: Identified, name: str, mark: Written | None) -> dict[str, str]:
    """Return source and interval of a value of a line or a circuit, in the form stored with the value."""
    source = {"source": joined(found.recordings)}
    if name not in found.intervals:
        return source
    low, high = _ends(found.intervals[name], mark)
    return source | {"note": f"identified, {100.0 * CONFIDENCE:g} % interval {low} to {high}"}


def _assumed(found: Identified, drive: Drive) -> dict[str, str | float]:
    """Return the assumed friction parameters that depend on identified values, with their new values."""
    own = {k.removeprefix("friction."): v for k, v in found.values.items() if k.count(".") == 1}
    changed = {k: v for k, v in own.items() if k in drive.friction.parameters}
    marks = parameter_quantities(drive.friction.entry)
    return {f"friction.{k}": marks[k].show(v) for k, v in assumed_with(drive.friction, changed).items()}


def _within_limits(found: Identified, drive: Drive, changed: Keyed) -> Plain:
    """Return the change of one force after which the breakaway force is at least the Coulomb force.

    A force that was not fitted is set to the fitted force.
    """
    coulomb, breakaway = "friction.coulomb", "friction.breakaway"
    kept = [name for name in (coulomb, breakaway) if name not in changed]
    if not kept and units.parse(changed[breakaway], "N") < units.parse(changed[coulomb], "N"):  # by their rounding
        return {breakaway: changed[coulomb]}
    known = drive.friction.parameters
    if len(kept) != 1 or kept[0].removeprefix("friction.") not in known or "friction.law" in changed:
        return {}
    name, other = (coulomb, breakaway) if kept == [coulomb] else (breakaway, coulomb)
    own, limit = known[name.removeprefix("friction.")], found.values[other]
    if own <= limit if name == coulomb else own >= limit:
        return {}
    warn(sentence("notes", "limit", name=name, own=own, limit=limit))
    return {name: _rounded(limit, found.intervals.get(other), provenance.marks(drive)[other])}


def _way(mark: Written | None) -> tuple[Quantity, str]:
    """Return the quantity of a written value, and the suffix of its unit. Pressures in SI are absolute."""
    if isinstance(mark, StatedPressure):
        return Quantity("Pa", "bar"), " abs"
    return mark or Quantity(""), ""


def _rounded(
    value: float,
    interval: Interval | None,
    mark: Written | None,
    digits: int = DIGITS,
) -> str | float:
    """Write a value in its common unit, with digits according to its interval."""
    if not math.isfinite(value) or value == 0.0:
        return written_as(value, mark)
    quantity, behind = _way(mark)
    unit, si_unit = quantity.written, quantity.si_unit
    factor, offset = units.converter(unit, si_unit) if unit else (1.0, 0.0)
    shown = (value - offset) / factor
    places = digits - 1 - math.floor(math.log10(abs(shown))) if shown else 0
    if interval is not None and 0.0 < interval[1] - interval[0] < math.inf:
        needed = math.ceil(-math.log10(ROUNDED_SHARE * (interval[1] - interval[0]) / factor))
        places = max(needed, places - digits + 2)
    number = f"{round(shown, places):.{max(places, 0)}f}"
    again = float(number) * factor + offset
    if interval is not None and not interval[0] <= again <= interval[1]:
        return written_as(value, mark)
    if not si_unit:
        return float(number)
    plain = number.rstrip("0").rstrip(".") if "." in number else number
    return f"{plain} {unit or si_unit.replace('^', '')}{behind}"


def written_as(value: float, mark: Written | None) -> str | float:
    """Write a value in its common unit, exactly; pressures are absolute."""
    if not math.isfinite(value):
        return "inf" if value > 0.0 else "-inf"
    quantity, behind = _way(mark)
    return units.write(value, quantity.si_unit, quantity.written) + behind if quantity.si_unit else value


def _ends(interval: Interval, mark: Written | None) -> list[str | float]:
    """Write both ends of an interval, rounded outwards."""
    ends = []
    for end, outward in zip(interval, (math.floor, math.ceil), strict=True):
        value = end
        if math.isfinite(end) and end != 0.0:
            step = 10.0 ** (math.floor(math.log10(abs(end))) - DIGITS + 1)
            value = float(f"{outward(end / step) * step:.{DIGITS}g}")
        ends.append(written_as(value, mark))
    return ends


def joined(names: tuple[str, ...]) -> str:
    """Return the names of recordings as text; if there are many, only the first names."""
    if not names:
        return "not stated"
    more = len(names) - MOST_SOURCES
    return ", ".join(names[:MOST_SOURCES]) + (f" and {more} more" if more > 0 else "")


@dataclass(frozen=True)
class Dependences:
    """Measured friction modifiers in addition to the sliding law.

    Attributes
    ----------
    source : str
        Name of the campaign.
    notes : sequence of str
        Measured effects that a drive cannot represent, each with the reason; and assumptions.
    sliding : dict
        ``coulomb`` and ``breakaway`` -> force in N from the age of a sliding contact. Both a measured sliding law and
        ``[friction.dwell]`` include this force, so it is subtracted when they are combined.
    intervals : dict
        Dotted name in the drive file -> [value, lower, upper], 95 %, SI.
    friction : dict
        Key in ``[friction]`` -> table of a drive file: ``direction``, ``position``, ``dwell``, ...
    """

    source: str = ""
    notes: Sequence[str] = ()
    sliding: NamedNumbers = field(default_factory=dict)
    intervals: dict[str, list[float]] = field(default_factory=dict)
    friction: dict[str, Plain] = field(default_factory=dict)

    def without(self, key: str) -> Dependences:
        """Return the modifiers without the one under this key."""
        return replace(
            self,
            friction={name: table for name, table in self.friction.items() if name != key},
            intervals={n: ends for n, ends in self.intervals.items() if not n.startswith(f"friction.{key}.")},
        )
