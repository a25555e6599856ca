"""Hold the project to `budgets.toml`: lines of code, prose, files per folder, lines per file and function, circles.

    python tools/budgets.py              # exceeded budgets
    python tools/budgets.py --tighten    # lower each budget to the measured value

A budget is a ceiling that only falls. A change that needs more raises it and gives the reason in the same line.
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from pathlib import Path

import prose
from rust_modules import COMMENT, Crate

ROOT = Path(__file__).parents[1]
FILE = Path(__file__).with_name("budgets.toml")
RULES = {
    "code": "lines of code of a package, a crate or the page",
    "circular": "modules of a crate that use each other in a circle",
    "findings": "sentences to rewrite (tools/prose.py --list FOLDER)",
    "folders": "source files of a folder",
    "files": "lines of a file",
    "functions": "lines of a function of Python or Rust, without its docstring",
    "strings": "modules that are imported by a string (import_module)",
}
# A key that is not in the file has this budget; a rule that is not here has none.
DEFAULTS = {"circular": 0, "folders": 20, "files": 500, "functions": 60, "strings": 0}
PROSE_SHARE = 0.04
SOURCES = {".py", ".rs", ".ts", ".tsx"}


def strongly_connected(graph: dict[str, set[str]]) -> list[list[str]]:
    """Return the sets of modules that use each other (Tarjan, 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    circles: list[list[str]] = []

    def visit(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in sorted(graph[name]):
            if other not in index:
                visit(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], index[other])
        if low[name] == index[name]:
            circle = stack[stack.index(name) :]
            del stack[stack.index(name) :]
            if len(circle) > 1:
                circles.append(sorted(circle))

    for name in sorted(graph):
        if name not in index:
            visit(name)
    return circles


def code_lines(path: Path) -> int:
    """Return the number of lines of a Rust or TypeScript file that are neither blank nor comment."""
    return sum(bool(line.strip()) for line in COMMENT.sub("", path.read_text("utf-8")).splitlines())


def function_lines(path: Path) -> dict[str, int]:
    """Return the lines of each function of a Python or Rust file; of equal names the largest."""
    text, found = path.read_text("utf-8"), Counter[str]()
    if path.suffix == ".py":
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                doc = len((ast.get_docstring(node, clean=False) or "").splitlines())
                found[node.name] = max(found[node.name], node.end_lineno - node.lineno + 1 - doc)
    elif path.suffix == ".rs":  # as rustfmt indents: a body ends at a brace below the first letter of its function
        lines = text.splitlines()
        for first, line in enumerate(lines):
            if not (head := re.match(r"( *)[\w :(\"]*?(?:\) )?\bfn (\w+)", line)):
                continue
            opens = next(i for i in range(first, len(lines)) if lines[i].endswith(("{", "}", ";")))
            if lines[opens].endswith("{"):
                last = next(i for i in range(opens, len(lines)) if lines[i] == f"{head[1]}}}")
                found[head[2]] = max(found[head[2]], last - first + 1)
    return dict(found)


def string_imports(path: Path) -> int:
    """Return how often a file imports a module of the package that a string names."""
    text = path.read_text("utf-8")
    if "import_module" not in text:
        return 0
    calls = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Call) and node.args]
    named = [call for call in calls if "import_module" in ast.unparse(call.func)]
    return sum(re.match(r"f?['\"]pneudrive\.", ast.unparse(call.args[0])) is not None for call in named)


def measured(python: dict[str, int]) -> dict[str, dict[str, int]]:
    """Return the figures of each rule.

    Parameters
    ----------
    python : dict
        Lines of code of each Python package.
    """
    crates = sorted(ROOT.glob("crates/*/src"))
    code = {f"python/{name}": size for name, size in python.items()}
    code |= {f"crates/{source.parent.name}": sum(map(code_lines, source.rglob("*.rs"))) for source in crates}
    code["page"] = sum(code_lines(path) for path in (ROOT / "page/src").rglob("*.ts*"))
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout.decode()
    names = [name for name in listed.split("\0") if Path(name).suffix in SOURCES and (ROOT / name).exists()]
    shipped = [name for name in names if re.match(r"python/|crates/\w+/src/|page/src/|tools/", name)]
    graphs = {source: Crate(source).graph() for source in crates}
    sizes = {name: len((ROOT / name).read_text("utf-8").splitlines()) for name in shipped}
    strings = {name: string_imports(ROOT / name) for name in shipped if name.endswith(".py")}
    return {
        "code": code,
        "circular": {f"crates/{s.parent.name}": sum(map(len, strongly_connected(g))) for s, g in graphs.items()},
        "findings": {folder: flagged for folder, (flagged, _) in PROSE.items()},
        "folders": dict(Counter(str(Path(name).parent) for name in shipped if not name.endswith("__init__.py"))),
        "files": sizes,
        "functions": {
            f"{name}::{function}": lines for name in shipped for function, lines in function_lines(ROOT / name).items()
        },
        "strings": strings,
    }


PROSE = prose.counts()


def allowed(rule: str, key: str, budgets: dict[str, dict[str, int]]) -> int | None:
    """Return the budget of a key, or None if it has no limit."""
    if rule == "findings":
        return max(budgets[rule].get(key, 0), int(PROSE_SHARE * PROSE[key][1]))
    return budgets[rule].get(key, DEFAULTS.get(rule))


def over(figures: dict[str, dict[str, int]], budgets: dict[str, dict[str, int]]) -> list[str]:
    """Return a message for each figure that is above its budget."""
    messages = []
    for rule, table in figures.items():
        for key, value in table.items():
            limit = allowed(rule, key, budgets)
            if limit is None:
                messages.append(f"{key} has no budget of {RULES[rule]}: add it to tools/budgets.toml")
            elif value > limit:
                messages.append(f"{key}: {value} {RULES[rule]}, the budget in tools/budgets.toml is {limit}")
    return messages


def check(python: dict[str, int]) -> list[str]:
    """Return a message for each budget that is exceeded.

    Parameters
    ----------
    python : dict
        Lines of code of each Python package.
    """
    return over(measured(python), tomllib.loads(FILE.read_text("utf-8")))


def tighten(figures: dict[str, dict[str, int]]) -> None:
    """Lower each budget to its measured value, and drop unneeded budgets."""
    rule, lines = "", []
    for text in FILE.read_text("utf-8").splitlines():
        line = text
        if head := re.fullmatch(r"\[(\w+)\]", line):
            rule = head[1]
        if entry := re.match(r'"?([^"=]+?)"? = (\d+)(.*)', line):
            value = min(int(entry[2]), figures[rule].get(entry[1], 0))
            if value <= (allowed(rule, entry[1], {rule: {}}) or 0 if entry[1] in figures[rule] else 0):
                continue
            line = f'"{entry[1]}" = {value}{entry[3]}'
        lines.append(line)
    FILE.write_text("\n".join(lines) + "\n", "utf-8")


def main() -> int:
    """Print each exceeded budget; with ``--tighten``, lower the budgets first."""
    from measure import read_all, sizes_of

    python = sizes_of(read_all())
    if "--tighten" in sys.argv:
        tighten(measured(python))
    messages = check(python)
    print("\n".join(messages) or "no budget is exceeded")
    return int(bool(messages))


if __name__ == "__main__":
    sys.exit(main())
