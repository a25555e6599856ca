"""A plan in words: blocks with their content and time, data, and the verdict of the pre-flight check."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

from pneudrive.campaign.running.live import duration
from pneudrive.repr_tables import aligned

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.campaign.planning.plan import Plan, Planned
    from pneudrive.campaign.planning.protocol_tables import Pair
    from pneudrive.units import Pressure


def show(plan: Plan) -> str:
    """Return the whole text: blocks with their content and time, and the verdict."""
    rig = f'on "{plan.identity.name}"{" (simulated: its data are synthetic)" if plan.identity.synthetic else ""}'
    return "\n".join(
        [
            f"{plan.protocol.name}, {rig}",
            "",
            *_blocks(plan),
            "",
            *_contents(plan),
            "",
            *_verdict(plan),
        ]
    )


def size(count: float) -> str:
    """Return a number of bytes as text."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"


def _clock(seconds: float) -> str:
    minutes = round(seconds / 60.0)
    return f"{minutes // 60}:{minutes % 60:02d}"


def _blocks(plan: Plan) -> list[str]:
    from pneudrive.campaign.planning.plan import size_of

    groups: dict[int, list[Planned]] = {}
    for one in plan.planned:
        groups.setdefault(one.cycle.block, []).append(one)
    rows = [["block", "set-up", "cells", "cycles", "strokes", "time, h:min", "data"]]
    for block, group in [*groups.items(), (0, list(plan.planned))]:
        levels = group[0].cycle.levels
        rows.append(
            [
                str(block or "all"),
                ", ".join(f"{name} {level}" for name, level in levels.items()) if block and levels else "-",
                str(len({(str(one.cycle.levels), one.cell.name) for one in group if one.cell is not None})),
                str(len(group)),
                str(sum(one.strokes for one in group)),
                _clock(sum(one.time_s for one in group)),
                size(size_of(group)),
            ]
        )
    return aligned(rows if len(groups) > 1 else rows[:2], right_from=2, indent="").splitlines()


def _contents(plan: Plan) -> list[str]:
    from pneudrive.campaign.planning.plan import BYTES_PER_SAMPLE

    p = plan.protocol
    kinds = Counter(one.cycle.kind for one in plan.planned)
    operator_s = sum(one.wait_s for one in plan.planned if one.cycle.kind == "operator")
    settling_s = sum(one.wait_s for one in plan.planned) - operator_s
    axis_s = sum(one.axis_s for one in plan.planned)
    seed = f" (seed {p.seed})" if p.order.kind == "randomised" else ""
    each = f"{p.pressure.settling_s:g} s each, assumed"
    waits = f", settling after changes of pressure {duration(settling_s)} ({each})" if settling_s else ""
    hands = f", operator {duration(operator_s)} (assumed)" if operator_s else ""
    return [
        f"cycles   {', '.join(f'{kind} {count}' for kind, count in kinds.items())}",
        *_factors(plan),
        f"order    {p.order.kind}{seed}; repeats {p.repeats}, replicates {p.order.replicates}",
        f"time     {duration(plan.time_s)}: axis {duration(axis_s)}{waits}{hands}",
        f"data     {plan.samples} samples, {size(plan.bytes)} "
        f"({BYTES_PER_SAMPLE:g} bytes per sample, measured on files of the simulated rig)",
    ]


def _factors(plan: Plan) -> list[str]:
    p, out = plan.protocol, []
    if p.speed is not None:
        out.append(f"speed    {_range(p.speed.levels_m_s, 1e3, 'mm/s')}")
    if p.stop is not None:
        out.append(f"stop     {_range(p.stop.durations_s, 1.0, 's')}")
        out.append(f"restart  {_range(p.stop.restart_speed_m_s, 1e3, 'mm/s')}")
    return [*out, f"pressure {_pressures(p.pressure.levels)}"]


def _pressures(levels: Sequence[Pair]) -> str:
    """Return the pressures as text, absolute or gauge as stated."""
    (a, b) = levels[0]
    if len(levels) == 1:
        return f"{_bar(a)} in both chambers" if a == b else f"{_bar(a)} in chamber a, {_bar(b)} in chamber b"
    if all(a == b for a, b in levels):
        return f"{len(levels)} levels in both chambers, {_bar(a)} to {_bar(levels[-1][0])}"
    last = levels[-1]
    return f"{len(levels)} pairs, a {_bar(a)} and b {_bar(b)} to a {_bar(last[0])} and b {_bar(last[1])}"


def _bar(pressure: Pressure) -> str:
    return f"{pressure.to('bar'):.6g} bar {'gauge' if pressure.gauge else 'abs'}"


def _range(levels: Sequence[float], factor: float, unit: str) -> str:
    if len(levels) == 1:
        return f"{factor * levels[0]:.4g} {unit}"
    return f"{len(levels)} levels, {factor * levels[0]:.4g} to {factor * levels[-1]:.4g} {unit}"


def _verdict(plan: Plan) -> list[str]:
    from pneudrive.campaign.planning.preflight import margins

    asked = [f"{name} {value:.4g} of {limit:.4g} {unit}" for name, (value, limit, unit) in margins(plan).items()]
    return [f"pre-flight: passed ({', '.join(asked)})", *(f"note: {note}" for note in plan.notes)]
