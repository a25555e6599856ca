"""Hold the project to the ceilings of `budgets.toml`: lines of code, counts of ideas, files, functions, circles, prose.

    python tools/budgets.py              # exceeded ceilings
    python tools/budgets.py --tighten    # lower each ceiling to the measured value

A ceiling counts for the whole project, so that packages trade with each other. It only falls.
"""

from __future__ import annotations

import ast
import io
import re
import subprocess
import sys
import tokenize
import tomllib
from collections import Counter
from pathlib import Path

import prose
from rust_modules import COMMENT, Crate

ROOT = Path(__file__).parents[1]
FILE = Path(__file__).with_name("budgets.toml")
# Figures of a file or a function that is not in `budgets.toml`.
DEFAULTS = {"files": 800, "functions": 60, "strings": 0}
SOURCES = {".py", ".rs", ".ts", ".tsx"}
SKIPPED = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
RUST_TYPE = re.compile(r"^\s*(?:pub(?:\([\w ]+\))? )?(?:struct|enum|trait|union) (\w+)", re.M)


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


def ideas(path: Path) -> Counter[str]:
    """Return the counts of a Python file: lines of code, imports, tokens, records, and copies from record to record."""
    text = path.read_text("utf-8")
    tree, counts = ast.parse(text), Counter[str]()
    code = code_of(text, tree)
    counts["lines"], counts["files"] = len(code), 1
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    counts["tokens"] = sum(token.type not in SKIPPED and token.start[0] in code for token in tokens)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import | ast.ImportFrom):
            counts["imports"] += node.end_lineno - node.lineno + 1
        elif isinstance(node, ast.ClassDef):
            counts["records"] += sum(isinstance(inner, ast.AnnAssign) for inner in node.body) >= 2
        elif isinstance(node, ast.Call):
            attributes = [word for word in node.keywords if isinstance(word.value, ast.Attribute)]
            counts["copies"] += sum(word.value.attr == word.arg for word in attributes) >= 4
    return counts


def code_of(text: str, tree: ast.AST) -> set[int]:
    """Return the numbers of the lines that are neither blank nor a comment nor part of a docstring."""
    prose_lines: set[int] = set()
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for inner in body if isinstance(body, list) else ():
            if isinstance(inner, ast.Expr) and isinstance(getattr(inner.value, "value", None), str):
                prose_lines |= set(range(inner.lineno, inner.end_lineno + 1))
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type not in SKIPPED:
            lines |= set(range(token.start[0], token.end[0] + 1))
    return lines - prose_lines


def empty_comments(text: str) -> int:
    """Return how many doc comments of a Rust file are one word, or describe the result of a function without one."""
    empty, comment, head = 0, "", ""
    for line in map(str.strip, text.splitlines()):
        if line.startswith(("///", "//!")):
            comment += line[3:]
        elif comment and not line.startswith("#["):
            head += f" {line}"
            if "fn " in head and not line.endswith(("{", "}", ";")):
                continue  # the head of the function is longer than this line
            returns = comment.strip().startswith("Returns") and "fn " in head
            empty += len(comment.split()) == 1 or (returns and "->" not in head)
            comment = head = ""
    return empty


def typescript_graph() -> dict[str, set[str]]:
    """Return the modules of the page and the modules that each one imports."""
    source = ROOT / "page/src"
    names = {str(path.relative_to(source).with_suffix("")): path for path in source.rglob("*.ts*")}
    graph = {}
    for name, path in names.items():
        targets = re.findall(r"(?:from|import) \"(\.[^\"]*)\"", path.read_text("utf-8"))
        reached = {str((path.parent / target).resolve().relative_to(source.resolve())) for target in targets}
        graph[name] = {target.removesuffix(".tsx").removesuffix(".ts") for target in reached} & names.keys()
    return graph


