"""Addresses of reports, and rights of a report in the browser."""

from __future__ import annotations

import re
from mimetypes import guess_type

from pneudrive.errors import CommandError
from pneudrive.report.page import FIGURES, POLICY, REPORT
from pneudrive.web.guard import REPORTS, new_token
from pneudrive.web.workspace import Workspace

#: Permissions of a report in a browser: only to be viewed and saved.
SANDBOX = f"{POLICY}; frame-ancestors 'none'; sandbox allow-same-origin allow-downloads"
_PICTURE = re.compile(rf"{FIGURES}/[\w.+-]+\.(?:png|svg)")


class OpenReports:
    """Addresses of reports. A report never runs code.

    A tab that is opened by a link has no token. The address itself therefore contains a secret of the same length. The
    secret is valid for one folder until the server stops.

    Attributes
    ----------
    folders : dict
        Secret -> folder. The guard accepts these secrets.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self.folders = workspace, dict[str, str]()

    def read(self, secret: str, name: str) -> tuple[bytes, str]:
        """Return a report, or a picture of a report, with its media type.

        Raises
        ------
        CommandError
            The file is neither a report nor a picture.
        """
        if secret in self.folders and (name == REPORT or _PICTURE.fullmatch(name)):
            path = self.workspace.folder(f"{self.folders[secret]}/{name}")
            if path.is_file():
                return path.read_bytes(), guess_type(name)[0] or ""
        raise CommandError("there is no such report", remedy="Open it from the page again.")


def report_address(workspace: Workspace, path: str) -> dict[str, str]:
    """Return the address of the report in a folder. Empty without a report."""
    if not (workspace.folder(path) / REPORT).is_file():
        return {"address": ""}
    folders = workspace.state(OpenReports).folders
    secret = next((known for known, folder in folders.items() if folder == path), None) or new_token()
    folders[secret] = path
    return {"address": f"{REPORTS}{secret}/{REPORT}"}
