"""``pneudrive design``: propose the next points to measure."""

from __future__ import annotations

from math import isclose
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pneudrive.cli.options import option, quantity

if TYPE_CHECKING:
    from pneudrive.identify.design import Design, Limits
    from pneudrive.identify.result import FrictionFit
    from pneudrive.rig.interface import Envelope, Identity

#: Lowest proposed speed by default, m/s.
SLOWEST_M_S = 1e-3
#: Highest proposed gauge pressure by default, Pa, within the range of the rig; and number of levels.
HIGHEST_PA, LEVELS = 6e5, 4
#: Share of the force range for the difference of the pressure forces; the rest is for friction and inertia.
FORCE_SHARE = 0.5
#: Largest number of designs until the protocol fits the requested time, and factor on the time of each next design.
FITS, FIT_SHARE = 5, 0.97
#: Protocol with the default settling times.
ANY_PROTOCOL = 'schema = 1\nname = "any"\n[speed]\nlist = ["1 mm/s"]\n'


def design(
    fit: Annotated[Path, typer.Argument(help="Fit of `pneudrive fit` or `characterise`.", metavar="FIT")],
    rig: Annotated[str, typer.Option(help="Ready rig, rig file, or own code as own_rig.py:make_rig.")] = "default",
    points: Annotated[
        int, typer.Option(help="Number of points, including repeats; 0: twice the number of parameters.", min=0)
    ] = 0,
    time: Annotated[str, typer.Option(help="Time on the rig instead of a number of points, such as '1 h'.")] = "",
    criterion: Annotated[str, typer.Option(help="D: all parameters; I: prediction over the range.")] = "D",
    speeds: Annotated[str, typer.Option(help="Range of speeds; default: 1 mm/s to the highest speed of the rig.")] = "",
    noise: Annotated[str, typer.Option(help="Standard deviation of one point; default: from the fit.")] = "",
    strokes: Annotated[int, typer.Option(help="Strokes in each direction for one point.", min=1)] = 1,
    stops: Annotated[str, typer.Option(help="Stops instead of speeds: the dwell law, such as log or hyperbolic.")] = "",
    scale: Annotated[str, typer.Option(help="With --stops: estimated time constant of the law.")] = "1 s",
    out: Annotated[Path | None, typer.Option(help="Protocol file to write.")] = None,
) -> None:
    """Propose the next points for a fit, with expected intervals, as a protocol for `pneudrive campaign plan`."""
    from pneudrive.campaign.live import duration
    from pneudrive.campaign.plan import lay_out
    from pneudrive.campaign.protocol import parse_protocol
    from pneudrive.errors import CommandError
    from pneudrive.identify.design import design as designed
    from pneudrive.identify.result import FrictionFit
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
        text = _protocol(plan, identity, envelope)
        for _ in range(FITS):  # a cycle takes longer than its strokes
            if asked_s is None:
                break
            over = lay_out(parse_protocol(text), identity, envelope).time_s / asked_s
            if over <= 1.0:
                break
            plan = designed(found, limits, seconds=FIT_SHARE * plan.seconds / over, **options)
            text = _protocol(plan, identity, envelope)
        said = "\n".join([str(plan), *_shared(found, plan)])
    typer.echo(said)
    whole = lay_out(parse_protocol(text), identity, envelope)
    typer.echo(f'on "{identity.name}" the protocol takes {duration(whole.time_s)}')
    if out is None:
        typer.echo("\n" + text.rstrip())
    else:
        out.write_text(text, encoding="utf-8")
        typer.echo(str(out))


def _shared(fit: FrictionFit, plan: Design) -> list[str]:
    """Return a note on shared errors that exceed the errors that more points reduce."""
    from pneudrive.identify.determined import shown_in
    from pneudrive.identify.model import unit_of

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


