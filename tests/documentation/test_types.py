"""Type checkers accept what users write: every Python block of the documentation, and the examples."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pneudrive as pn

ROOT = Path(__file__).parents[2]
BIN = Path(sys.executable).parent
BLOCK = re.compile(r"^```(?:python|\{code-cell\}[^\n]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
HEAD = re.compile(r"\A(?:---\n.*?\n---\n|(?::[^\n]*\n)+)", re.DOTALL)
NOT_INSTALLED = {"mujoco", "gymnasium", "torch", "jax"}


def run(words: list[str | Path], cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command, which may find errors, in a folder."""
    return subprocess.run(words, cwd=cwd, capture_output=True, text=True, check=False)


def written(page: Path) -> str:
    """Return the blocks of a page as one program. Lines of blocks that a reader does not see end with a mark."""
    lines = []
    for block in BLOCK.findall(page.read_text("utf-8")):
        head = HEAD.match(block)
        hidden = head is not None and "remove-" in head[0]
        for line in HEAD.sub("", block, count=1).splitlines():
            if ">>> " in block:  # a session: what Python printed stands between its lines
                lines += [line[4:]] if line.startswith((">>> ", "... ")) else []
                continue
            is_command = re.match(r"\s*[%!]", line)
            lines.append("pass" if is_command else f"{line}  # hidden" if hidden and line.strip() else line)
    return "\n".join(lines)


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Write every page with Python, and the examples, as programs into a folder."""
    folder = tmp_path_factory.mktemp("programs")
    pages = [*(ROOT / "docs").glob("*.md"), *(ROOT / "docs").glob("*/*.md"), ROOT / "README.md"]
    texts = {f"{page.parent.name}_{page.stem}".replace("-", "_"): written(page) for page in pages}
    texts |= {path.stem: path.read_text("utf-8") for path in (ROOT / "examples").glob("*.py")}
    for name, text in texts.items():
        if text:
            (folder / f"{name}.py").write_text(text)
    assert len(list(folder.glob("*.py"))) > 45
    return folder


def seen(folder: Path, found: list[tuple[str, int, str]]) -> list[str]:
    """Return the errors of (file, line from 1, message) that stand in what a reader sees."""
    missing = tuple(f'"{name}' for name in NOT_INSTALLED)
    return [
        f"{file}:{line}: {message}"
        for file, line, message in found
        if "# hidden" not in (folder / file).read_text("utf-8").splitlines()[line - 1]
        and not any(name in message for name in missing)
    ]


def test_pyright_accepts_the_documentation_and_the_examples(programs: Path) -> None:
    settings = {"include": ["*.py"], "typeCheckingMode": "standard", "extraPaths": [str(ROOT / "python")]}
    place = {"venvPath": str(BIN.parents[1]), "venv": BIN.parent.name, "reportMissingModuleSource": False}
    (programs / "pyrightconfig.json").write_text(json.dumps(settings | place))
    done = run([BIN / "basedpyright", "--outputjson", "-p", programs], programs)
    all_found = json.loads(done.stdout)["generalDiagnostics"]
    errors = [one for one in all_found if one["severity"] == "error"]
    found = [(Path(one["file"]).name, one["range"]["start"]["line"] + 1, one["message"]) for one in errors]
    assert seen(programs, found) == []


def test_mypy_accepts_the_documentation_and_knows_the_keys_of_a_drive_file(programs: Path) -> None:
    wrong = programs / "wrong" / "wrong.py"
    wrong.parent.mkdir()
    wrong.write_text(
        "import pneudrive as pn\n"
        'pn.Cylinder(kind="rodless", bor="25 mm", stroke="1 m", dead_volume={}, moving_mass="1 kg")\n'
        'drive = pn.Drive.load("catalogue:reference")\n'
        "reveal_type(drive.cylinder.bore)\n"
        "drive.cylinder.borre\n"
    )
    words = ["--config-file=", "--ignore-missing-imports", "--no-error-summary", "--hide-error-context", "."]
    done = run([sys.executable, "-m", "mypy", *words], programs)
    assert not done.stderr
    lines = [line.split(":", 2) for line in done.stdout.splitlines() if ": error:" in line and "wrong.py" not in line]
    assert seen(programs, [(file, int(line), message) for file, line, message in lines]) == []
    for said in (
        'wrong.py:2: error: Unexpected keyword argument "bor"',
        'wrong.py:4: note: Revealed type is "pneudrive.units.UnitFloat"',
        'wrong.py:5: error: "Cylinder" has no attribute "borre"',
    ):
        assert said in done.stdout


def test_a_drive_completes_to_what_a_user_needs() -> None:
    names = dir(pn.Drive.load("catalogue:reference"))
    assert {"cylinder", "friction", "replace", "circuit", "to_toml"} <= set(names)
    assert not {"model_dump", "model_fields", "copy", "json", "__init__"} & set(names)
