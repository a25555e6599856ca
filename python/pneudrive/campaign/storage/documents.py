"""Documents of bluesky's event model for the subscribers of a campaign.

A start, a descriptor, an event for each finished cycle, a stop. Their keys are those of the schemas of the package
event-model; docs/decisions/0004-bluesky.md explains why pneudrive makes them itself.
"""

from __future__ import annotations

import time
import uuid
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

#: The stream of the events, and the name of a campaign as a device.
STREAM, DEVICE = "primary", "campaign"


class Documents:
    """Publisher of the documents of one run.

    Parameters
    ----------
    subscribers : sequence of callable
        Called as ``subscriber(name, document)``, in the thread that runs the campaign.
    source : str
        Source of the data of an event.
    metadata : dict
        Metadata of the start document.
    """

    def __init__(
        self, subscribers: Sequence[Callable[[str, dict], None]], source: str, metadata: dict[str, Any]
    ) -> None:
        self._subscribers, self._source = tuple(subscribers), source
        self._descriptor, self._events = "", 0
        self._run = self._publish("start", {**metadata, "scan_id": 1})

    def _publish(self, name: str, content: dict[str, Any]) -> str:
        document = {"uid": str(uuid.uuid4()), "time": time.time(), **content}
        for subscriber in self._subscribers:
            subscriber(name, document)
        return document["uid"]

    def event(self, data: dict[str, Any]) -> None:
        """Publish an event for a finished cycle, and before the first event the descriptor of its keys."""
        if not self._descriptor:
            kinds = {name: "string" if isinstance(value, str) else "number" for name, value in data.items()}
            keys = {
                name: {"source": self._source, "dtype": kind, "shape": [], "object_name": DEVICE}
                for name, kind in kinds.items()
            }
            content = {
                "run_start": self._run,
                "name": STREAM,
                "data_keys": keys,
                "object_keys": {DEVICE: list(keys)},
                "configuration": {DEVICE: {"data": {}, "timestamps": {}, "data_keys": {}}},
                "hints": {},
            }
            self._descriptor = self._publish("descriptor", content)
        self._events += 1
        times = dict.fromkeys(data, time.time())
        content = {"descriptor": self._descriptor, "seq_num": self._events, "data": data, "timestamps": times}
        self._publish("event", {**content, "filled": {}})

    def stop(self, exit_status: str, reason: str = "") -> None:
        """Publish the end of the run: ``success``, ``abort`` or ``fail``."""
        count = {STREAM: self._events} if self._events else {}
        self._publish(
            "stop", {"run_start": self._run, "exit_status": exit_status, "reason": reason, "num_events": count}
        )
