"""Sizing: from a task to the drives of the catalogue that do it, simulated over given spreads and ranked."""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.sizing.search import size as size
    from pneudrive.sizing.task import SizingTask as SizingTask
