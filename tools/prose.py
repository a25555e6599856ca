"""Find sentences that a reader has to read twice: in docstrings, doc comments and Markdown.

    python tools/prose.py                    # sentences and findings of each folder
    python tools/prose.py --list [FOLDER]    # the findings of a folder
    python tools/prose.py --since COMMIT     # the findings in lines that were added since a commit

The words are those of `words.toml`. `tools/measure.py --check` limits the fraction of flagged sentences.
"""

from __future__ import annotations

import argparse
import ast
import inspect
import re
import subprocess
import sys
import tomllib
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[1]
WORDS = tomllib.loads(Path(__file__).with_name("words.toml").read_text("utf-8"))
MOST_WORDS: int = WORDS["most_words"]
OPENER = re.compile(rf"({'|'.join(WORDS['openers'])})\b", re.IGNORECASE)
PHRASES = [(re.compile(pattern, re.IGNORECASE), hint) for pattern, hint in WORDS["phrases"].items()]
ANY_PHRASE = re.compile("|".join(WORDS["phrases"]), re.IGNORECASE)
CODE = re.compile(r"`[^`]*`|\$[^$]*\$|\[[^\]]*\]\([^)]*\)|\{[^}]*\}")
SENTENCE_END = re.compile(r"(?<=[.!?:])\s+(?=[A-Z*])")
NOT_PROSE = re.compile(r"^\s*(>>>|\.\. |\||[-=]{3,})", re.MULTILINE)
LIST_ITEM = re.compile(r"\s*([-*]|\d+\.) ")
MARKDOWN_CODE = re.compile(r"\s*(\||#|:|\$\$|>>>|<|!\[|---)|    ")
TYPESCRIPT_COMMENT = re.compile(r"/\*\*(.*?)\*/|^\s*//([^\n]*)$", re.DOTALL | re.MULTILINE)


@dataclass(frozen=True)
class Sentence:
    """A sentence of the project, with its place and its findings."""

    path: str
    line: int
    text: str
    findings: tuple[str, ...]


def judge(sentence: str) -> tuple[str, ...]:
    """Return the findings on a sentence."""
    findings = []
    if OPENER.match(sentence) and not sentence.endswith("?"):
        findings.append(f"begins with '{sentence.split()[0]}': put the subject first")
    if len(sentence.split()) > MOST_WORDS:
        findings.append(f"{len(sentence.split())} words: split the sentence")
    if ANY_PHRASE.search(sentence):
        findings += [hint for pattern, hint in PHRASES if pattern.search(sentence)]
    if sentence.count(";") > 1:
        findings.append("two semicolons: split the sentence")
    return tuple(findings)


def _strings(body: list[ast.stmt]) -> Iterator[tuple[int, str]]:
    """Yield the strings that are statements, with their lines."""
    for node in body:
        if isinstance(node, ast.Expr):
            if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
                yield node.value.lineno, node.value.value
        elif isinstance(inner := getattr(node, "body", None), list):
            yield from _strings(inner)


def python_text(source: str) -> Iterator[tuple[int, str]]:
    """Yield the paragraphs of the docstrings of a file."""
    for start, text in _strings(ast.parse(source).body):
        line = start
        for paragraph in inspect.cleandoc(text).split("\n\n"):
            if not NOT_PROSE.search(paragraph) and not paragraph.startswith("    "):
                yield line, paragraph
            line += paragraph.count("\n") + 2


def rust_text(source: str) -> Iterator[tuple[int, str]]:
    """Yield the blocks of doc comments of a file."""
    block: list[str] = []
    for number, line in enumerate([*source.splitlines(), ""], 1):
        if match := re.match(r"\s*//[/!] ?(.*)", line):
            block.append(match[1])
        elif block:
            yield number - len(block), "\n".join(block)
            block = []


