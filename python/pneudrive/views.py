"""Values with intervals, findings, tables and figures: the common form of results for all outputs.

Each result has ``view()``. Terminal, notebook, report and page show this `View` without knowing the class of the
result. A class that derives from `Viewed` needs no other method for display.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from pneudrive.figures import Figure, Numbers, plain_data, thin
from pneudrive.lazy_names import upper
from pneudrive.numbers import plain, with_u
from pneudrive.repr_tables import Card, Shown, aligned
from pneudrive.units import readable

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.arrays import Array, ArrayPair, Bools, Interval, Plain

#: State of a result, a value or a finding, from best to worst.
State: TypeAlias = Literal["good", "open", "bad"]
STATES: tuple[State, ...] = ("good", "open", "bad")
#: Head and rows of a table.
HeadAndRows: TypeAlias = tuple[tuple[str, ...], list[tuple[str, ...]]]
MOST_LEADING = 5
_NUMBERS = {"", "–", "-", "+", *"0123456789"}  # first letters of a number in a table
MOST_PICTURES = 3  # figures of a result that a notebook draws
UNLIKE = 1.5  # both ends are written if an interval is longer than this factor times twice its shorter half
VALUE = "value"  # quantity of the values in a table with one column


@dataclass(frozen=True)
class ShownValue:
    """One value of a result.

    Attributes
    ----------
    key : str
        Identifier within the result.
    label : str
        Name of the object to which the value belongs; names the row of a table.
    quantity : str
        Name of the quantity; names the column of a table.
    value : float or str
    unit : str
        SI unit; "" for text and counts.
    interval : tuple of float or None
        Bounds of the 95 % interval, or value minus and plus U (k = 2).
    origin : str
        Source of the value: data, stated, assumed.
    limit : float or None
        Limit of a leading value in SI. A comparison with ``==`` ignores limit and state.
    state : str
        Whether a leading value is within its limit.
    """

    key: str
    label: str
    quantity: str
    value: float | str
    unit: str = ""
    interval: Interval | None = None
    origin: str = "data"
    limit: float | None = field(default=None, compare=False)
    state: State = field(default="good", compare=False)

    @property
    def text(self) -> str:
        """Value and half width of its interval in the usual unit, without the unit; "" for an undetermined value.

        Examples
        --------
        >>> ShownValue("v", "a recording", "speed", 0.0132, "m/s").text
        '13.2'
        >>> ShownValue("f", "a recording", "friction", 9.79, "N", (9.3, 10.28)).text
        '9.79 ± 0.49'
        >>> ShownValue("s", "a rig", "scatter", 1.02, "N", (0.62, 45.0)).text  # unlike halves
        '1.02 (0.620 … 45)'
        """
        if isinstance(self.value, str):
            return self.value
        if not math.isfinite(self.value):
            return ""
        size, _ = readable(self.unit)
        if self.interval is None:
            return plain(self.value / size)
        low, high = self.interval
        if not math.isfinite(high - low) or high - low > UNLIKE * 2.0 * min(high - self.value, self.value - low):
            return f"{plain(self.value / size)} ({plain(low / size)} … {plain(high / size)})"
        return with_u(self.value / size, (high - low) / 2.0 / size, "")

    @property
    def usual_unit(self) -> str:
        """Usual unit, in which `text` is written."""
        return readable(self.unit)[1] if self.unit else ""

    @property
    def limit_text(self) -> str:
        """Limit with its usual unit; "" without a limit."""
        size, unit = readable(self.unit)
        return "" if self.limit is None else f"{plain(self.limit / size)} {unit}".strip()

    @property
    def sentence(self) -> str:
        """Name of the quantity (or label, if the table has one column), value and limit in the usual unit."""
        bound = f" (limit {self.limit_text})" if self.limit_text else ""
        name = self.label if self.quantity == VALUE else self.quantity
        return f"{name} {self.text} {self.usual_unit}".strip() + bound


@dataclass(frozen=True, eq=False)
class ShownCurve:
    """One curve of a result, in SI.

    Attributes
    ----------
    key, label : str
    x, y : ndarray, shape (m,)
    x_quantity, quantity : str
        Names of both axes.
    x_unit, unit : str
    band : tuple of ndarray or None
        Lower and upper end of the 95 % band.
    measured : ndarray of bool, shape (m,)
        Whether a point was measured; False for points in between.
    group : str
        Curves of the same group have the same colour.
    excluded : tuple of ndarray or None
        x and y of points that are not part of the curve.
    """

    key: str
    label: str
    x: Array
    y: Array
    x_quantity: str
    quantity: str
    x_unit: str
    unit: str
    band: ArrayPair | None
    measured: Bools
    group: str = ""
    excluded: ArrayPair | None = None

    @property
    def units(self) -> tuple[tuple[float, str], tuple[float, str]]:
        """Usual units of both axes: size in SI, and name."""
        return readable(self.x_unit), readable(self.unit)

    @property
    def half_band(self) -> float:
        """Mean half width of the band at the measured points; NaN without a band."""
        if self.band is None:
            return math.nan
        return float(((self.band[1] - self.band[0]) / 2.0)[self.measured].mean())


@dataclass(frozen=True)
class Finding:
    """A sentence on a result, with severity and remedy."""

    text: str
    state: State = "good"
    remedy: str = ""


def worst(findings: Iterable[Finding | ShownValue]) -> State:
    """Return the state of the worst finding or value; "good" without findings and values."""
    states: list[State] = [finding.state for finding in findings]
    return max(states, key=STATES.index) if states else "good"


@dataclass(frozen=True)
class ShownTable:
    """A table of texts with its caption. Columns of numbers are right-aligned."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]

    @property
    def are_numbers(self) -> tuple[bool, ...]:
        """Whether each column except the first has only numbers and empty cells."""
        columns = zip(*self.rows, strict=True) if self.rows else ((),) * len(self.head)
        return tuple(k > 0 and all(cell[:1] in _NUMBERS for cell in column) for k, column in enumerate(columns))