def _protocol(plan: Design, identity: Identity, envelope: Envelope) -> str:
    """Return the protocol of a design, with only the proposed cells of the crossed table."""
    from pneudrive.campaign.plan import cell_name, lay_out
    from pneudrive.campaign.protocol import parse_protocol
    from pneudrive.describe.toml import value_text

    text = plan.protocol()
    wanted = [(p.speed_m_s, p.gauge_a_pa, p.gauge_b_pa) for p in plan.points]
    cells: dict[str, bool] = {}
    for one in lay_out(parse_protocol(text), identity, envelope).planned:
        if one.cell is not None and one.cell.speed_m_s is not None:
            pair = one.cell.pressures
            at = (one.cell.speed_m_s, pair.a.value_pa, pair.b.value_pa)
            near = any(isclose(at[0], v, rel_tol=1e-4) and abs(at[1] - a) + abs(at[2] - b) < 1.0 for v, a, b in wanted)
            cells[cell_name(one.cycle.levels, one.cell)] = near
    chosen = [name for name, near in cells.items() if near]
    if len(chosen) == len(cells):
        return text
    listed = "".join(f"    {value_text(name)},\n" for name in sorted(chosen))
    return f"{text.rstrip()}\n\n[fraction]  # proposed points\ncells = [\n{listed}]\n"


def _limits(fit: FrictionFit, identity: Identity, envelope: Envelope, speeds: str, strokes: int) -> Limits:
    """Return the possible speeds of the rig, and its pressures on a grid."""
    from pneudrive.campaign.protocol import parse_protocol
    from pneudrive.errors import CommandError
    from pneudrive.identify.design import Limits
    from pneudrive.units import parse_range

    low_m, high_m = envelope.position_m
    stroke, acceleration = high_m - low_m, envelope.acceleration_m_s2
    # starting and stopping take at most half of the stroke
    fastest = min(envelope.speed_m_s, (0.5 * stroke * acceleration) ** 0.5)
    slowest = min(SLOWEST_M_S, fastest / 10.0)
    if speeds:
        with option("--speeds"):
            slowest, wanted = parse_range(speeds, "m/s")
        if wanted > fastest:
            raise CommandError(
                f"--speeds {speeds!r} exceeds the speed that the rig can hold over half of its stroke",
                rule=f"at most {1e3 * fastest:.3g} mm/s",
            )
        fastest = wanted
    settling = parse_protocol(ANY_PROTOCOL).pressure.settling_s
    return Limits((slowest, fastest), _gauges(fit, identity, envelope), stroke, acceleration, strokes, settling)


def _gauges(fit: FrictionFit, identity: Identity, envelope: Envelope) -> tuple[tuple[float, float], ...]:
    """Return the pairs of pressures whose force takes at most half of the rig's force range."""
    top = min(HIGHEST_PA, 1e4 * ((envelope.pressure_pa[1] - identity.ambient_pressure_pa) // 1e4))
    if not fit.model.chambers or top <= 0.0:
        return ((0.0, 0.0),)
    levels = [top * k / (LEVELS - 1) for k in range(LEVELS)]
    pairs = [(a, a) for a in levels]
    if envelope.separate_pressures and fit.model.chambers != ("ab",):
        both = len(fit.model.chambers) > 1
        pairs = [(a, b) for a in levels for b in levels if both or (b if "a" in fit.model.chambers else a) == 0.0]
    areas = (identity.area_a_m2, identity.area_b_m2)
    kept = [(a, b) for a, b in pairs if abs(a * areas[0] - b * areas[1]) <= FORCE_SHARE * envelope.force_n]
    return tuple(kept) or ((0.0, 0.0),)


def _stops(form: str, scale_s: float, points: int, fit: FrictionFit) -> tuple[str, str]:
    from pneudrive.friction.campaign.stops.dwell_design import design_stops

    plan = design_stops(form, scale_s, stops=points or 12, noise_n=fit.statistics["rms_n"])
    return plan.protocol(), str(plan)