def typescript_text(source: str) -> Iterator[tuple[int, str]]:
    """Yield the comments of a file."""
    for match in TYPESCRIPT_COMMENT.finditer(source):
        text = re.sub(r"^\s*\*", "", match[1] or match[2] or "", flags=re.MULTILINE)
        yield source.count("\n", 0, match.start()) + 1, text


def markdown_text(source: str) -> Iterator[tuple[int, str]]:
    """Yield the paragraphs and list items of a page."""
    fenced, block, start = False, [], 0
    for number, line in enumerate([*source.splitlines(), ""], 1):
        fence = line.lstrip().startswith(("```", "~~~"))
        fenced ^= fence
        prose = bool(line.strip()) and not fenced and not fence and not MARKDOWN_CODE.match(line)
        item = LIST_ITEM.match(line)
        if block and (not prose or item):
            yield start, " ".join(block)
            block = []
        if prose:
            start = start if block else number
            block.append(line[item.end() :] if item else line)


READERS = {
    ".py": python_text,
    ".rs": rust_text,
    ".ts": typescript_text,
    ".tsx": typescript_text,
    ".md": markdown_text,
}


def folder_of(path: str) -> str:
    """Return the folder that a file's sentences count for."""
    parts = path.split("/")
    deep = 2 if parts[0] != "python" else 3
    return "/".join(parts[: min(deep, len(parts) - 1)]) or path


def sentences() -> Iterator[Sentence]:
    """Yield all sentences of the files that git knows, except those of tests and data."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, check=True).stdout.decode()
    for path in filter(None, listed.split("\0")):
        file = ROOT / path
        if file.suffix not in READERS or path.startswith(("tests/", "data/")) or "/tests/" in path or not file.exists():
            continue
        for line, paragraph in READERS[file.suffix](file.read_text("utf-8")):
            for text in SENTENCE_END.split(" ".join(CODE.sub(" X ", paragraph).split())):
                if text:
                    yield Sentence(path, line, text, judge(text))


def counts() -> dict[str, tuple[int, int]]:
    """Return the number of findings and of sentences of each folder."""
    total: Counter[str] = Counter()
    flagged: Counter[str] = Counter()
    for sentence in sentences():
        total[folder_of(sentence.path)] += 1
        flagged[folder_of(sentence.path)] += bool(sentence.findings)
    return {folder: (flagged[folder], total[folder]) for folder in sorted(total)}


def added_since(commit: str) -> dict[str, set[int]]:
    """Return the lines of each file that were added since a commit."""
    diff = subprocess.run(["git", "diff", "-U0", commit], cwd=ROOT, capture_output=True, check=True).stdout
    lines: dict[str, set[int]] = defaultdict(set)
    path = ""
    for text in diff.decode("utf-8", "replace").splitlines():
        if text.startswith("+++ b/"):
            path = text[6:]
        elif match := re.match(r"@@ .*\+(\d+)(?:,(\d+))? @@", text):
            first = int(match[1])
            lines[path] |= set(range(first, first + int(match[2] or 1)))
    return lines


def main() -> int:
    """Print the figures or the findings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--list", nargs="?", const="", metavar="FOLDER")
    parser.add_argument("--since", metavar="COMMIT")
    arguments = parser.parse_args()
    if arguments.list is None and arguments.since is None:
        table = counts()
        for folder, (flagged, total) in sorted(table.items(), key=lambda entry: -entry[1][0] / entry[1][1]):
            print(f"{100 * flagged / total:5.1f} % {flagged:5d} of {total:5d}  {folder}")
        flagged, total = (sum(column) for column in zip(*table.values(), strict=True))
        print(f"{100 * flagged / total:5.1f} % {flagged:5d} of {total:5d}  all")
        return 0
    added = added_since(arguments.since) if arguments.since else None
    for sentence in sentences():
        new = added is None or added.get(sentence.path, set()) & set(range(sentence.line, sentence.line + 12))
        if sentence.findings and new and sentence.path.startswith(arguments.list or ""):
            print(f"{sentence.path}:{sentence.line}: {sentence.text[:240]}\n    {'; '.join(sentence.findings)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
