"""No name leads out of the workspace, and no file is written over that the page does not know."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from pneudrive.errors import CommandError
from pneudrive.files.content import _KINDS, FOLDERS
from pneudrive.web.workspace import SUFFIXES, ChangedError, Workspace, fingerprint

PARTS = [
    *("..", ".", "", "a", "b.toml", "link", "out.toml", "...", "..\\", "/", "\0", "%2e%2e"),
    *("C:", "~", ".ssh", "è", "\ud800"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a workspace beside a secret, with links that lead out of it."""
    root = tmp_path_factory.mktemp("outside")
    inner = root / "studies"
    (inner / "a").mkdir(parents=True)
    (root / "studies-of-others").mkdir()
    for place in (root, inner, inner / "a", root / "studies-of-others"):
        (place / "b.toml").write_text("secret")
    (inner / "link").symlink_to(root)
    (inner / "out.toml").symlink_to(root / "b.toml")
    (inner / "circle.toml").symlink_to(inner / "circle.toml")
    return inner


def escapes(workspace: Workspace, name: str) -> bool:
    try:
        found = workspace.path(name)
    except CommandError:
        return False
    real = os.path.realpath(found)
    return os.path.commonpath([real, workspace.root]) != str(workspace.root) or not real.lower().endswith(SUFFIXES)


@settings(max_examples=200, deadline=None)
@given(st.one_of(st.text(max_size=60), st.lists(st.sampled_from(PARTS), max_size=8).map("/".join)))
@example("link/b.toml")
@example("out.toml")
@example("circle.toml")
@example("../studies-of-others/b.toml")
@example("/etc/passwd.toml")
@example("a/../../b.toml")
@example("x" * 300 + ".toml")
@example("0.XZ")
@example("b.sh")
def test_no_name_escapes(folder: Path, name: str) -> None:
    assert not escapes(Workspace.at(folder), name)


def test_a_law_outside_is_not_read(folder: Path) -> None:
    workspace = Workspace.at(folder)
    for law in ("file:../b.toml", "file:link/b.toml", f"file:{folder.parent}/b.toml"):
        with pytest.raises(CommandError):
            workspace.check_named("axis.toml", {"friction": {"law": law}})
    workspace.check_named("a/axis.toml", {"friction": {"law": "file:../b.toml"}})


def test_a_changed_file_is_not_written_over(tmp_path: Path) -> None:
    workspace = Workspace.at(tmp_path)
    known = workspace.write("axis.toml", "name = 'mine'\n", None)
    assert known == fingerprint("name = 'mine'\n")
    (tmp_path / "axis.toml").write_text("name = 'theirs'\n")
    for claimed in (known, None):
        with pytest.raises(ChangedError) as changed:
            workspace.write("axis.toml", "name = 'mine again'\n", claimed)
        assert changed.value.text == "name = 'theirs'\n"
    assert (tmp_path / "axis.toml").read_text() == "name = 'theirs'\n"
    (tmp_path / "axis.toml").unlink()
    with pytest.raises(ChangedError):
        workspace.write("axis.toml", "name = 'mine again'\n", known)


def test_a_file_of_another_system_keeps_the_ends_of_its_lines(tmp_path: Path) -> None:
    """An editor in a browser has no others than those of Unix; a version control would show every line as changed."""
    workspace, there = Workspace.at(tmp_path), b"# mine\r\nname = 'axis'\r\n"
    (tmp_path / "axis.toml").write_bytes(there)
    known = workspace.write("axis.toml", "# mine\nname = 'again'\n", fingerprint(there.decode()))
    assert (tmp_path / "axis.toml").read_bytes() == b"# mine\r\nname = 'again'\r\n"
    assert workspace.read("axis.toml")[1] == known


def test_kinds_are_told_by_content(tmp_path: Path) -> None:
    for name, text in {
        "axis.toml": 'drive = "catalogue:reference"\n',
        "pair.toml": "[components.left]\n",
        "layout.toml": "[columns]\n",
        ".hidden.toml": "[components.left]\n",
        "notes.md": "x",
        "run.csv": "time_s\n",
        "run.csv.gz": "",
        "run.h5": "",
        "lip.toml": "[let]\n[output]\n",
        "begun.toml": "",
    }.items():
        (tmp_path / name).write_text(text)
    found = {one.path: one.kind for one in Workspace.at(tmp_path).files()}
    assert found == {
        "axis.toml": "drive",
        "pair.toml": "circuit",
        "layout.toml": "layout",
        **dict.fromkeys(("run.csv", "run.csv.gz", "run.h5"), "recording"),
        "lip.toml": "formula",
        "begun.toml": "other",
    }


def test_the_page_lists_files_of_every_kind() -> None:
    text = (Path(__file__).parents[2] / "page" / "src" / "workspace" / "files.ts").read_text()
    groups = re.findall(r"kinds: \[([^\]]*)\] \}", text.split("const GROUPS")[1].split("];")[0])
    titles = [kind for group in groups for kind in re.findall(r'"([\w ]+)"', group)]
    folders = list(FOLDERS)
    told = ["fmu", "recording", "friction map", "task", "other", "unreadable", *folders]
    assert set(titles) == {*told, *_KINDS}
