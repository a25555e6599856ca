"""Rigs over OPC UA: server, client, and the map of their nodes."""

from __future__ import annotations

from importlib.util import find_spec

from pneudrive.errors import RigError

if find_spec("asyncua") is None:
    raise RigError("OPC UA needs the optional library asyncua", remedy="pip install 'pneudrive[rig]'")
