"""Elements of a report (sections, text, tables, pictures), its files, the report of a fit, and provenance."""

from __future__ import annotations

import json
import math
import platform
import re
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias
from unicodedata import normalize

from pneudrive import __version__
from pneudrive.arrays import evenly
from pneudrive.errors import SEVERE, CommandError, is_severe, package_table, shown
from pneudrive.figures import WIDTH_IN, Axis, Drawing, Figure, Panel, PenStroke
from pneudrive.files.content import rendered
from pneudrive.files.writing import make_subfolder
from pneudrive.friction.friction_map import Condition, group_of
from pneudrive.numbers import with_interval
from pneudrive.references import entries
from pneudrive.report.render import PNG_DPI, DrawnFigure, applied, drawn, load_matplotlib
from pneudrive.simulation.trajectory import meaning, whole, write_whole
from pneudrive.units import readable
from pneudrive.views import Finding, ShownFigure, ShownTable, View

if TYPE_CHECKING:
    from pneudrive.friction.campaign.result import CampaignCharacteristics
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.identify.base import Fit
    from pneudrive.identify.static.result import FrictionFit

Fits: TypeAlias = "Mapping[str, Mapping[str, FrictionFit]]"


# --- Parts of a report (sections, text, tables, pictures) and the files made of them.

