"""Figures of a validation: channels, residuals, balances."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.axes import legend_over, stack
from pneudrive.report.tables import quantity
from pneudrive.validate.balance import BALANCES, moving_mass

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.describe.drive import Drive
    from pneudrive.validate.balance import Scene
    from pneudrive.validate.signals import Signals
    from pneudrive.validate.validation import RecordResult


def scale(column: str) -> tuple[float, str]:
    """Return factor from SI and usual unit of a column."""
    size, unit = quantity(column)
    return 1.0 / size, unit


def _name(column: str) -> str:
    return column.rpartition("_")[0].replace("_", " ")


def channels(r: RecordResult) -> Figure:
    """Draw measured and modelled channels, each over its residual."""
    figure, axes = stack(7.2, (2, 1, 2, 1, 2, 1))
    s, part = r.signals, style.thin(r.signals.time_s)
    t = s.time_s[part]
    for column, axis, below in zip(r.channels, axes[::2], axes[1::2], strict=True):
        (factor, unit), measured = scale(column), getattr(s, column)
        free, again = r.free[column], r.restarted[column]
        axis.plot(t, factor * measured[part], color=style.BLACK, label="measured")
        axis.plot(t, factor * free[part], "--", color=style.ORANGE, label="free run")
        axis.set_ylabel(f"{_name(column)} / {unit}")
        below.plot(t, factor * (measured - again)[part], "-", color=style.BLUE, lw=0.7, label="from measured states")
        below.plot(t, factor * (measured - free)[part], "--", color=style.ORANGE, label="free run")
        below.set_ylabel(f"residual / {unit}")
    legend_over(axes[0], 3, handles=[*axes[0].get_lines(), axes[1].get_lines()[0]])
    figure.align_ylabels()
    return figure


def correlation(r: RecordResult, window_s: float) -> Figure:
    """Draw the autocorrelation of the free run's residuals, and the residual of each run from a measured state."""
    figure = style.new_figure(3.6)
    for (column, channel), pair in zip(r.channels.items(), figure.subplots(2, 3).T, strict=True):
        above, below = pair
        factor, unit = scale(column)
        values, bound = channel.whiteness.autocorrelation, channel.whiteness.bound
        above.vlines(np.arange(1, values.size + 1), 0.0, values, color=style.BLACK)
        above.axhspan(-bound, bound, color=style.BAND)
        above.set(ylim=(-1.05, 1.05), title=_name(column), xlabel="lag / samples")
        middle = (np.arange(channel.window_rms.size) + 0.5) * window_s
        below.bar(middle, factor * channel.window_rms, 0.8 * window_s, color=style.BLUE)
        below.set(ylabel=f"rms / {unit}", xlabel="start at / s")
    figure.axes[0].set_ylabel("autocorrelation")
    return figure


def balance(drive: Drive, signals: Signals, found: Scene) -> Figure:
    """Draw terms of the force balance, and residuals of all three balances."""
    figure, axes = stack(5.2, (2, 1, 1, 1))
    part = style.thin(signals.time_s)
    t, terms = signals.time_s[part], found.terms
    lines = (
        ("forces but friction", terms.force_n, "-", style.BLACK),
        ("m a", moving_mass(drive) * signals.acceleration_m_s2, "--", style.BLUE),
        ("friction of the model", np.where(signals.moving, terms.friction_n, np.nan), "-.", style.ORANGE),
    )
    for label, values, line, color in lines:
        axes[0].plot(t, values[part], line, color=color, lw=0.9, label=label)
    axes[0].set_ylabel("force / N")
    units = (("N", 1.0), ("bar/s", 1e-5), ("bar/s", 1e-5))
    some = style.thin(found.time_s)
    for axis, name, values, used, scale, (unit, factor) in zip(
        axes[1:], BALANCES, found.residuals, found.used, found.scale, units, strict=True
    ):
        shown = np.where(used, factor * values, np.nan)
        band = 2.0 * factor * scale[some]
        axis.fill_between(found.time_s[some], -band, band, color=style.BAND)
        axis.plot(found.time_s[some], shown[some], color=style.BLACK, lw=0.8)
        axis.set_ylabel(f"residual of\n{name} /\n{f'({unit})' if '/' in unit else unit}")
    legend_over(axes[0], 3)
    figure.align_ylabels()
    return figure