def project() -> dict[str, int]:
    """Return the figures that count for the whole project."""
    python = sum(map(ideas, (ROOT / "python/pneudrive").rglob("*.py")), Counter[str]())
    tests = [path.read_text("utf-8") for path in (ROOT / "tests").rglob("*.py")]
    crates = sorted(ROOT.glob("crates/*/src"))
    rust = [COMMENT.sub("", path.read_text("utf-8")) for source in crates for path in source.rglob("*.rs")]
    types = Counter(name for text in rust for name in RUST_TYPE.findall(text))
    page = [path for path in (ROOT / "page/src").rglob("*.ts*") if "generated" not in path.name]
    flagged, sentences = (sum(column) for column in zip(*prose.counts().values(), strict=True))
    return {
        "lines of Python": python["lines"],
        "lines of Rust": sum(bool(line.strip()) for text in rust for line in text.splitlines()),
        "lines of TypeScript": sum(map(code_lines, page)),
        "code lines of Python tests": sum(len(code_of(text, ast.parse(text))) for text in tests),
        "Python files": python["files"],
        "Python classes with two or more fields": python["records"],
        "import lines in 1000 lines of Python": round(1000 * python["imports"] / python["lines"]),
        "calls that copy four or more fields": python["copies"],
        "tokens in 10 lines of Python": round(10 * python["tokens"] / python["lines"]),
        "Rust type names that occur twice": sum(count > 1 for count in types.values()),
        "Rust modules in circles": sum(len(c) for source in crates for c in strongly_connected(Crate(source).graph())),
        "TypeScript modules in circles": sum(map(len, strongly_connected(typescript_graph()))),
        "Rust doc comments of one word, or Returns without a result": sum(
            empty_comments(path.read_text("utf-8")) for source in crates for path in source.rglob("*.rs")
        ),
        "flagged sentences in 1000": round(1000 * flagged / sentences),
    }


def measured() -> dict[str, dict[str, int]]:
    """Return the figures of each table of `budgets.toml`."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout.decode()
    names = [name for name in listed.split("\0") if Path(name).suffix in SOURCES and (ROOT / name).exists()]
    shipped = [name for name in names if re.match(r"python/|crates/\w+/src/|page/src/|tools/", name)]
    return {
        "project": project(),
        "files": {name: len((ROOT / name).read_text("utf-8").splitlines()) for name in shipped},
        "functions": {
            f"{name}::{function}": lines for name in shipped for function, lines in function_lines(ROOT / name).items()
        },
        "strings": {name: string_imports(ROOT / name) for name in shipped if name.endswith(".py")},
    }


def over(figures: dict[str, dict[str, int]], ceilings: dict[str, dict[str, int]]) -> list[str]:
    """Return a message for each figure that is above its ceiling."""
    return [
        f"{table}: {key} = {value}, the ceiling in tools/budgets.toml is {limit}"
        for table, entries in figures.items()
        for key, value in entries.items()
        if value > (limit := ceilings[table].get(key, DEFAULTS.get(table, 0)))
    ]


def check() -> list[str]:
    """Return a message for each ceiling that is exceeded."""
    return over(measured(), tomllib.loads(FILE.read_text("utf-8")))


def tighten(figures: dict[str, dict[str, int]]) -> None:
    """Lower each ceiling to its measured value, and drop ceilings that the default covers."""
    table, lines = "", []
    for line in FILE.read_text("utf-8").splitlines():
        if head := re.fullmatch(r"\[(\w+)\]", line):
            table = head[1]
        if entry := re.match(r'"([^"]+)" = (\d+)(.*)', line):
            value = min(int(entry[2]), figures[table].get(entry[1], 0))
            if value > DEFAULTS.get(table, -1):
                lines.append(f'"{entry[1]}" = {value}{entry[3]}')
        else:
            lines.append(line)
    FILE.write_text("\n".join(lines) + "\n", "utf-8")


def main() -> int:
    """Print each exceeded ceiling; with ``--tighten``, lower the ceilings first."""
    if "--tighten" in sys.argv:
        tighten(measured())
    messages = check()
    print("\n".join(messages) or "no ceiling is exceeded")
    return int(bool(messages))


if __name__ == "__main__":
    sys.exit(main())
