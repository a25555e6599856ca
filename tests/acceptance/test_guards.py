"""What the project says of itself is true: its pages, its layers, its constants."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import tomllib
from pathlib import Path

import pneudrive as pn
from pneudrive import _core, constants

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "python/pneudrive"
ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text("utf-8")
# Where a path of ARCHITECTURE.md may begin.
BEGIN = (ROOT, ROOT / "crates", PACKAGE)


def test_the_architecture_is_one_page():
    assert len(ARCHITECTURE.encode()) <= 9_000


def test_paths_of_the_architecture_exist():
    pages = [ARCHITECTURE, *(page.read_text("utf-8") for page in (ROOT / "docs/architecture").glob("*.md"))]
    said = set(re.findall(r"`([\w./]+(?:/|\.rs|\.py|\.toml|\.md)[\w./]*)`", "\n".join(pages)))
    assert len(said) > 30
    assert not {path for path in said if not any((begin / path).exists() for begin in BEGIN)}


def test_layers_are_those_of_the_linter():
    contract = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["importlinter"]["contracts"][0]
    block = re.search(r"```layers\n(.*?)```", (ROOT / "CONTRIBUTING.md").read_text("utf-8"), re.DOTALL)
    assert block is not None
    assert block[1].splitlines() == [layer.replace("pneudrive.", "") for layer in contract["layers"]]


def test_names_that_the_pages_promise_are_exported():
    pages = [ROOT / "CHANGELOG.md", ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    promised = {
        (name, page.name) for page in pages for name in re.findall(r"\bpn\.(\w+)", page.read_text("utf-8", "replace"))
    }
    assert len(promised) > 20
    assert not {(name, page) for name, page in promised if not hasattr(pn, name)}


def test_proofs_that_the_pages_name_exist():
    for page in (ROOT / "docs").rglob("*.md"):
        text = page.read_text("utf-8", "replace")
        assert not [path for path in re.findall(r"`((?:crates|tests)/[\w/.]+)`", text) if not (ROOT / path).exists()], (
            page
        )
        for name, path in re.findall(r"`(test_\w+)` in `(tests/[\w/.]+)`", text):
            assert f"def {name}(" in (ROOT / path).read_text("utf-8"), (page, name)


def _crates():
    told = subprocess.run(
        ["cargo", "metadata", "--format-version", "1", "--no-deps", "--offline"],
        cwd=ROOT, capture_output=True, check=True,
    )  # fmt: skip
    return json.loads(told.stdout)["packages"]


def test_there_is_one_version():
    version = tomllib.loads((ROOT / "Cargo.toml").read_text("utf-8"))["workspace"]["package"]["version"]
    assert pn.__version__ == version
    assert "version" in tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]["dynamic"]
    assert {crate["version"] for crate in _crates()} == {version}
    citation = (ROOT / "CITATION.cff").read_text("utf-8")
    keys = dict(re.findall(r"^([\w-]+): *(.*)$", citation, re.MULTILINE))
    assert {"cff-version", "message", "title", "authors"} <= keys.keys(), "what the format asks for"
    assert (keys["cff-version"], keys["version"], keys["license"]) == ("1.2.0", version, "Apache-2.0")


def test_no_test_stands_where_cargo_does_not_look():
    """`make test` builds most libraries once, without tests inside them, and no code of documentation."""
    libraries = [target for package in _crates() for target in package["targets"] if "lib" in target["kind"]]
    assert any(not library["test"] for library in libraries)
    for library in libraries:
        for path in Path(library["src_path"]).parent.rglob("*.rs"):
            text = path.read_text("utf-8")
            assert library["test"] or "#[test]" not in text, f"{path}: put the test into the crate's tests/"
            assert not re.search(r"^\s*//[/!] *```", text, re.MULTILINE), f"{path}: is not run"


def test_crates_know_what_the_architecture_says():
    """What each crate's row calls known is among its dependencies, and nothing that is not known through those."""
    rows = re.findall(r"^\| `(?:crates|examples)/([\w-]+)` \|.*\| ([\w, ]+) \|$", ARCHITECTURE, re.MULTILINE)
    said = {crate: set() if knows == "nothing" else set(knows.split(", ")) for crate, knows in rows}
    packages = _crates()
    folder = {package["name"]: Path(package["manifest_path"]).parent.name for package in packages}
    depends = {
        folder[package["name"]]: {
            folder[one["name"]] for one in package["dependencies"] if one["kind"] is None and one["name"] in folder
        }
        for package in packages
    }
    assert depends.keys() == said.keys()

    def known(crate: str) -> set[str]:
        return said[crate].union(*(known(one) for one in said[crate]))

    for crate, needs in depends.items():
        assert said[crate] <= needs <= known(crate), crate


def _imports(module: str, path: Path, modules: set[str]) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            found |= {name.name for name in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{name.name}" for name in node.names} | {node.module}
    return (found & modules) - {module}


def test_describe_has_no_circles():
    """Imports for type checkers only included; the package itself is not asked, it names its contents lazily."""
    paths = {
        ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts): path
        for path in (PACKAGE / "describe").glob("*.py")
        if path.name != "__init__.py"
    }
    graph = {module: _imports(module, path, set(paths)) for module, path in paths.items()}
    assert any(graph.values())
    while leaves := {module for module, needs in graph.items() if not needs}:
        graph = {module: needs - leaves for module, needs in graph.items() if module not in leaves}
    assert not graph, f"these import each other: {sorted(graph)}"


def _documented(text: str) -> set[str]:
    """Return the parameters that a docstring in numpy's form lists."""
    section = re.split(r"\n\n?[A-Z][A-Za-z ]+\n-{3,}", text.split("\nParameters\n", 1)[1])[0]
    heads = [line for line in section.splitlines()[1:] if line and not line.startswith(" ")]
    return {name.strip().lstrip("*") for head in heads for name in head.split(" : ")[0].split(",")}


def test_docstrings_list_the_parameters_that_functions_have():
    seen = 0
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            text = ast.get_docstring(node) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) else None
            if not isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or "\nParameters\n" not in (text or ""):
                continue
            given = node.args
            every = [*given.posonlyargs, *given.args, *given.kwonlyargs, given.vararg, given.kwarg]
            bound = {"self", "cls"} & {one.arg for one in given.args[:1]}
            assert _documented(text or "") == {one.arg for one in every if one is not None} - bound, (path, node.name)
            seen += 1
    assert seen > 200


def test_constants_are_those_of_the_core():
    core = _core.constants()
    assert len(core) >= 6
    assert {name: getattr(constants, name) for name in core} == core


def test_a_constant_stands_once():
    """No other file of the package writes a number of `constants.py` again."""
    numbers = {value for name, value in vars(constants).items() if name.isupper()} - {1.4, 1e5, 0.2, 4e3}
    for path in PACKAGE.rglob("*.py"):
        text = path.read_text("utf-8")
        if path.name == "constants.py" or not any(str(number) in text for number in numbers):
            continue
        written = {node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)}
        assert not {value for value in written if isinstance(value, float)} & numbers, path