TEMPLATE, TYPST = (Path(__file__).with_name(f"report.{kind}.j2") for kind in ("html", "typ"))
FIGURES, REPORT = "figures", "report.html"
#: Sections with details that few readers need. A long report folds them.
DETAILS = ("record", "flags", "budget", "stick-slip-of-strokes", "recovered", "provenance")
DETAILS += ("stick-slip-over-speed", "budget-over-speed", "paper", "stick-slip", "chambers", "controlled-axis", "study")
MOST_OPEN = 8
MOST_ROWS = 12  # of a table that is not folded, in a report that folds
#: Content security policy of the page: inline styles only. The page loads and runs nothing.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph, or a list if `text` is a sequence.

    `kind` is "plain", "note" (a caution), "code", or "holds" / "fails" of a check.
    """

    text: str | Sequence[str]
    kind: str = "plain"


Block: TypeAlias = Paragraph | ShownTable | ShownFigure
Blocks: TypeAlias = "Iterator[Block]"
Part: TypeAlias = "Callable[[Topic, Any], Blocks]"  # of a result: yields the blocks of a section


@dataclass(frozen=True)
class Section:
    """A section of the report. The default of `synthetic` is the value of the report."""

    key: str
    title: str
    blocks: tuple[Block, ...]
    synthetic: bool | None = None


def view_section(key: str, view: View, *, synthetic: bool | None = None) -> Section:
    """Return the section of a result: findings, leading values and notes, values, figures and tables."""
    facts: dict[str, list[str]] = {"fails": [], "note": [], "plain": [value.sentence for value in view.leading]}
    for finding in view.findings:
        kind = {"bad": "fails", "open": "note"}.get(finding.state, "plain")
        facts[kind].append(f"{finding.text} {finding.remedy}".strip())
    facts["plain"] += view.notes
    lists = (Paragraph(items, kind) for kind, items in facts.items() if items)
    values = (("Values", *table) for table in view.value_tables())
    tables = [ShownTable(*table) for table in (*values, ("Curves", *view.curve_table())) if table[2]]
    return Section(key, view.title, (*lists, *view.figures, *tables, *view.tables), synthetic)


def view_report(view: View, *sections: Section, synthetic: bool) -> Report:
    """Return the report of a result: a verdict (leading values, bad findings), then the view and further sections."""
    leading = [Finding(value.sentence, value.state) for value in view.leading]
    bad = [finding for finding in view.findings if finding.state == "bad"]
    rest = replace(view, title="Result", leading=(), findings=tuple(f for f in view.findings if f.state != "bad"))
    return Report(view.title, [*bad, *leading], [view_section("result", rest), *sections], synthetic)


@applied()
def figure_svg(shown: ShownFigure) -> str:
    """Return a figure as an SVG element, for a notebook."""
    return inline(svg_text(drawn(shown.figure, synthetic=False)), shown.name, shown.caption)


@dataclass
class Report:
    """A report: a verdict with the worst lines first, sections, and the pictures in the folder of the report."""

    title: str
    verdict: Iterable[str | Finding]
    sections: Sequence[Section]
    synthetic: bool = False
    pictures: dict[str, str] = field(default_factory=dict)  # name -> SVG, once drawn

    def __post_init__(self) -> None:
        self.sections = [
            part if part.synthetic is not None else replace(part, synthetic=self.synthetic) for part in self.sections
        ]

    @property
    def lines(self) -> list[Finding]:
        """Lines of the verdict, the bad ones first."""
        lines = (Finding(v, "bad" if is_severe(v) else "good") if isinstance(v, str) else v for v in self.verdict)
        return sorted(lines, key=lambda line: line.state != "bad")

    def write(self, folder: str | Path) -> Path:
        """Write report.html and figures/*.png, *.svg into an existing folder.

        Raises
        ------
        CommandError
            If the folder cannot be written.
        """
        figures = Path(folder) / FIGURES
        make_subfolder(figures)
        self.draw(figures)
        return write_whole(Path(folder) / REPORT, self.html())

    @applied()
    def draw(self, folder: Path | None = None) -> None:
        """Draw the figures of all sections, and write them as PNG and SVG if a folder is given."""
        for part in self.sections:
            for block in (block for block in part.blocks if isinstance(block, ShownFigure)):
                figure = drawn(block.figure, synthetic=bool(part.synthetic))
                self.pictures[block.name] = svg_text(figure)
                if folder is not None:
                    write_whole(folder / f"{block.name}.svg", self.pictures[block.name])
                    with whole(folder / f"{block.name}.png") as temporary:
                        figure.savefig(temporary, format="png", dpi=PNG_DPI)

    def alone(self) -> str:
        """Return the page as one file with embedded pictures."""
        self.draw()
        return self.html(linked=False)

    def html(self, *, linked: bool = True) -> str:
        """Return the page, which loads no other files. With `linked`, captions link to the files of the figures."""
        details = (part for part in self.sections if part.key in DETAILS)
        calm = [part.key for part in details if not any(word in repr(part.blocks) for word in SEVERE)]
        return rendered(
            TEMPLATE,
            {"words": _words, "inline": inline},
            _plain,
            title=self.title,
            verdict=self.lines,
            sections=self.sections,
            pictures=self.pictures,
            folded=calm if len(self.sections) > MOST_OPEN else (),  # a severe finding is never folded
            most_rows=MOST_ROWS,
            folder=FIGURES if linked else "",
            policy=POLICY,
        )


def _plain(value: object) -> object:
    """Escape control characters and characters that reverse text. jinja2 calls this before it escapes HTML."""
    return shown(value, len(value)) if type(value) is str else value  # not Markup: of `_words`


def _words(text: str) -> object:
    """Return a sentence for the page. Text between backticks is user input."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(_plain(text)))))


def svg_text(figure: DrawnFigure) -> str:
    """Return a figure as SVG without a date, so that equal data give equal files."""
    out = StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    return shown(out.getvalue(), out.tell())


def inline(svg: str, name: str, description: str) -> str:
    """Return an SVG for use inside a page: no prologue, unique identifiers, and the usual text size."""
    import html

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    prefix = re.sub(r"[^A-Za-z0-9]+", "-", name)
    body = re.sub(r'\bid="', f'id="{prefix}-', body)
    body = re.sub(r'(href="#|url\(#)', rf"\g<1>{prefix}-", body)
    label = html.escape(shown(description, len(description)), quote=True)
    points = re.search(r'<svg [^>]*?width="([\d.]+)pt"', body)
    share = min(float(points[1]) / (72.0 * WIDTH_IN), 1.0) if points else 1.0
    size = f'style="max-width: {100.0 * share:.3g}%" ' if share < 1.0 else ""
    given = rf'<svg role="img" aria-label="{label}" {size}\1'
    return re.sub(r'<svg ([^>]*?)height="[^"]*"( ?)', given, body, count=1)


# --- Numbers in the report's form, and values that several sections need.

MM = 1e3  # of a metre
MOST_SHOWN = 24  # panels of one kind in a report; a campaign has too many recordings to show all


def condition_names(found: CampaignCharacteristics) -> Callable[[Condition], str]:
    """Return a function that names the conditions of a campaign."""
    return partial(Condition.label, ambient_pressure_pa=found.identity.ambient_pressure_pa)


def by_seal(found: Characterisation) -> dict[str, list[RecordingResult]]:
    """Group recordings by assembly (seal, mounting, drive). Each group is sorted by pressure."""
    groups: dict[str, list[RecordingResult]] = {}
    for result in found.results:
        groups.setdefault(group_of(result.recording.labels), []).append(result)
    return {seal: sorted(group, key=lambda r: gauge_bar(r.levels[0])) for seal, group in groups.items()}


def gauge_bar(level: Level) -> float:
    """Return the gauge pressure of the chamber with the higher pressure (bar), as the mean of both directions."""
    return level.pressure_pa / 1e5


def chance(p: float) -> str:
    """Return a p-value as text.

    Examples
    --------
    >>> chance(0.0342), chance(1e-5), chance(math.nan)
    ('0.034', '< 0.001', '–')
    """
    return "–" if not math.isfinite(p) else "< 0.001" if p < 1e-3 else f"{p:.2g}"


def spread_evenly(items: Iterable, most: int) -> list:
    """Return at most `most` of the items, evenly spread over all of them."""
    known = list(items)
    return known if len(known) <= most else [known[i] for i in evenly(len(known), most)]


def plural(count: int, one: str, many: str = "") -> str:
    """Return a count with its noun.

    Examples
    --------
    >>> plural(1, "seal"), plural(3, "seal")
    ('1 seal', '3 seals')
    """
    return f"{count} {one if count == 1 else many or one + 's'}"


def sentence(text: str) -> str:
    """Return a text as a sentence: capital letter, one full stop, printed signs.

    Examples
    --------
    >>> sentence("area 5 cm2 +-0.1 cm2")
    'Area 5 cm² ±0.1 cm².'
    """
    text = text.replace("+-", "±").replace("cm2", "cm²")
    return f"{text[:1].upper()}{text[1:].rstrip('.')}."


# --- Tables of a page, made of records: a column names its field and format; the field's name gives the unit.

NOTHING, SPARE = "–", "spare"
#: Formats in addition to those of ``format``.
_FORMS: Mapping[str, Callable[[Any], str]] = {
    "chance": chance,
    "percent": lambda share: f"{100 * share:.0f} %",
    "plain interval": lambda estimate: with_interval(estimate, unit=""),
    SPARE: str,
}


def cell(value: Any, form: str) -> str:  # noqa: ANN401 - whatever results hold
    """Return a value as text: an estimate with its interval, a missing value as a dash. ``%.1f`` formats percent."""
    if isinstance(value, str):
        return value
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return NOTHING
    if form in _FORMS:
        return _FORMS[form](value)
    if form.startswith("%"):
        return format(100 * value, form[1:])
    if isinstance(value, bool):
        return "yes" if value else "no"
    return with_interval(value) if hasattr(value, "stderr") else format(value, form)


def field_of(record: Any, field: str) -> Any:  # noqa: ANN401 - whatever results hold
    """Return a field of an object or a mapping. A dotted name, as ``stop.speed_m_s``, is a nested field."""
    for name in field.split("."):
        record = record[name] if isinstance(record, Mapping) else getattr(record, name)
    return record


def quantity(field: str) -> tuple[float, str]:
    """Return the size in SI and the name of the usual unit of a field. The unit follows from the field's suffix.

    Examples
    --------
    >>> quantity("speed_m_s"), quantity("friction_n"), quantity("flags")
    ((0.001, 'mm/s'), (1.0, 'N'), (1.0, ''))
    """
    return readable(meaning(field)[1])


# --- Sections of a page: text from a table, numbers and pictures from results.


def figure_of(layout: str, panels: Sequence[Panel | None], **more: Any) -> Figure:  # noqa: ANN401 - fields of the figure
    """Return a figure of panels in a layout of ``figures.toml``."""
    own = package_table(__file__, "figures.toml")[layout] | more
    return Figure(panels, **own | {name: Axis(**own[name]) for name in "xy" if isinstance(own.get(name), dict)})


def sketch(name: str, there: Collection[str], **values: object) -> Figure:
    """Return a sketch of ``sketches.toml`` with these values in its texts and the optional strokes named in `there`."""
    table, strokes = package_table(__file__, "sketches.toml")[name], []
    for stroke in (stroke for stroke in table["strokes"] if stroke.get("when", "") in ("", *there)):
        own = {key: value for key, value in stroke.items() if key not in ("when", "box")}
        if "box" in stroke:
            x, y, width, height = stroke["box"]
            right, top = x + width, y + height
            own["points"] = [(x, y), (right, y), (right, top), (x, top), (x, y)]
        strokes.append(PenStroke(**own | {"text": own.get("text", "").format(**values)}))
    drawing = Drawing(strokes, tuple(table["x"]), tuple(table["y"]), equal=table.get("equal", False))
    width_in = table.get("width_in", WIDTH_IN)
    return Figure([Panel([drawing])], row_in=table["height_in"], rest_in=0.0, width_in=width_in)


class Topic:
    """A section of a page.

    Parameters
    ----------
    page : str or Path
        File of the texts: a name in the folder ``texts``, or the path of a study's file.
    key : str
        Key of the topic in the file, and of the section. Each text of a topic has a name and placeholders as in
        ``str.format``.
    """

    def __init__(self, page: str | Path, key: str) -> None:
        where = (str(page), page.name) if isinstance(page, Path) else (__file__, f"texts/{page}.toml")
        self.key, self.texts = key, package_table(*where)[key]

    def say(self, name: str = "text", /, **values: object) -> str:
        """Return a text with these values in its placeholders."""
        return self.texts[name].format(**values)

    def text(self, name: str = "text", kind: str = "plain", /, **values: object) -> Paragraph:
        """Return a paragraph."""
        return Paragraph(self.say(name, **values), kind)

    def listed(self, items: Iterable[str], name: str = "") -> tuple[Block, ...]:
        """Return a paragraph with a list of sentences; empty without sentences."""
        lines, lead = list(items), (self.text(name),) if name else ()
        return (*lead, Paragraph(lines)) if lines else ()

    def figure(self, name: str, figure: Figure, /, **values: object) -> ShownFigure:
        """Return a figure with its caption."""
        return ShownFigure(name, self.texts["pictures"][name].format(**values), figure)

    def table(self, records: Iterable[Any], name: str = "table", /, **values: object) -> ShownTable:
        """Return a table with a row for each record: an object, a mapping, or a tuple with one value per column.

        A column is ``head | field | form``. The unit in its heading follows from the suffix of the field, such as
        ``stop.speed_m_s``. If a column has no field, each record is a tuple. The form is one of ``format``, or the name
        of a form. A column of the form "spare" is left out if it is empty.
        """
        texts, rows = self.texts[name], list(records)
        heads, columns = [], []
        for index, column in enumerate(texts["columns"]):
            head, field, form = (*map(str.strip, column.split("|")), "", "")[:3]
            size, unit = quantity(field)
            column_values = (field_of(row, field) if field else row[index] for row in rows)
            cells = [cell(value if size == 1.0 else value / size, form) for value in column_values]
            if form != SPARE or not {"", NOTHING}.issuperset(cells):
                heads.append(f"{head}, {unit}".strip(", ").format(**values))
                columns.append(cells)
        caption = texts.get("caption", "").format(**values)
        return ShownTable(caption, heads, list(zip(*columns, strict=True)))

    def section(self, *blocks: Block, synthetic: bool | None = None) -> Section:
        """Return a section of these blocks."""
        return Section(self.key, self.say("title"), blocks, synthetic)


def sections_of(
    page: str | Path,
    parts: Mapping[str, Part],
    found: Any,  # noqa: ANN401 - any result
    synthetic: bool | None = None,
) -> list[Section]:
    """Return the sections of a result. Each function in `parts` yields blocks. Sections without blocks are left out."""
    filled = ((topic := Topic(page, key), tuple(part(topic, found))) for key, part in parts.items())
    return [topic.section(*blocks, synthetic=synthetic) for topic, blocks in filled if blocks]


# --- A report as a PDF, set by typst (extra ``pdf``).


def write_pdf(report: Report, target: Path) -> Path:
    """Write a report as a PDF.

    Parameters
    ----------
    report : Report
        Report whose figures have already been drawn.
    target : Path

    Raises
    ------
    CommandError
        typst is not installed, or the file cannot be written.
    """
    try:
        import typst
    except ImportError:
        raise CommandError("typst is not installed", remedy="pip install pneudrive[pdf], or write .html.") from None
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name, svg in report.pictures.items():
            (root / f"{name}.svg").write_text(svg, encoding="utf-8")
        # Every text is a literal, so that no text acts as markup.
        filters = {"literal": literal, "breakable": lambda text: re.sub(r"([_./])", "\\1\u200b", literal(text))}
        source = rendered(TYPST, filters, title=report.title, verdict=report.lines, sections=report.sections)
        (root / "page.typ").write_text(source, encoding="utf-8")
        fonts = Path(load_matplotlib().get_data_path()) / "fonts" / "ttf"
        with whole(target) as temporary:
            temporary.write_bytes(typst.compile(root / "page.typ", root=root, font_paths=[fonts]))  # type: ignore[arg-type]
    return target


def literal(text: str) -> str:
    r"""Return a text as a typst string.

    Examples
    --------
    >>> literal('a "b" #c')
    '"a \\"b\\" #c"'
    """
    plain = "".join(letter if letter.isprintable() else " " for letter in text)
    return json.dumps(plain, ensure_ascii=False)


# --- Page of a fit of any kind: values with intervals, undetermined values, residuals, data.


def write_fit_report(fit: Fit, folder: str | Path) -> Path:
    """Write report.html, which loads no other files, and its figures as PNG and SVG.

    Parameters
    ----------
    fit : Fit
        Fit of any kind. A fit from a file has no residuals.
    folder : path-like
        Made if it does not exist.

    Returns
    -------
    pathlib.Path
        Folder of report.html.

    Raises
    ------
    CommandError
        The folder cannot be written to.
    """
    data, view = Topic("fit", "data"), fit.view()
    # Recordings and nested tables of the provenance are shown elsewhere.
    facts = fit.statistics | {k: v for k, v in fit.provenance.items() if not isinstance(v, list | tuple | dict)}
    rows = []
    for key, value in facts.items():
        (size, unit), is_number = quantity(key), isinstance(value, float)
        text = f"{cell(value / size, '.6g')} {unit}".strip() if is_number else str(value)
        rows.append((data.texts["words"].get(key, key), text))
    words = [data.text("intervals"), *([] if view.figures else [data.text("none")])]
    recordings = data.listed(fit.recordings, "recordings")
    about = data.section(*words, data.table(rows), *recordings, synthetic=False)
    return view_report(view, about, synthetic=fit.synthetic).write(folder)


# --- Provenance: software and sources.

PACKAGES = ("numpy", "scipy", "xarray", "polars", "matplotlib")
_ACCENTS = {'"': "\u0308", "'": "\u0301"}  # of TeX -> combining signs


def software() -> list[tuple[str, str]]:
    """Return the versions of pneudrive, of Python, and of the packages that compute and draw."""
    own = ("pneudrive", __version__), ("Python", platform.python_version())
    return [*own, *((package, version(package)) for package in PACKAGES)]


def references(keys: Iterable[str]) -> tuple[str, ...]:
    """Return entries of references.bib, one line each. Unknown keys are left out."""
    lines = []
    for key in (key for key in keys if key in entries()):
        found = re.findall(r"(\w+)\s*=\s*[{\"](.*?)[}\"],?\s*(?:\n|$)", entries()[key])
        fields = {}
        for name, value in found:  # texts of TeX
            text = re.sub(r"""\\(["'])\{?(\w)\}?""", lambda sign: normalize("NFC", sign[2] + _ACCENTS[sign[1]]), value)
            text = re.sub(r"[{}]", "", text.replace("\\AA", "Å").replace("\\l", "ł"))
            fields[name.lower()] = text.replace("--", "–").replace("\\&", "&").replace("~", " ").strip()
        where = fields.get("journal") or fields.get("publisher") or fields.get("institution") or fields.get("school")
        number = fields.get("number") if "institution" in fields else None
        parts = (fields.get("author"), fields.get("title"), where, number, fields.get("year"), fields.get("note"))
        lines.append(f"[{key}] " + ". ".join(p.rstrip(".") for p in parts if p) + ".")
    return tuple(lines)
