"""Parts of a report (sections, text, tables, pictures) and the files made of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from io import BytesIO, StringIO
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from pneudrive import figures
from pneudrive.errors import is_severe, shown
from pneudrive.files.writing import make_subfolder
from pneudrive.report import style
from pneudrive.report.render import render
from pneudrive.simulation.trajectory import whole
from pneudrive.views import Finding, ShownTable

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Sequence

    from matplotlib.figure import Figure

    from pneudrive.views import ShownFigure, View

TEMPLATE = Path(__file__).with_name("report.html.j2")
FIGURES, REPORT = "figures", "report.html"
#: Sections that a long report folds: details, which few readers need. A page of few sections shows them.
DETAILS = ("record", "closure", "reversals", "flags", "budget", "drift", "recovered", "provenance")
DETAILS += ("paper", "stick-slip", "chambers", "identified-axis")
MOST_OPEN = 8
MOST_ROWS = 12  # of a table that is not folded, in a report that folds
#: Permissions of the page: own style, also inside pictures; it loads and runs nothing.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; `kind` is "plain", "note" (a caution), "code", or "holds" / "fails" of a check."""

    text: str
    kind: str = "plain"


@dataclass(frozen=True)
class Items:
    """A list of sentences; `kind` as of a paragraph."""

    items: tuple[str, ...]
    kind: str = "plain"


@dataclass(frozen=True)
class Picture:
    """A figure with its file name (without suffix) and caption; `synthetic` defaults to that of its section."""

    name: str
    caption: str
    figure: figures.Figure | Figure
    synthetic: bool | None = None

    def drawn(self) -> Figure:
        """Draw the figure, within `style.applied`, with letters, mark and fixed places of its panels."""
        figure = render(self.figure) if isinstance(self.figure, figures.Figure) else self.figure
        style.finish(figure, synthetic=bool(self.synthetic))
        style.lay_out(figure)
        return figure


Block: TypeAlias = Paragraph | Items | ShownTable | Picture


@dataclass(frozen=True)
class Section:
    """A section of the report; `synthetic` defaults to that of the report."""

    key: str
    title: str
    blocks: tuple[Block, ...]
    synthetic: bool | None = None


def section(key: str, title: str, *blocks: Block | None, synthetic: bool | None = None) -> Section:
    """Return a section of the blocks that are not None."""
    return Section(key, title, tuple(block for block in blocks if block is not None), synthetic)


def view_section(key: str, view: View, *, synthetic: bool | None = None) -> Section:
    """Return the section of a result: findings, leading values and notes, values, figures and tables."""
    facts: dict[str, list[str]] = {"fails": [], "note": [], "plain": [value.text for value in view.leading]}
    for finding in view.findings:
        kind = {"bad": "fails", "open": "note"}.get(finding.state, "plain")
        facts[kind].append(f"{finding.text} {finding.remedy}".strip())
    facts["plain"] += view.notes
    lists = (Items(tuple(items), kind) for kind, items in facts.items() if items)
    tables = []
    values = (("Values", table) for table in view.value_tables())
    for caption, (head, rows) in (*values, ("Curves", view.curve_table())):
        tables += [ShownTable(caption, tuple(head), tuple(map(tuple, rows)))] if rows else []
    pictures = (Picture(shown.name, shown.caption, shown.figure) for shown in view.figures)
    tables += view.tables
    return section(key, view.title, *lists, *pictures, *tables, synthetic=synthetic)


def view_report(view: View, *sections: Section | None, synthetic: bool = False) -> Report:
    """Return the report of a result: its leading values and bad findings as the verdict, then its view and sections."""
    leading = [Finding(value.text, value.state) for value in view.leading]
    bad = [finding for finding in view.findings if finding.state == "bad"]
    rest = replace(view, title="Result", leading=(), findings=tuple(f for f in view.findings if f.state != "bad"))
    return Report(view.title, [*bad, *leading], [view_section("result", rest), *sections], synthetic)


@style.applied()
def figure_svg(shown: ShownFigure) -> str:
    """Return a figure as an SVG element, for a notebook."""
    return inline(svg_text(Picture(shown.name, shown.caption, shown.figure).drawn()), shown.name, shown.caption)


def _has_severe(part: Section) -> bool:
    """Return whether a section has a severe finding; such a section is not folded."""
    texts: list[str] = []
    for block in part.blocks:
        texts += [block.text] if isinstance(block, Paragraph) else block.items if isinstance(block, Items) else ()
        texts += [cell for row in block.rows for cell in row] if isinstance(block, ShownTable) else ()
    return any(map(is_severe, texts))


def _marked(part: Section, synthetic: bool) -> Section:
    """Return a section with `synthetic` filled in, for its pictures too."""
    own = synthetic if part.synthetic is None else part.synthetic
    blocks = (
        replace(block, synthetic=own) if isinstance(block, Picture) and block.synthetic is None else block
        for block in part.blocks
    )
    return replace(part, blocks=tuple(blocks), synthetic=own)


