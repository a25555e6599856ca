"""Measure the Python package: lines of code, pairs of equal lines, class names, import circles.

    python tools/measure.py            # the figures
    python tools/measure.py --check    # exit status 1 where code is repeated or a budget of budgets.toml is exceeded

A line of code is neither blank nor a comment nor part of a docstring. A pair is two runs of six or more equal lines
of code. White space is ignored, and every name is replaced by the index of its first appearance in the run. Numbers and
strings must be equal. Imports, heads of functions, fields without a value and lone brackets do not count. A circle
is a set of modules that import each other, imports for type checkers included.
"""

from __future__ import annotations

import ast
import io
import keyword
import sys
import tokenize
from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import budgets

ROOT = Path(__file__).parents[1] / "python"
PACKAGE = "pneudrive"
RUN = 6
ALLOWED_PAIRS = 9
SKIPPED = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}

Line = tuple[tuple[bool, str], ...]
"""The tokens of a line: whether it is a name, and its text."""


@dataclass
class Module:
    """One file: its syntax tree and its lines of code by number."""

    name: str
    path: Path
    nodes: list[ast.AST]
    code: dict[int, Line]

    @classmethod
    def read(cls, path: Path) -> Module:
        """Read one file."""
        text = path.read_text("utf-8")
        nodes = list(ast.walk(ast.parse(text)))
        bodies = [node.body for node in nodes if isinstance(getattr(node, "body", None), list)]
        prose = {
            number
            for body in bodies
            for inner in body
            if isinstance(inner, ast.Expr) and isinstance(getattr(inner.value, "value", None), str)
            for number in range(inner.lineno, (inner.end_lineno or inner.lineno) + 1)
        }
        lines: dict[int, list[tuple[bool, str]]] = defaultdict(list)
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type not in SKIPPED:
                for number in range(token.start[0], token.end[0] + 1):
                    is_name = token.type == tokenize.NAME and not keyword.iskeyword(token.string)
                    lines[number].append((is_name, token.string))
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        return cls(name, path, nodes, {n: tuple(tokens) for n, tokens in sorted(lines.items()) if n not in prose})

    def telling(self) -> list[tuple[int, Line]]:
        """Return the lines that count for pairs, with their numbers."""
        thin: set[int] = set()
        for node in self.nodes:
            if isinstance(node, ast.Import | ast.ImportFrom) or (
                isinstance(node, ast.AnnAssign) and node.value is None
            ):
                thin |= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
            elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
                thin |= set(range(min([node.lineno, *(d.lineno for d in node.decorator_list)]), node.body[0].lineno))
        return [
            (number, line)
            for number, line in self.code.items()
            if number not in thin and any(text.strip("()[]{},:.") for _, text in line)
        ]

    def classes(self) -> list[str]:
        """Return the names of all classes."""
        return [node.name for node in self.nodes if isinstance(node, ast.ClassDef)]

    def imports(self, known: set[str]) -> set[str]:
        """Return the modules of the package that this one imports."""
        found: set[str] = set()
        for node in self.nodes:
            if isinstance(node, ast.Import):
                found |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module and node.module != PACKAGE:
                inner = {f"{node.module}.{alias.name}" for alias in node.names}
                found |= inner if inner <= known else inner | {node.module}
            elif isinstance(node, ast.ImportFrom) and node.module:
                found |= {f"{node.module}.{alias.name}" for alias in node.names}
        return (found & known) - {self.name}


def shape(lines: list[Line]) -> tuple[tuple[str, ...], ...]:
    """Return the lines with every name replaced by the number of its first appearance."""
    numbers: dict[str, str] = {}
    return tuple(
        tuple(numbers.setdefault(text, f"#{len(numbers)}") if is_name else text for is_name, text in line)
        for line in lines
    )


def pairs(modules: list[Module]) -> list[tuple[str, str]]:
    """Return the places of equal runs of lines, each pair once."""
    places: dict[tuple[tuple[str, ...], ...], list[tuple[Module, int, int]]] = defaultdict(list)
    telling = {module.name: module.telling() for module in modules}
    for module in modules:
        lines = telling[module.name]
        for first in range(len(lines) - RUN + 1):
            places[shape([line for _, line in lines[first : first + RUN]])].append((module, first, lines[first][0]))
    starts = {
        ((a.name, i), (b.name, j)): (f"{a.path.relative_to(ROOT)}:{m}", f"{b.path.relative_to(ROOT)}:{n}")
        for same in places.values()
        for (a, i, m), (b, j, n) in combinations(same, 2)
        if a is not b or abs(i - j) >= RUN
    }
    return [
        where
        for ((a, i), (b, j)), where in starts.items()
        if ((a, i - 1), (b, j - 1)) not in starts  # the run began before
    ]


def circles(modules: list[Module]) -> list[list[str]]:
    """Return the sets of modules that import each other."""
    known = {module.name for module in modules}
    return budgets.strongly_connected({module.name: module.imports(known) for module in modules})


def sizes_of(modules: list[Module]) -> dict[str, int]:
    """Return the lines of code of each package; modules of the root count for the root."""
    sizes: dict[str, int] = defaultdict(int)
    for module in modules:
        folder = module.path.relative_to(ROOT / PACKAGE).parent
        sizes[folder.parts[0] if folder.parts else PACKAGE] += len(module.code)
    return dict(sizes)


def read_all() -> list[Module]:
    """Read all files of the package."""
    return [Module.read(path) for path in sorted((ROOT / PACKAGE).rglob("*.py"))]


def main() -> int:
    """Print the figures; with ``--check``, fail for repeated code and exceeded budgets."""
    modules = read_all()
    sizes = sizes_of(modules)
    owners: dict[str, list[str]] = defaultdict(list)
    for module in modules:
        for name in module.classes():
            owners[name].append(module.name)
    twice = {name: where for name, where in sorted(owners.items()) if len(where) > 1}
    again, round_trips = pairs(modules), circles(modules)
    for a, b in again:
        print(f"equal lines: {a} and {b}")
    for name, where in twice.items():
        print(f"class {name}: {', '.join(where)}")
    for circle in round_trips:
        print(f"circle: {', '.join(circle)}")
    for part, size in sorted(sizes.items(), key=lambda entry: -entry[1]):
        print(f"{size:7d} {part}")
    print(f"{sum(sizes.values()):7d} lines of code, {len(modules)} files")
    print(f"{len(again):7d} pairs of {RUN} and more equal lines ({ALLOWED_PAIRS} are allowed)")
    print(f"{len(twice):7d} class names that stand twice")
    print(f"{len(round_trips):7d} import circles")
    exceeded = budgets.check() if "--check" in sys.argv else []
    print("\n".join(exceeded))
    repeated = len(again) > ALLOWED_PAIRS or bool(twice) or bool(round_trips)
    return int("--check" in sys.argv and (repeated or bool(exceeded)))


if __name__ == "__main__":
    sys.exit(main())