@dataclass(frozen=True)
class ShownFigure:
    """A figure with the name of its file and its caption."""

    name: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class SentValue:
    """A value in the data of a view. It has the value and its interval in SI, and a text in the usual unit.

    Only leading values have a limit and a state.
    """

    key: str
    label: str
    quantity: str
    value: float | str | None
    interval: tuple[float, float] | None
    text: str
    unit: str
    origin: str
    limit: str = ""
    state: State = "good"

    @classmethod
    def of(cls, shown: ShownValue) -> SentValue:
        """Convert a value of a result to a value in the data of a view."""
        about = (shown.key, shown.label, shown.quantity, shown.value, shown.interval, shown.text, shown.usual_unit)
        return cls(*about, shown.origin, shown.limit_text, shown.state)


@dataclass(frozen=True)
class SentCurve:
    """A curve in the data of a view, in usual units, with measured points and points in between."""

    key: str
    label: str
    group: str
    x_title: str
    y_title: str
    x: Numbers
    y: Numbers
    low: Numbers
    high: Numbers
    measured: list[bool]

    @classmethod
    def of(cls, curve: ShownCurve) -> SentCurve:
        """Return a curve in usual units. A long curve is reduced to some thousand points."""
        (x_size, x_unit), (size, unit) = curve.units
        titles = f"{curve.x_quantity}, {x_unit}".strip(", "), f"{curve.quantity}, {unit}".strip(", ")
        part = thin(curve.x)
        low, high = (end[part] / size for end in curve.band) if curve.band else ((), ())
        points = curve.x[part] / x_size, curve.y[part] / size, low, high
        return cls(curve.key, curve.label, curve.group, *titles, *points, curve.measured[part].tolist())


@dataclass(frozen=True)
class SentView:
    """The data of a view, for JSON: values in SI and as texts, the table of values, and figures with their axes.

    Attributes
    ----------
    head, table : sequence of str
        Header and rows of the table of values, as in a terminal.
    """

    title: str
    state: State
    leading: list[SentValue]
    findings: Sequence[Finding]
    head: Sequence[str]
    table: Sequence[Sequence[str]]
    rows: list[SentValue]
    curves: list[SentCurve]
    tables: Sequence[ShownTable]
    figures: Sequence[ShownFigure]
    notes: Sequence[str]


def view_schema() -> Plain:
    """Return the JSON schema of the data of a view."""
    from pydantic import TypeAdapter

    return TypeAdapter(SentView).json_schema()


