"""The widget of `pn.explore` in a real kernel, over the messages that a notebook sends to it."""

from __future__ import annotations

from typing import Any

from jupyter_client.manager import start_new_kernel

import pneudrive as pn
from web.frames import unpack

VIEW = "application/vnd.jupyter.widget-view+json"
COMMAND, DURATION = "0 s: 0.6, 0.5 s: -0.6", "1 s"
SHOW = f"""
import pneudrive as pn
shown = pn.explore(pn.Drive.load("catalogue:reference"), {COMMAND!r}, {DURATION!r})
shown
"""
SAY = "print(shown.simulate().position[-1].item(), float(shown.drive.friction.coulomb))"


def test_a_slider_of_a_notebook_is_answered_with_the_run_of_python() -> None:
    manager, client = start_new_kernel()
    try:
        states: dict[str, dict[str, Any]] = {}
        bundles: list[dict[str, Any]] = []
        said: list[str] = []

        def hear(message: dict[str, Any]) -> None:
            content = message["content"]
            if message["msg_type"] == "comm_open":
                states[content["comm_id"]] = content["data"]["state"]
            elif message["msg_type"] in ("execute_result", "display_data"):
                bundles.append(content["data"])
            elif message["msg_type"] == "stream" and content["name"] == "stdout":
                said.append(content["text"])

        client.execute_interactive(SHOW, output_hook=hear, timeout=60)
        (bundle,) = (one for one in bundles if VIEW in one)
        comm = bundle[VIEW]["model_id"]
        assert "export" in states[comm]["_esm"]
        assert "<svg" in bundle["text/html"]  # for a reader without a kernel

        asked = {"number": 7, "changes": {"friction.coulomb": "31 N"}}
        sent = client.session.msg("comm_msg", {"comm_id": comm, "data": {"method": "custom", "content": asked}})
        client.shell_channel.send(sent)
        while True:
            answer = client.get_iopub_msg(timeout=60)
            if answer["msg_type"] == "comm_msg" and answer["content"]["data"].get("method") == "custom":
                break
        head, _ = unpack(bytes(answer["buffers"][0]))
        run = pn.simulate(pn.Drive.load("catalogue:reference").replace(asked["changes"]), COMMAND, DURATION)
        assert head["number"] == 7
        assert head["ends"]["position_m"] == float(run.position[-1])
        client.execute_interactive(SAY, output_hook=hear, timeout=60)
        assert [float(one) for one in "".join(said).split()] == [float(run.position[-1]), 31.0]
    finally:
        client.stop_channels()
        manager.shutdown_kernel(now=True)
