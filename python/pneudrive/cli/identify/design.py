"""``pneudrive design``: propose the next points to measure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneudrive.cli.options import option, quantity

if TYPE_CHECKING:
    from pneudrive.identify.design import Design, Limits
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.rig.interface import Envelope, Identity

#: Largest number of designs until the protocol fits the requested time, and factor on the time of each next design.
FITS, FIT_SHARE = 5, 0.97


def design(
    fit: Path,
    rig: str = "default",
    points: Annotated[int, typer.Option(min=0)] = 0,
    time: str = "",
    criterion: str = "D",
    speeds: str = "",
    noise: str = "",
    strokes: Annotated[int, typer.Option(min=1)] = 1,
    stops: str = "",
    scale: str = "1 s",
    out: Path | None = None,
) -> None:
    """Propose the next measurements for a fit.

    The file is a protocol for pneudrive campaign plan. The expected intervals are printed.

    Options
    -------
    fit : FIT
        Fit of `pneudrive fit` or `characterise`.
    rig
        Ready rig, rig file, or own code as own_rig.py:make_rig.
    points
        Number of points, including repeats; 0: twice the number of parameters.
    time
        Time on the rig instead of a number of points, such as '1 h'.
    criterion
        D: all parameters; I: prediction over the range.
    speeds
        Range of speeds; default: 1 mm/s to the highest speed of the rig.
    noise
        Standard deviation of one point; default: from the fit.
    strokes
        Strokes in each direction for one point.
    stops
        Stops instead of speeds: the dwell law, such as log or hyperbolic.
    scale
        With --stops: estimated time constant of the law.
    out
        Protocol file to write.
    """
    from pneudrive.campaign.planning.next_points import protocol_of
    from pneudrive.campaign.planning.plan import lay_out
    from pneudrive.campaign.planning.protocol import parse_protocol
    from pneudrive.campaign.running.live import duration
    from pneudrive.cli.output import write_text
    from pneudrive.errors import CommandError
    from pneudrive.identify.design import next_measurements as designed
    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.rig.loading import load_rig

    if out is not None and (out.exists() or out.suffix != ".toml" or not out.parent.is_dir()):
        raise CommandError(
            f"--out {out}: a protocol cannot be written there", rule="a new FILE.toml in a folder that exists"
        )
    if points and time:
        raise CommandError("--points and --time cannot be given together")
    found = FrictionFit.from_toml(fit)
    machine = load_rig(rig)
    identity, envelope = machine.identity(), machine.limits()
    if stops:
        text, said = _stops(stops, quantity("--scale", scale, "s"), points, found)
    else:
        limits = _limits(found, identity, envelope, speeds, strokes)
        asked_s = quantity("--time", time, "s") if time else None
        noise_n = quantity("--noise", noise, "N") if noise else None
        options = {"criterion": criterion, "noise_n": noise_n}
        plan = designed(found, limits, points=points or None, seconds=asked_s, **options)
        text = protocol_of(plan, identity, envelope)
        for _ in range(FITS):  # a cycle takes longer than its strokes
            if asked_s is None:
                break
            over = lay_out(parse_protocol(text), identity, envelope).time_s / asked_s
            if over <= 1.0:
                break
            plan = designed(found, limits, seconds=FIT_SHARE * plan.seconds / over, **options)
            text = protocol_of(plan, identity, envelope)
        said = "\n".join([str(plan), *_shared(found, plan)])
    typer.echo(said)
    whole = lay_out(parse_protocol(text), identity, envelope)
    typer.echo(f'the protocol takes {duration(whole.time_s)} on "{identity.name}"')
    if out is None:
        typer.echo("\n" + text.rstrip())
    else:
        write_text(text, out)


def _shared(fit: FrictionFit, plan: Design) -> list[str]:
    """Return a note if errors shared by all points exceed the errors that more points reduce."""
    from pneudrive.identify.base import shown_in
    from pneudrive.identify.static.model import unit_of

    out = []
    for name, then in plan.half_widths_then.items():
        factor, unit = shown_in(unit_of(name))
        if (both := 2.0 * fit.systematic[name]) > then:
            out.append(f"{name} ± {both / factor:.2g} {unit}")
    if not out:
        return []
    return [
        "- errors shared by all values (sensors, area) are larger, and more points do not reduce them: "
        + ", ".join(out)
    ]


def _limits(fit: FrictionFit, identity: Identity, envelope: Envelope, speeds: str, strokes: int) -> Limits:
    from pneudrive.campaign.planning.next_points import limits_of
    from pneudrive.errors import CommandError
    from pneudrive.units import parse_range

    own = limits_of(fit, identity, envelope, strokes)
    if not speeds:
        return own
    with option("--speeds"):
        slowest, fastest = parse_range(speeds, "m/s")
    if fastest > own.speed_m_s[1]:
        raise CommandError(
            f"--speeds {speeds!r} exceeds the speed that the rig can hold over half of its stroke",
            rule=f"at most {1e3 * own.speed_m_s[1]:.3g} mm/s",
        )
    return replace(own, speed_m_s=(slowest, fastest))


def _stops(form: str, scale_s: float, points: int, fit: FrictionFit) -> tuple[str, str]:
    from pneudrive.friction.campaign.stops.dwell_models import design_stops

    plan = design_stops(form, scale_s, stops=points or 12, noise_n=fit.statistics["rms_n"])
    return plan.protocol(), str(plan)
