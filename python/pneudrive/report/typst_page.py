"""A report as a PDF, set by typst (extra ``pdf``)."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.report import style
from pneudrive.report.page import Items, PageTable, Paragraph, Picture
from pneudrive.simulation.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.report.page import Block, Report, Section

#: Sections whose tables and lists are long: in two columns, smaller.
NARROW = ("values", "definitions")
HEIGHTS = {"circuit": "52mm"}
HEAD = """
#set page(paper: "a4", margin: (x: 13mm, y: 13mm), footer: context [
  #set text(6.5pt, fill: luma(90)); #FOOT #h(1fr) #counter(page).display("1 / 1", both: true)])
#set text(font: "DejaVu Sans", size: 7.6pt)
#set par(leading: 0.5em, spacing: 0.7em)
#set table(inset: (x: 2pt, y: 1.6pt), stroke: (x, y) => (bottom: 0.25pt + luma(200)))
#show heading.where(level: 1): it => text(13pt, it.body)
#show heading.where(level: 2): it => block(above: 0.9em, below: 0.5em, text(9.5pt, it.body))
#set list(spacing: 0.45em, indent: 0pt, body-indent: 4pt)
"""


def write_pdf(report: Report, target: Path) -> Path:
    """Write a report as a PDF.

    Parameters
    ----------
    report : Report
        Its `pictures` hold plain SVG.
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
        (root / "page.typ").write_text(typst_of(report), encoding="utf-8")
        fonts = Path(style.load_matplotlib().get_data_path()) / "fonts" / "ttf"
        with whole(target) as temporary:
            temporary.write_bytes(typst.compile(root / "page.typ", root=root, font_paths=[fonts]))  # type: ignore[arg-type]
    return target


def typst_of(report: Report) -> str:
    """Return the source of a page; every text is a literal, so that nothing in it is markup."""
    out = [
        HEAD.replace("#FOOT", f"#{literal(report.title)}"),
        f"#set document(title: {literal(report.title)}, date: none)",
    ]
    out += [f"= #{literal(report.title)}", *(f"- #{literal(line)}" for line in report.verdict)]
    for part in report.sections:
        if part is not None:
            out += _section(part)
    return "\n".join(out) + "\n"


def _section(part: Section) -> Iterator[str]:
    mark = " (synthetic)" if part.synthetic else ""
    yield f"\n== #{literal(part.title + mark)}"
    narrow = part.key in NARROW
    yield f"#[#set text({'5.8pt' if narrow else '7pt'})"
    if narrow:
        yield "#columns(2, gutter: 5mm)["
    for block in part.blocks:
        yield from _block(block)
    yield "]]" if narrow else "]"


def _block(block: Block) -> Iterator[str]:
    if isinstance(block, Paragraph):
        yield f"\n#{literal(block.text)}\n"
    elif isinstance(block, Items):
        yield from (f"- #{literal(item)}" for item in block.items)
        yield ""
    elif isinstance(block, PageTable):
        if block.caption:
            yield f"#text(fill: luma(90))[#{literal(block.caption)}]"
        align = ", ".join("right" if k >= block.numbers_from else "left" for k in range(len(block.head)))
        yield f"#table(columns: {len(block.head)}, align: ({align}),"
        yield "table.header(" + ", ".join(f"strong({literal(text)})" for text in block.head) + "),"
        yield from (", ".join(literal(text) for text in row) + "," for row in block.rows)
        yield ")"
    elif isinstance(block, Picture):
        size = f"height: {HEIGHTS[block.name]}" if block.name in HEIGHTS else "width: 100%"
        yield f'#align(center, image("{block.name}.svg", {size}, alt: {literal(block.caption)}))'
        yield f"#text(6.5pt, fill: luma(90))[#{literal(block.caption)}]\n"


def literal(text: str) -> str:
    r"""Return a text as a string of typst.

    Examples
    --------
    >>> literal('a "b" #c')
    '"a \\"b\\" #c"'
    """
    plain = "".join(letter if letter.isprintable() else " " for letter in text)
    return '"' + plain.replace("\\", "\\\\").replace('"', '\\"') + '"'
