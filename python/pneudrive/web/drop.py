"""Copy files into the workspace, and rename them. No file is left incomplete, and no existing file is replaced."""

from __future__ import annotations

import asyncio
import contextlib
import posixpath
import secrets
import shutil
from collections.abc import AsyncIterator
from pathlib import Path

from pneudrive.arrays import Plain
from pneudrive.errors import CommandError
from pneudrive.files.content import exists
from pneudrive.files.writing import alone_in
from pneudrive.simulation.trajectory import whole
from pneudrive.web.workspace import TABLES, Workspace

#: Space that stays free on the disk, and amount of written data after which the space is checked again, bytes.
RESERVE, LOOK_BYTES = 1 << 30, 1 << 26
#: Folder of the shipped recordings with their layout, and name of the folder for copies of them.
SHIPPED, EXAMPLE = Path(__file__).parents[1] / "data" / "demo", "example"


async def take(workspace: Workspace, name: str, expected: int | None, pieces: AsyncIterator[bytes]) -> int:
    """Write a file of a known kind into the workspace and return its size in bytes.

    Parameters
    ----------
    workspace : Workspace
    name : str
        A name without folders.
    expected : int or None
        Size reported by the browser.
    pieces : async iterator of bytes

    Raises
    ------
    CommandError
        The name does not belong to a recording or a description, the file exists, the disk is too full, or the file is
        incomplete.
    """
    target = workspace.path(name)
    if "/" in name:
        raise CommandError(f"{name} is in a folder", rule="dropped files go into the workspace itself")
    if target.exists():
        raise CommandError(f"{name} already exists", remedy="Rename one of the two.")
    folder = workspace.root
    _check_room(folder, name, expected or 0)
    part, size, looked = folder / f".pneudrive-{secrets.token_hex(8)}.part", 0, 0
    try:
        with part.open("xb") as file:
            async for piece in pieces:
                await asyncio.to_thread(file.write, piece)
                size += len(piece)
                if size - looked > LOOK_BYTES:
                    _check_room(folder, name, 0)
                    looked = size
        if expected is not None and size != expected:
            raise CommandError.of("web.cut-off", name=name, size=size, expected=expected)
        _place(part, target)
    except OSError as error:
        raise CommandError(f"{name} cannot be written: {error.strerror}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink()
    return size


def _check_room(folder: Path, name: str, size: int) -> None:
    free = shutil.disk_usage(folder).free
    if size > free - RESERVE:
        raise CommandError.of("web.disk", name=name, free=free / 1e9)


def rename(workspace: Workspace, path: str, to: str) -> None:
    """Give a file another name in an existing folder.

    Raises
    ------
    CommandError
        The file or the folder does not exist, the extension changes, or the new name is taken.
    """
    place, target = workspace.path(path), workspace.path(to)
    if place.suffix.lower() != target.suffix.lower():
        raise CommandError(f"{to} has another file extension", rule=f"the extension must stay {place.suffix}")
    if not place.is_file():
        raise CommandError(f"there is no file {path}")
    if not target.parent.is_dir():
        raise CommandError(f"there is no folder {target.parent.name}", remedy="Make it first.")
    with alone_in(workspace.root):
        _place(place, target)


def with_own_layout(workspace: Workspace, path: str, text: str) -> Plain:
    """Move a recording and its layout into a separate folder. Return the new name of the recording.

    A layout is valid for all recordings of its folder, so a recording of another rig needs another folder.

    Raises
    ------
    CommandError, LayoutError
        The file does not exist, its folder exists, or the layout is wrong.
    """
    from pneudrive.signals.layout import Layout, stem

    Layout.loads(text, "layout.toml")
    place = workspace.path(path, TABLES)
    if not place.is_file():
        raise CommandError(f"there is no file {path}", remedy="Reload the page.")
    own = posixpath.join(posixpath.dirname(path), stem(place))
    folder = workspace.folder(own)
    with alone_in(workspace.root):
        try:
            folder.mkdir()
            (folder / "layout.toml").write_text(text, encoding="utf-8")
            _place(place, folder / place.name)
        except FileExistsError:
            raise CommandError(f"{own} already exists", remedy="Rename one of the two.") from None
        except OSError as error:
            raise CommandError(f"{own} cannot be written: {error.strerror}", remedy="Check permissions.") from None
    return {"path": f"{own}/{place.name}"}


def add_example(workspace: Workspace) -> Plain:
    """Copy the shipped recordings with their layout into a new folder; return the name of the first one."""
    folder = workspace.folder(EXAMPLE)
    files = [SHIPPED / "layout.toml", *sorted((SHIPPED / "friction").glob("*.xz"))]
    try:
        folder.mkdir(exist_ok=True)
        for file in files:
            if not exists(folder / file.name):
                with whole(folder / file.name) as temporary:
                    shutil.copyfile(file, temporary)
    except (OSError, CommandError) as error:
        reason = error.strerror if isinstance(error, OSError) else error.what.rpartition(": ")[2]
        raise CommandError(f"{EXAMPLE} cannot be written: {reason}") from None
    return {"path": f"{EXAMPLE}/{files[1].name}"}


def _place(part: Path, target: Path) -> None:
    """Rename a complete file, if the new name is still free."""
    try:
        try:
            target.hardlink_to(part)
        except OSError:  # the name is taken, or the file system has no links
            target.touch(exist_ok=False)
            part.replace(target)
    except FileExistsError:
        raise CommandError(f"{target.name} already exists", remedy="Rename one of the two.") from None
    part.unlink(missing_ok=True)
