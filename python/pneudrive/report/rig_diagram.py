"""A rig drawn from what it says of itself: axis, force sensor, piston in its barrel, air."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pneudrive.report import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.rig.interface import Envelope, Identity

# Lengths on the drawing, in units of its own; the barrel lies on y = 0.
AXIS_X, AXIS_WIDTH = (0.0, 2.6), 0.7
SENSOR_X = (1.75, 2.75)
BARREL_X, BARREL_Y = (4.0, 9.0), (-0.5, 0.5)
PISTON_X = (6.1, 6.5)
ROD_Y = 1.0
PORT_X = (4.25, 8.75)
MANIFOLD_Y = -1.35
REGULATOR_Y = -2.1


def rig_diagram(identity: Identity, envelope: Envelope) -> Figure:
    """Draw a rig with the values that it states.

    Parameters
    ----------
    identity, envelope
        What the rig tells of itself.

    Returns
    -------
    matplotlib.figure.Figure
    """
    figure = style.new_figure(2.9)
    axis = figure.subplots()
    axis.set_axis_off()
    axis.grid(visible=False)
    _servo(axis, envelope)
    _sensor(axis, identity)
    _barrel(axis, identity)
    _air(axis, identity, envelope)
    axis.set_xlim(-0.2, 9.4)
    axis.set_ylim(-3.1, 2.4)
    axis.set_aspect("equal")
    return figure


def _servo(axis: Axes, envelope: Envelope) -> None:
    _box(axis, AXIS_X[0], ROD_Y - 0.75, AXIS_X[1] - AXIS_X[0], 0.18, style.SHADE)  # rail
    _box(axis, 0.55, ROD_Y - 0.55, AXIS_WIDTH, 1.1, style.BAND)
    _line(axis, (0.55 + AXIS_WIDTH, SENSOR_X[0]), (ROD_Y, ROD_Y))
    axis.annotate("", (1.45, ROD_Y + 0.75), (0.35, ROD_Y + 0.75), arrowprops={"arrowstyle": "<->", "lw": 0.8})
    low, high = (1e3 * x for x in envelope.position_m)
    _text(
        axis,
        1.3,
        -0.5,
        f"servo axis: {low:.0f} to {high:.0f} mm\n"
        f"up to {1e3 * envelope.speed_m_s:.0f} mm/s, {envelope.acceleration_m_s2:.3g} m/s²,\n"
        f"{envelope.jerk_m_s3:.3g} m/s³",
    )


def _sensor(axis: Axes, identity: Identity) -> None:
    left, right = SENSOR_X
    wave = [left + (right - left) * i / 12 for i in range(13)]
    axis.plot(wave, [ROD_Y + 0.16 * (-1) ** i * (0 < i < 12) for i in range(13)], color=style.BLACK, lw=0.9)
    _line(axis, (right, 0.5 * sum(PISTON_X)), (ROD_Y, ROD_Y))
    _line(axis, (0.5 * sum(PISTON_X),) * 2, (ROD_Y, BARREL_Y[1]))
    words = ["force sensor"]
    if "force_n" in identity.limits:
        words.append(f"±{max(abs(v) for v in identity.limits['force_n']):.0f} N")
    if "force_n" in identity.accuracy:
        words.append(f"u = {identity.accuracy['force_n']:.2g} N")
    if identity.stiffness_n_m is not None:
        words.append(f"{1e-6 * identity.stiffness_n_m:.3g} N/µm")
    _text(axis, 2.9, ROD_Y + 0.95, words[0] + "\n" + ", ".join(words[1:]))


def _barrel(axis: Axes, identity: Identity) -> None:
    x, y = BARREL_X, BARREL_Y
    axis.plot([x[0], x[0], x[1], x[1], x[0]], [y[1], y[0], y[0], y[1], y[1]], color=style.BLACK, lw=1.6)
    _box(axis, PISTON_X[0], y[0] + 0.04, PISTON_X[1] - PISTON_X[0], y[1] - y[0] - 0.08, style.GREY)
    for side in PISTON_X:  # the seals' lips
        axis.plot([side, side], [y[0], y[0] + 0.16], color=style.ORANGE, lw=2.2)
        axis.plot([side, side], [y[1] - 0.16, y[1]], color=style.ORANGE, lw=2.2)
    for name, at in (("a", 5.05), ("b", 7.75)):
        _text(axis, at, 0.0, f"chamber {name}", size=8.5)
    axis.annotate("x, v", (7.4, ROD_Y), (6.5, ROD_Y), arrowprops={"arrowstyle": "->", "lw": 0.9}, va="center")
    bore = 2e3 * math.sqrt(identity.area_a_m2 / math.pi)
    _text(
        axis,
        7.0,
        ROD_Y + 0.95,
        f"piston of {bore:.3g} mm bore, {identity.mass_beyond_sensor_kg:.3g} kg behind the sensor\n"
        "under test: the seals' friction",
    )


def _air(axis: Axes, identity: Identity, envelope: Envelope) -> None:
    for port in PORT_X:
        _line(axis, (port, port), (BARREL_Y[0], MANIFOLD_Y))
    middle = 0.5 * sum(PORT_X)
    low, high = (1e-5 * (p - identity.ambient_pressure_pa) for p in envelope.pressure_pa)
    served = f"{max(low, 0.0):.2g} to {high:.3g} bar gauge"
    if identity.chambers == "open":
        for port in PORT_X:
            _text(axis, port, MANIFOLD_Y - 0.3, "open to ambient")
        return
    if identity.chambers == "common":
        _line(axis, PORT_X, (MANIFOLD_Y, MANIFOLD_Y))
        _line(axis, (middle, middle), (MANIFOLD_Y, REGULATOR_Y))
        _regulator(axis, middle)
        _text(axis, middle, REGULATOR_Y - 0.75, f"one regulator, common manifold: {served}")
        return
    for port in PORT_X:
        _line(axis, (port, port), (MANIFOLD_Y, REGULATOR_Y))
        _regulator(axis, port)
    held = "pressures held" if identity.chambers == "held" else "a regulator for each chamber"
    _text(axis, middle, REGULATOR_Y - 0.75, f"{held}: {served}")


def _regulator(axis: Axes, x: float) -> None:
    _box(axis, x - 0.32, REGULATOR_Y - 0.45, 0.64, 0.5, "white")
    axis.annotate("", (x, REGULATOR_Y), (x, REGULATOR_Y - 0.4), arrowprops={"arrowstyle": "->", "lw": 0.9})


def _box(axis: Axes, x: float, y: float, width: float, height: float, color: str) -> None:
    from matplotlib.patches import Rectangle

    axis.add_patch(Rectangle((x, y), width, height, facecolor=color, edgecolor=style.BLACK, lw=0.9))


def _line(axis: Axes, x: tuple[float, ...], y: tuple[float, ...]) -> None:
    axis.plot(x, y, color=style.BLACK, lw=1.2, solid_capstyle="round")


def _text(axis: Axes, x: float, y: float, text: str, size: float = 7.2) -> None:
    axis.text(x, y, text, ha="center", va="center", fontsize=size)
