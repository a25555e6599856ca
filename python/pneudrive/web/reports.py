"""Reports of the folder as separate pages: each address opens one report and nothing else.

A tab that is opened by a link has no token. The address itself is therefore the key: a secret of the length of a
token, for one folder, valid until the server stops. A report never runs code.
"""

from __future__ import annotations

import re
from mimetypes import guess_type
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.report.page import FIGURES, POLICY, REPORT
from pneudrive.web.guard import REPORTS, new_token

if TYPE_CHECKING:
    from collections.abc import MutableMapping

    from pneudrive.web.workspace import Workspace

#: What a browser allows a report to do: nothing but to be seen, saved and left.
SANDBOX = f"{POLICY}; frame-ancestors 'none'; sandbox allow-same-origin allow-downloads"
_PICTURE = re.compile(rf"{FIGURES}/[\w.+-]+\.(?:png|svg)")


class OpenReports:
    """Addresses of reports, by their secrets.

    Parameters
    ----------
    workspace : Workspace
    folders : dict
        Secret -> folder. The guard accepts these secrets.
    """

    def __init__(self, workspace: Workspace, folders: MutableMapping[str, str]) -> None:
        self.workspace, self._folders = workspace, folders

    def address(self, name: str) -> str:
        """Return the address of the report in a folder. The result is empty if there is no report."""
        if not (self.workspace.folder(name) / REPORT).is_file():
            return ""
        secret = next((one for one, folder in self._folders.items() if folder == name), None) or new_token()
        self._folders[secret] = name
        return f"{REPORTS}{secret}/{REPORT}"

    def read(self, secret: str, name: str) -> tuple[bytes, str]:
        """Return a report, or a picture of it, with its type.

        Raises
        ------
        CommandError
            The file is neither.
        """
        if secret in self._folders and (name == REPORT or _PICTURE.fullmatch(name)):
            path = self.workspace.folder(f"{self._folders[secret]}/{name}")
            if path.is_file():
                return path.read_bytes(), guess_type(name)[0] or ""
        raise CommandError("there is no such report", remedy="Open it from the page again.")