@dataclass(frozen=True, eq=False, repr=False)
class View(Shown):
    """A result as data.

    Attributes
    ----------
    title : str
        Headline, one sentence.
    rows : sequence of ShownValue
    curves : sequence of ShownCurve
    notes : sequence of str
    state : str
        "good", "open" or "bad".
    leading : sequence of ShownValue
        At most five decisive values, with their limits.
    findings : sequence of Finding
        Findings, sorted with the worst first.
    tables : sequence of ShownTable
    figures : sequence of ShownFigure
    """

    title: str
    rows: Sequence[ShownValue] = ()
    curves: Sequence[ShownCurve] = ()
    notes: Sequence[str] = ()
    state: State = "good"
    leading: Sequence[ShownValue] = ()
    findings: Sequence[Finding] = ()
    tables: Sequence[ShownTable] = ()
    figures: Sequence[ShownFigure] = ()

    def __post_init__(self) -> None:
        """Sort the findings, and check the number of leading values."""
        if len(self.leading) > MOST_LEADING:
            raise ValueError(f"a view has {len(self.leading)} leading values; at most {MOST_LEADING} are allowed")
        worst_first = sorted(self.findings, key=lambda finding: -STATES.index(finding.state))
        object.__setattr__(self, "findings", worst_first)

    def data(self) -> Plain:
        """Return the view as plain data, for JSON, with the fields of `SentView`."""
        head, table = self.table() if self.rows else ((), [])
        values = list(map(SentValue.of, self.rows))
        texts = (self.title, self.state, list(map(SentValue.of, self.leading)), self.findings, head, table, values)
        return plain_data(SentView(*texts, list(map(SentCurve.of, self.curves)), self.tables, self.figures, self.notes))

    def sentences(self) -> tuple[str, ...]:
        """Return leading values, findings with their remedies, and notes; "!" marks a bad finding."""
        marks: dict[State, str] = {"good": "", "open": "", "bad": "! "}
        findings = (f"{marks[f.state]}{f.text}{f' {f.remedy}' if f.remedy else ''}" for f in self.findings)
        return (*(value.sentence for value in self.leading), *findings, *self.notes)

    def table(self) -> HeadAndRows:
        """Return the header and the rows of the table of values: a row for each label, a column for each quantity."""
        of_column: dict[str, set[str]] = {}
        labels: dict[str, dict[str, ShownValue]] = {}
        for value in self.rows:
            of_column.setdefault(value.quantity, set()).add(value.usual_unit)
            labels.setdefault(value.label, {})[value.quantity] = value
        # A column with one unit shows it in the header. A column with several units shows them beside the values.
        common = {name: next(iter(units)) if len(units) == 1 else None for name, units in of_column.items()}

        def cell(values: dict[str, ShownValue], name: str) -> str:
            text = values[name].text if name in values else ""
            return f"{text} {values[name].usual_unit}".strip() if common[name] is None and text else text

        rows = [(label, *(cell(values, name) for name in common)) for label, values in labels.items()]
        return ("", *(f"{name} {unit or ''}".strip() for name, unit in common.items())), rows

    def value_tables(self, without: Collection[ShownValue] = ()) -> list[HeadAndRows]:
        """Return the header and the rows of each table of values. Labels with a common quantity share a table."""
        quantities: dict[str, set[str]] = {}
        for value in self.rows:
            quantities.setdefault(value.label, set()).add(value.quantity)
        groups: list[tuple[set[str], list[ShownValue]]] = []
        for value in self.rows:
            group = next((group for group in groups if group[0] & quantities[value.label]), None)
            if group is None:
                groups.append(group := (set(), []))
            group[0].update(quantities[value.label])
            group[1].extend([value] * (value not in without))
        return [replace(self, rows=values).table() for _, values in groups if values]

    def curve_table(self) -> HeadAndRows:
        """Return the header and the rows of a table of curves: measured points, ranges of both axes, mean half band."""
        rows = []
        for curve in self.curves:
            (x_size, _), (size, _) = curve.units
            points = str(int(curve.measured.sum()))
            ends = (_ends(curve.x / x_size, ".3g"), _ends(curve.y / size, ".2f"))
            rows.append((curve.label, points, *ends, f"± {curve.half_band / size:.2g}"))
        if not self.curves:
            return (), rows
        first = self.curves[0]
        (_, x_unit), (_, unit) = first.units
        axes = f"{first.x_quantity} {x_unit}", f"{first.quantity} {unit}"
        return ("curve", "points", *axes, "95 % band"), rows

    def text(self) -> str:
        """Return the view without curves and figures as text. Tables are indented; "!" marks open and bad findings."""
        shown = {row.key for row in self.rows}
        leading = (one for one in self.leading if one.key not in shown)
        values = [("!" if one.state == "bad" else "-", one.sentence) for one in leading]
        values += [("-" if f.state == "good" else "!", f"{f.text} {f.remedy}".strip()) for f in self.findings]
        tables = [self.table(), *((table.head, table.rows) for table in self.tables)]
        blocks = [aligned([head, *rows]) for head, rows in tables if rows]
        lines = [self.title, *(f"  {mark} {text}" for mark, text in values), *blocks]
        return "\n".join([*lines, *(f"  {note}" for note in self.notes)])

    def _card(self) -> Card:
        head, rows = self.table() if self.rows else self.curve_table()
        if not rows and self.tables:
            head, rows = self.tables[0].head, self.tables[0].rows
        return Card(self.title, head, rows, self.sentences())


class Viewed(Shown):
    """Base of results with a view. The prompt and a notebook show the view; a notebook also shows the figures."""

    def view(self) -> View:
        """Return the view of the result."""
        raise NotImplementedError

    def __str__(self) -> str:
        """Return the view as text."""
        return self.view().text()

    def _card(self) -> Card:
        return self.view()._card()

    def _repr_html_(self) -> str:
        return "".join(map(upper("figure_svg"), self.view().figures[:MOST_PICTURES])) + super()._repr_html_()


class Reported(Viewed):
    """Base of results whose report is a page that shows their view."""

    def report(self, folder: str | Path) -> Path:
        """Write report.html, the page of the view, and its figures into an existing folder.

        Raises
        ------
        CommandError
            The folder cannot be written to.
        """
        return upper("view_report")(self.view(), synthetic=getattr(self, "synthetic", False)).write(folder)


def _ends(values: Array, form: str) -> str:
    ends = (values.min() + 0.0, values.max() + 0.0)
    return " .. ".join(dict.fromkeys(f"{end:{form}}" for end in ends))
