"""What a report is made of: sections of text, tables and pictures; and how they become files."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from io import BytesIO, StringIO
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from pneudrive.errors import CommandError, shown
from pneudrive.report import style
from pneudrive.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.figure import Figure

TEMPLATE = Path(__file__).with_name("report.html.j2")
FIGURES = "figures"
#: What the page may do: it has style of its own, also inside pictures, and loads or runs nothing.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'"


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; `kind` is "plain", "note" (what a reader must know), "code" or "holds" / "fails" of a check."""

    text: str
    kind: str = "plain"


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class PageTable:
    """A table; columns from `numbers_from` on hold numbers and are set to the right."""

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    numbers_from: int = 1


@dataclass(frozen=True)
class Picture:
    """A figure with its file name (without suffix) and caption; where nothing is said, as synthetic as its section."""

    name: str
    caption: str
    figure: Figure
    synthetic: bool | None = None


Block: TypeAlias = Paragraph | Items | PageTable | Picture


@dataclass(frozen=True)
class Section:
    """One section of the report; where nothing is said, as synthetic as the report."""

    key: str
    title: str
    blocks: tuple[Block, ...]
    synthetic: bool | None = None


def section(key: str, title: str, *blocks: Block | None, synthetic: bool | None = None) -> Section:
    """Make a section of the blocks that there are."""
    return Section(key, title, tuple(block for block in blocks if block is not None), synthetic)


def _marked(part: Section, synthetic: bool) -> Section:
    """Say of a section and of its pictures whether they are synthetic."""
    own = synthetic if part.synthetic is None else part.synthetic
    blocks = (
        replace(block, synthetic=own) if isinstance(block, Picture) and block.synthetic is None else block
        for block in part.blocks
    )
    return replace(part, blocks=tuple(blocks), synthetic=own)


@dataclass
class Report:
    """A report: verdict, those of the sections that there are, and the pictures that were written beside it."""

    title: str
    verdict: Iterable[str]
    sections: Sequence[Section | None]
    synthetic: bool = False
    pictures: dict[str, str] = field(default_factory=dict)  # name -> SVG for the page

    def __post_init__(self) -> None:
        self.verdict = list(self.verdict)
        self.sections = [_marked(part, self.synthetic) for part in self.sections if part is not None]

    def write(self, folder: str | Path) -> Path:
        """Write report.html and figures/*.png, *.svg into a folder that is there.

        Raises
        ------
        CommandError
            The folder cannot be written to.
        """
        figures = Path(folder) / FIGURES
        try:
            figures.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise CommandError(f"{figures} cannot be made", value=error.strerror) from None
        for part in self.sections:
            for block in part.blocks if part is not None else ():
                if isinstance(block, Picture):
                    self.pictures[block.name] = write_picture(block, figures)
        target = Path(folder) / "report.html"
        with whole(target) as temporary:
            temporary.write_text(self.html(), encoding="utf-8")
        return target

    def html(self, *, linked: bool = True) -> str:
        """Return the page; it loads nothing from anywhere. `linked`: captions point at the files of the figures."""
        import jinja2
        from markupsafe import Markup

        environment = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True, finalize=_plain)
        template = environment.from_string(TEMPLATE.read_text(encoding="utf-8"))
        drawn = {name: Markup(svg) for name, svg in self.pictures.items()}
        return template.render(
            title=self.title,
            verdict=self.verdict,
            sections=self.sections,
            pictures=drawn,
            folder=FIGURES if linked else "",
            policy=POLICY,
        )


def _plain(value: object) -> object:
    """Show signs that would hide or turn a text as escapes; jinja2 calls this before it escapes what is HTML."""
    return shown(value, len(value)) if type(value) is str else value  # not Markup: pictures are ours


def write_picture(picture: Picture, folder: Path) -> str:
    """Write PNG and SVG; return the SVG as it stands inside a page."""
    style.finish(picture.figure, synthetic=bool(picture.synthetic))
    png = BytesIO()
    picture.figure.savefig(png, format="png", dpi=style.PNG_DPI)
    picture.figure.set_layout_engine("none")  # laid out once is enough: it is half of the time
    with whole(folder / f"{picture.name}.png") as temporary:
        temporary.write_bytes(png.getvalue())
    svg = svg_text(picture.figure)
    with whole(folder / f"{picture.name}.svg") as temporary:
        temporary.write_text(svg, encoding="utf-8")
    return inline(svg, picture.name, picture.caption)


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG without a date, so that equal data give equal files."""
    out = StringIO()
    figure.savefig(out, format="svg", metadata={"Date": None})
    return shown(out.getvalue(), out.tell())


def inline(svg: str, name: str, description: str) -> str:
    """Make an SVG fit to stand inside a page beside others: no prologue, names of its own, scaled to the column."""
    import html

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    prefix = re.sub(r"[^A-Za-z0-9]+", "-", name)
    body = re.sub(r'\bid="', f'id="{prefix}-', body)
    body = re.sub(r'(href="#|url\(#)', rf"\g<1>{prefix}-", body)
    label = html.escape(shown(description, len(description)), quote=True)
    return re.sub(r'<svg ([^>]*?)height="[^"]*"( ?)', rf'<svg role="img" aria-label="{label}" \1', body, count=1)
