"""What `test_killed` kills: a process that runs a campaign on the simulated rig."""

from __future__ import annotations

import contextlib
import os
import sys
from importlib import import_module
from pathlib import Path

from pneudrive.cli.main import run as pneudrive
from pneudrive.rig import load_rig

# What is imported on first use elsewhere is imported here, once, by the server that forks the children.
for name in ("polars", "scipy.optimize", "scipy.signal", "scipy.stats", "pneudrive.campaign.running.campaign_run"):
    import_module(name)
load_rig("default").identity()

PROTOCOL = (Path(__file__).parents[1] / "data" / "killed.toml").read_text("utf-8")


def run(folder: str, protocol: str) -> None:
    """Begin the campaign, or go on with it, as the command does; end with its status."""
    with (
        Path(os.devnull).open("w") as nowhere,
        contextlib.redirect_stdout(nowhere),
        contextlib.redirect_stderr(nowhere),
    ):
        status = pneudrive(["campaign", "run", protocol, "--out", folder, "--operator", "anna", "--yes"])
    sys.exit(status)
