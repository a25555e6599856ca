"""Sizing: from a task to the drives of the catalogue that do it, simulated over given spreads and ranked."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pneudrive.lazy_names import lazy

if TYPE_CHECKING:
    from pneudrive.sizing.search import size as size
    from pneudrive.sizing.task import SizingTask as SizingTask

__getattr__ = lazy(__name__, {"search": ["size"], "task": ["SizingTask"]})
