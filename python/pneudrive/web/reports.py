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


def read_report(workspace: Workspace, secret: str, name: str) -> tuple[bytes, str]:
    """Return a report, or a picture of a report, with its media type. A report never runs code.

    Raises
    ------
    CommandError
        The secret is not valid, or the file is neither a report nor a picture.
    """
    if secret in workspace.reports and (name == REPORT or _PICTURE.fullmatch(name)):
        path = workspace.folder(f"{workspace.reports[secret]}/{name}")
        if path.is_file():
            return path.read_bytes(), guess_type(name)[0] or ""
    raise CommandError("there is no such report", remedy="Open it from the page again.")


def report_address(workspace: Workspace, path: str) -> dict[str, str]:
    """Return the address of the report in a folder. Empty without a report.

    A tab that is opened by a link has no token. The address itself therefore contains a secret of the same length. The
    secret is valid for one folder until the server stops.
    """
    if not (workspace.folder(path) / REPORT).is_file():
        return {"address": ""}
    secret = next((known for known, folder in workspace.reports.items() if folder == path), None) or new_token()
    workspace.reports[secret] = path
    return {"address": f"{REPORTS}{secret}/{REPORT}"}
