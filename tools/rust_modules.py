"""Read which modules of a Rust crate use which, with re-exports followed to the file that defines a name."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

USE = re.compile(r"\b(pub(?:\([\w :]+\))?\s+)?use\s+([^;]+);")
INLINE = re.compile(r"\b(?:crate|super|self)(?:::\w+)+")
ITEM = re.compile(r"\b(?:fn|struct|enum|trait|type|const|static|union|macro_rules!)\s+(\w+)")
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)

Path_ = tuple[str, ...]


def expand(tree: str) -> Iterator[Path_]:
    """Yield each path of a use tree, such as ``a::{b, c::*}``."""
    head, brace, rest = tree.partition("{")
    if not brace:
        yield tuple(re.sub(r"\s+as\s+\w+", "", tree).strip().split("::"))
        return
    prefix = tuple(part for part in head.strip().split("::") if part)
    depth, piece = 0, ""
    for letter in rest.rpartition("}")[0] + ",":
        depth += (letter == "{") - (letter == "}")
        if letter == "," and depth == 0:
            if piece.strip():
                yield from (prefix + inner for inner in expand(piece.strip()))
            piece = ""
        else:
            piece += letter


class Crate:
    """The modules of a crate, each a file."""

    def __init__(self, source: Path) -> None:
        self.files: dict[Path_, Path] = {}
        for path in sorted(source.rglob("*.rs")):
            parts = path.relative_to(source).with_suffix("").parts
            self.files[parts[:-1] if parts[-1] in {"lib", "main", "mod"} else parts] = path
        self.texts = {name: COMMENT.sub("", path.read_text("utf-8")) for name, path in self.files.items()}
        self.items = {name: set(ITEM.findall(text)) for name, text in self.texts.items()}
        self.uses = {name: list(self._uses(name)) for name in self.files}

    def _uses(self, module: Path_) -> Iterator[tuple[bool, Path_]]:
        for public, tree in USE.findall(self.texts[module]):
            yield from ((bool(public), path) for path in expand(" ".join(tree.split())))

    def _absolute(self, module: Path_, path: Path_) -> Path_ | None:
        """Return a path from the root of the crate, or None for one into another crate."""
        if path[0] == "crate":
            return path[1:]
        here = module
        while path and path[0] in {"self", "super"}:
            here = here[:-1] if path[0] == "super" else here
            path = path[1:]
            if path and path[0] not in {"self", "super"}:
                return here + path
        return here + path if path and here + path[:1] in self.files else None

    @cached_property
    def exports(self) -> dict[Path_, list[Path_]]:
        """Absolute paths that each module re-exports."""
        table: dict[Path_, list[Path_]] = {}
        for module, uses in self.uses.items():
            paths = (self._absolute(module, path) for public, path in uses if public)
            table[module] = [path for path in paths if path]
        return table

    def _home(self, path: Path_, seen: frozenset[Path_] = frozenset()) -> set[Path_]:
        """Return the modules that define the name at an absolute path."""
        module = path
        while module not in self.files:
            module = module[:-1]
        if module == path or path in seen:
            return {module}
        name = path[len(module)]
        if name == "*":
            return {module}
        if name not in self.items[module]:
            for export in self.exports[module]:
                if export[-1] == name:
                    return self._home(export, seen | {path})
                if export[-1] == "*" and name in self.items.get(export[:-1], set()):
                    return {export[:-1]}
        return {module}

    def _targets(self, module: Path_) -> Iterator[Path_]:
        text = self.texts[module]
        private = (path for public, path in self.uses[module] if not public)
        inline = (tuple(match.split("::")) for match in INLINE.findall(USE.sub("", text)))
        for relative in (*private, *inline):
            path = self._absolute(module, relative)
            if path is None:
                continue
            if path[-1] != "*":
                yield from self._home(path)
                continue
            for export in self.exports.get(path[:-1], []):
                names = self.items.get(export[:-1], set()) if export[-1] == "*" else {export[-1]}
                if any(re.search(rf"\b{name}\b", text) for name in names):
                    yield from self._home(export)
            if any(re.search(rf"\b{name}\b", text) for name in self.items.get(path[:-1], set())):
                yield path[:-1]

    def graph(self) -> dict[str, set[str]]:
        """Return the modules that each module uses."""
        return {
            "::".join(module): {"::".join(target) for target in self._targets(module) if target != module}
            for module in self.files
        }
