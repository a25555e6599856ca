"""Sliders for a live simulation in a notebook, built from the page of `pneudrive web`."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.errors import Cancelled, CommandError, PneudriveError
from pneudrive.progress import Watch
from pneudrive.repr_tables import Card, html_of, text_of
from pneudrive.simulation.simulate import run, simulate

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pneudrive.arrays import Keyed, Plain
    from pneudrive.describe import Circuit, Drive
    from pneudrive.describe.tables.starts import StartState
    from pneudrive.simulation.command import Commands

#: Packages that a live notebook needs: the widget, and the server's encoder of curves.
NEEDED = ("anywidget", "starlette", "tomlkit")
INSTALL = 'pip install "pneudrive[notebook]"'
_BUILT = Path(__file__).with_name("web") / "built"


class Explorer:
    """A drive with sliders. Without a live notebook, the drive is shown as text.

    Attributes
    ----------
    changes : dict
        Keys and values that the sliders changed, in the form that ``Drive.replace`` takes.
    """

    def __init__(
        self,
        drive: Drive | Circuit,
        command: Commands,
        duration: str | float,
        initial: StartState,
        keys: Sequence[str],
    ) -> None:
        self._base, self._command, self._duration, self._initial = drive, command, duration, initial
        self._keys = tuple(keys)
        self._widget: Any = None
        self.changes: Plain = {}

    @property
    def drive(self) -> Drive | Circuit:
        """The drive or circuit with the values of the sliders."""
        return self._base.replace(self.changes) if self.changes else self._base

    def simulate(self) -> xr.Dataset:
        """Return the displayed run in the form of `pneudrive.simulate`."""
        return simulate(self.drive, self._command, self._duration, initial=self._initial)

    def begin(self) -> Plain:
        """Return the initial data of the widget: name and sliders.

        Raises
        ------
        CommandError
            If the key of a slider does not belong to a number in the description.
        """
        from pneudrive.web.drive.description import fields_of

        fields = fields_of(self._base)
        free = {one["key"]: one for one in fields["values"] if "number" in one}
        for key in self._keys:
            if key not in free:
                raise CommandError(
                    f'"{key}" has no slider',
                    rule="the key of a number in the description",
                    remedy=f"Known: {', '.join(list(free)[:20])}.",
                )
        names = self._keys or fields["sliders"]
        kept = ("key", "text", "number", "unit", "low", "high")
        return {"name": self._base.name, "sliders": [{name: free[key][name] for name in kept} for key in names]}

    def answer(self, asked: Keyed) -> bytes:
        """Simulate with the changes in a message, and return the encoded curves for the widget."""
        from pneudrive.web.drive.run_request import RunLimit
        from pneudrive.web.live import frame_of, panels_of
        from pneudrive.web.messages import pack, problems_of

        changes = dict(asked.get("changes") or {})
        head = {"number": asked.get("number"), "view": asked.get("view"), "changes": changes}
        try:
            described = self._base.replace(changes) if changes else self._base
            done = run(described, self._command, self._duration, initial=self._initial, watch=Watch(cancel=RunLimit()))
        except Cancelled:
            error: PneudriveError = CommandError("the run is too long for a slider", remedy="Reduce its duration.")
        except PneudriveError as wrong:
            error = wrong
        else:
            self.changes = changes
            return frame_of(done, panels_of(done), int(asked.get("pixels", 1000)), head, {})
        return pack({**head, "problems": problems_of(error)}, {})

    def _repr_mimebundle_(self, **options: Any) -> Any:  # noqa: ANN401 - what a notebook takes
        card = self._card()
        shown = {"text/plain": text_of(card), "text/html": self.drive._repr_html_() + html_of(card)}
        if not is_live():
            return shown
        self._widget = self._widget or self._made()
        made = self._widget._repr_mimebundle_(**options)
        bundle, about = made if isinstance(made, tuple) else (made or {}, {})
        return {**bundle, **shown}, about

    def __repr__(self) -> str:
        return text_of(self._card())

    def _card(self) -> Card:
        """Return the text for display without a live notebook: values at the end of the run, and how to get sliders."""
        found = self.simulate()
        ends = {name: one for name, one in found.data_vars.items() if name in ("position", "pressure_a", "pressure_b")}
        rows = [(str(name), f"{float(one[-1]):.6g} {one.attrs['units']}") for name, one in ends.items()]
        rows += [(key, str(value)) for key, value in self.changes.items()]
        notes = [] if is_live() else [f"Sliders need a live notebook and {INSTALL}."]
        return Card(f"{self._base.name}, at the end of {self._duration}", rows=rows, notes=notes)

    def _made(self) -> Any:  # noqa: ANN401 - a class that exists where its library does
        import anywidget  # pyright: ignore[reportMissingImports] - an extra
        import traitlets

        class Sliders(anywidget.AnyWidget):
            _esm = _BUILT / "widget.js"
            _css = _BUILT / "widget.css"
            begin = traitlets.Dict().tag(sync=True)
            changes = traitlets.Dict().tag(sync=True)

        def follow(widget: Any, asked: Keyed, _buffers: object) -> None:  # noqa: ANN401
            widget.send({}, [self.answer(asked)])
            widget.changes = self.changes  # a view that is opened later begins with them

        made = Sliders(begin=self.begin(), changes=self.changes)
        made.on_msg(follow)
        return made


def is_live() -> bool:
    """Return whether this installation supports a live notebook."""
    return all(find_spec(name) for name in NEEDED) and (_BUILT / "widget.js").is_file()


def explore(
    drive: Drive | Circuit,
    command: Commands = "0 s: 1, 1 s: -1",
    duration: str | float = "2 s",
    *,
    initial: StartState = None,
    sliders: str | Sequence[str] = (),
) -> Explorer:
    """Show a drive in a notebook with sliders. Each change of a slider starts a new simulation.

    Parameters
    ----------
    drive : Drive or Circuit
        Drive or circuit to simulate.
    command, duration, initial
        As for `pneudrive.simulate`. A run may take at most 2 s of computing time.
    sliders : str or sequence of str
        Keys of numbers in the description, such as ``"friction.coulomb"``. Default: friction, supply and mass.

    Returns
    -------
    Explorer
        ``drive`` has the values of the sliders, and ``simulate()`` returns the displayed run. Without a browser, or
        without ``pip install "pneudrive[notebook]"``, the notebook shows text instead of sliders.

    Raises
    ------
    CommandError
        If the key of a slider does not belong to a number in the description.

    Examples
    --------
    >>> import pneudrive as pn
    >>> shown = pn.explore(pn.Drive.load("catalogue:reference"), 0.6, "0.1 s", sliders=["friction.coulomb"])
    >>> shown.drive.friction.coulomb
    30 N
    """
    made = Explorer(drive, command, duration, initial, (sliders,) if isinstance(sliders, str) else sliders)
    if sliders:
        made.begin()
    return made
