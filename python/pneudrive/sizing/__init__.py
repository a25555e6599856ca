"""Sizing: find the drives of the catalogue that do a task, simulate them over given spreads, and rank them."""

from __future__ import annotations

from pneudrive.lazy_names import lazily

with lazily(__name__):
    from pneudrive.sizing.search import size as size
    from pneudrive.sizing.task import SizingTask as SizingTask
