"""A report as a PDF, set by typst (extra ``pdf``)."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.report import style
from pneudrive.report.page import Items, Paragraph
from pneudrive.simulation.trajectory import whole
from pneudrive.views import ShownFigure, ShownTable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.report.page import Block, Report, Section

#: Sections side by side on the first page, with the width of the first.
BESIDE, BESIDE_WIDTH = ("drive", "numbers"), "52mm"
#: Sections whose tables and lists are long: on a page of their own, in two columns, smaller.
NARROW = ("values", "definitions")
#: A long word may be broken behind these letters.
BREAKS = "_./"
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
    out += [f"= #{literal(report.title)}", *(f"- #{literal(line.text)}" for line in report.lines)]
    parts = [part for part in report.sections if part is not None]
    beside, narrow = ([part for part in parts if part.key in keys] for keys in (BESIDE, NARROW))
    if beside:
        cells = ", ".join(f"[{_joined(part)}]" for part in beside)
        widths = f"({BESIDE_WIDTH}, 1fr)" if len(beside) > 1 else "1"
        out.append(f"#grid(columns: {widths}, gutter: 4mm, {cells})")
    out += [_joined(part) for part in parts if part not in beside and part not in narrow]
    if narrow:
        out += ["#pagebreak(weak: true)", "#columns(2, gutter: 5mm)[", *map(_joined, narrow), "]"]
    return "\n".join(out) + "\n"


def _joined(part: Section) -> str:
    return "\n".join(_section(part))


def _section(part: Section) -> Iterator[str]:
    mark = " (synthetic)" if part.synthetic else ""
    yield f"\n== #{literal(part.title + mark)}"
    yield f"#[#set text({'5.6pt' if part.key in NARROW else '6.4pt'})"
    for block in part.blocks:
        yield from _block(block)
    yield "]"


def _block(block: Block) -> Iterator[str]:
    if isinstance(block, Paragraph):
        yield f"\n#{literal(block.text)}\n"
    elif isinstance(block, Items):
        yield from (f"- #{literal(item)}" for item in block.items)
        yield ""
    elif isinstance(block, ShownTable):
        if block.caption:
            yield f"#block(sticky: true, text(fill: luma(90), {literal(block.caption)}))"
        align = ", ".join("right" if is_number else "left" for is_number in block.are_numbers)
        widths = ", ".join(["auto"] * (len(block.head) - 1) + ["1fr" if not any(block.are_numbers) else "auto"])
        yield f"#table(columns: ({widths}), align: ({align}),"
        yield "table.header(" + ", ".join(f"strong({literal(text)})" for text in block.head) + "),"
        yield from (", ".join(_breakable(text) for text in row) + "," for row in block.rows)
        yield ")"
    elif isinstance(block, ShownFigure):
        yield f'#align(center, image("{block.name}.svg", width: 100%, alt: {literal(block.caption)}))'
        yield f"#text(6.5pt, fill: luma(90))[#{literal(block.caption)}]\n"


def _breakable(text: str) -> str:
    """Return a text as a string of typst, with breaks after some letters of a long word."""
    made = literal(text)
    for letter in BREAKS:
        made = made.replace(letter, letter + "\u200b")
    return made


def literal(text: str) -> str:
    r"""Return a text as a string of typst.

    Examples
    --------
    >>> literal('a "b" #c')
    '"a \\"b\\" #c"'
    """
    plain = "".join(letter if letter.isprintable() else " " for letter in text)
    return '"' + plain.replace("\\", "\\\\").replace('"', '\\"') + '"'
