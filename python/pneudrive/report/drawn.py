"""A figure that a notebook shows where its bare name stands, without pyplot. Imported only where something is drawn."""

from __future__ import annotations

from io import BytesIO

from matplotlib.figure import Figure

from pneudrive.report import style


class Drawn(Figure):
    """A figure of the report's look."""

    def _repr_png_(self) -> bytes:
        """Draw it for a notebook."""
        with style.applied(), BytesIO() as memory:
            self.savefig(memory, format="png", dpi=style.PNG_DPI)
            return memory.getvalue()