@dataclass
class Report:
    """A report: verdict with the worst lines first, sections, and the pictures in its folder."""

    title: str
    verdict: Iterable[str | Finding]
    sections: Sequence[Section | None]
    synthetic: bool = False
    pictures: dict[str, str] = field(default_factory=dict)  # name -> SVG for the page

    def __post_init__(self) -> None:
        self.sections = [_marked(part, self.synthetic) for part in self.sections if part is not None]

    @property
    def lines(self) -> list[Finding]:
        """Lines of the verdict, the bad ones first."""
        lines = (Finding(v, "bad" if is_severe(v) else "good") if isinstance(v, str) else v for v in self.verdict)
        return sorted(lines, key=lambda line: line.state != "bad")

    @style.applied()
    def write(self, folder: str | Path) -> Path:
        """Write report.html and figures/*.png, *.svg into an existing folder.

        Raises
        ------
        CommandError
            If the folder cannot be written.
        """
        figures = Path(folder) / FIGURES
        make_subfolder(figures)
        for block in self.drawn():
            self.pictures[block.name] = write_picture(block, figures)
        target = Path(folder) / REPORT
        with whole(target) as temporary:
            temporary.write_text(self.html(), encoding="utf-8")
        return target

    def drawn(self) -> Iterator[Picture]:
        """Yield the pictures of all sections."""
        blocks = (block for part in self.sections if part is not None for block in part.blocks)
        return (block for block in blocks if isinstance(block, Picture))

    @style.applied()
    def plain_svg(self) -> dict[str, str]:
        """Return the pictures that are not yet part of the page as SVG, by name."""
        out = {}
        for block in self.drawn():
            if block.name not in self.pictures:
                out[block.name] = svg_text(block.drawn())
        return out

    def alone(self) -> str:
        """Return the page with its pictures inside, without a folder of figures. It loads nothing."""
        captions = {block.name: block.caption for block in self.drawn()}
        self.pictures |= {name: inline(svg, name, captions[name]) for name, svg in self.plain_svg().items()}
        return self.html(linked=False)

    def html(self, *, linked: bool = True) -> str:
        """Return the page, which loads nothing. `linked`: captions link to the files of the figures."""
        import jinja2
        from markupsafe import Markup

        environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, finalize=_plain)
        environment.filters["words"] = _words
        details = [part.key for part in self.sections if part and part.key in DETAILS and not _has_severe(part)]
        template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
        drawn = {name: Markup(svg) for name, svg in self.pictures.items()}
        return template.render(
            title=self.title,
            verdict=self.lines,
            sections=self.sections,
            pictures=drawn,
            folded=details if len(self.sections) > MOST_OPEN else (),
            most_rows=MOST_ROWS,
            folder=FIGURES if linked else "",
            policy=POLICY,
        )


def _plain(value: object) -> object:
    """Show characters that hide or reverse a text as escapes; jinja2 calls this before it escapes HTML."""
    return shown(value, len(value)) if type(value) is str else value  # not Markup: pictures are ours


def _words(text: str) -> object:
    """Return a sentence for the page. Text between backticks is user input."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(_plain(text)))))


def write_picture(picture: Picture, folder: Path) -> str:
    """Write PNG and SVG; return the SVG for use inside a page."""
    figure, png = picture.drawn(), BytesIO()
    figure.savefig(png, format="png", dpi=style.PNG_DPI)
    with whole(folder / f"{picture.name}.png") as temporary:
        temporary.write_bytes(png.getvalue())
    svg = svg_text(figure)
    with whole(folder / f"{picture.name}.svg") as temporary:
        temporary.write_text(svg, encoding="utf-8")
    return inline(svg, picture.name, picture.caption)


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG without a date, so that equal data give equal files."""
    out = StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    return shown(out.getvalue(), out.tell())


def inline(svg: str, name: str, description: str) -> str:
    """Return an SVG for use inside a page: no prologue, unique names, and letters of the usual size."""
    import html

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    prefix = re.sub(r"[^A-Za-z0-9]+", "-", name)
    body = re.sub(r'\bid="', f'id="{prefix}-', body)
    body = re.sub(r'(href="#|url\(#)', rf"\g<1>{prefix}-", body)
    label = html.escape(shown(description, len(description)), quote=True)
    points = re.search(r'<svg [^>]*?width="([\d.]+)pt"', body)
    share = min(float(points[1]) / (72.0 * figures.WIDTH_IN), 1.0) if points else 1.0
    size = f'style="max-width: {100.0 * share:.3g}%" ' if share < 1.0 else ""
    given = rf'<svg role="img" aria-label="{label}" {size}\1'
    return re.sub(r'<svg ([^>]*?)height="[^"]*"( ?)', given, body, count=1)
