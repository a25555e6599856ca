"""Random circuits of all kinds of component, and what each run of them must keep.

``python -m trials.random_circuits [--count 2000] [--seed 1] [--first 0]`` draws components, joins their ports at
random, runs them and prints what broke a rule. A circuit is given by (seed, number).

Rules: a drawn circuit runs to its end, or is rejected by a `DescriptionError`. Every sample is finite, every pressure
and temperature is above zero. At rtol 1e-9, mass closes to 1e-12 and energy to 1e-6 of the throughput.
"""

from __future__ import annotations

import argparse
import json
import math
import re
import sys
import time
import tomllib
import warnings
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from pneudrive import Circuit, _core
from pneudrive.describe.connections import AMBIENT
from pneudrive.describe.kinds import component_kinds, is_needed
from pneudrive.errors import DescriptionError, PneudriveWarning
from trials.random_runs import Draw, q

MASS_CLOSES, ENERGY_CLOSES = 1e-12, 1e-6
RTOL, RATE, AMBIENT_PA = 1e-9, 200.0, 101325.0
MOST_REFUSED = 200  # draws until one is a circuit

#: Sensible ranges by key and unit, else by key, else by unit; of columns of points.
RANGES = tomllib.loads(Path(__file__).with_name("ranges.toml").read_text("utf-8"))
KEYS, POINTS, UNITS = RANGES["keys"], RANGES["points"], RANGES["units"]
#: Optional numbers that only those who know what they do change, or that make sense only together.
LEFT_OUT = ("cells", "end_stop_", "wall_temperature", "incline")
#: A piston without ends, which something else has to keep away from them, and platforms, whose numbers fit together.
NOT_DRAWN = ("piston", "platform/")
#: Where along the stroke of its cylinder a stop stands that is met towards b: beyond the start, in the middle.
STOP_SHARE = (0.55, 1.0)
FRICTION = ("coulomb", "stribeck", "lugre")


@dataclass
class Drawn:
    """One circuit, as tables of a file, and what happens to it."""

    tables: dict[str, Any]
    plans: list[tuple[str, list[float], list[float]]] = field(default_factory=list)
    duration: float = 0.5

    @property
    def kinds(self) -> set[str]:
        """Kinds of its components."""
        return {table["kind"] for table in self.tables["components"].values()}


def number(draw: Draw, parameter: dict[str, Any]) -> float | str:
    """Draw a parameter within what it may be, as a file has it."""
    key, unit = parameter["key"], parameter["unit"]
    known = (
        KEYS.get(f"{key} {unit}")
        or KEYS.get(key)
        or next((KEYS[own] for own in KEYS if key.endswith(f"_{own}")), None)
        or UNITS.get(unit)
    )
    if known is None:
        raise LookupError(f"no sensible range is known for {key} in {unit}: add one to KEYS or UNITS")
    low, high = max(known[0], parameter["lower"]), min(known[1], parameter["upper"])
    value = draw.log(low, high) if low > 0.0 else draw.linear(low, high)
    return value if unit in {"1", "-"} else q(value, unit)


def points(draw: Draw, columns: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Draw points of a curve."""
    rows = [[draw.linear(*POINTS[column["key"]]) for column in columns] for _ in range(int(draw.linear(2, 7)))]
    return [
        {column["key"]: q(value, column["unit"]) for column, value in zip(columns, row, strict=True)}
        for row in sorted(rows)
    ]


def friction(draw: Draw) -> dict[str, Any]:
    """Draw a friction table."""
    force, law = draw.log(2.0, 20.0), draw.one(*FRICTION)
    out = {"law": law, "coulomb": q(force, "N"), "viscous": q(draw.log(5.0, 60.0), "N s/m")}
    if law != "coulomb":
        out |= {"breakaway": q(1.4 * force, "N"), "stribeck_velocity": q(draw.log(0.005, 0.05), "m/s")}
    if law == "lugre":
        out |= {"bristle_stiffness": q(force / 5e-5, "N/m"), "bristle_damping": q(force * 20.0, "N s/m")}
    return out


def component(draw: Draw, kind: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Draw the table of a component."""
    out: dict[str, Any] = {"kind": kind}
    for choice in entry["choices"]:
        options = [option for option in choice["options"] if option not in ("as-printed", "averaged")]
        if draw.chance(0.5):
            out[choice["name"]] = draw.one(*options)
    tables = {table for table in (p["within"] for p in entry["parameters"]) if table and draw.chance(0.4)}
    for parameter in entry["parameters"]:
        key, table = parameter["key"], parameter["within"]
        needed = is_needed(parameter, out) or (table in tables and parameter["default"] is None)
        optional = not (parameter["unless"] or (table and table not in tables) or key.startswith(LEFT_OUT))
        if needed or (optional and draw.chance(0.25)):
            out[key] = number(draw, parameter)
    if entry["points"] and not entry["points"]["optional"]:
        out["points"] = points(draw, entry["points"]["columns"])
    if "coefficient" in out:  # of a leak: in place of its gap
        for parameter in entry["parameters"]:
            if parameter["unless"] == "coefficient":
                del out[parameter["key"]]
    if entry["friction"]:
        out["friction"] = friction(draw)
        out.pop("rod_diameter", None)
        if kind not in ("cylinder/rodless", "slide"):
            out["rod_diameter"] = q(0.005, "m")
    return out


def joined_axis(draw: Draw, axis: str, rods: list[str], components: dict[str, Any]) -> str:
    """Join an axis to a rod; a stop, which acts at a place, to one with a stroke, and out of the way of the start."""
    own = components[axis.partition(".")[0]]
    stops = "position" in own
    rod = draw.one(*[rod for rod in rods if not stops or "stroke" in components[rod.partition(".")[0]]])
    if stops:
        stroke = float(components[rod.partition(".")[0]]["stroke"].split()[0])
        share = draw.linear(*STOP_SHARE)
        own["position"] = q(stroke * (share if own.get("side", "b") == "b" else 1.0 - share), "m")
    return f"{rod} -> {axis}"


def draw_circuit(draw: Draw) -> Drawn:
    """Draw components and join their ports: each to a place that has a volume or a pressure, or to another port."""
    entries = {kind: entry for kind, entry in component_kinds().items() if not kind.startswith(NOT_DRAWN)}
    gas_of = {kind: [p for p in entry["ports"] if p["kind"] == "gas"] for kind, entry in entries.items()}
    # Lists, not sets, whose order differs from process to process.
    holding = [kind for kind, ports in gas_of.items() if any(p["holds"] in ("volume", "pressure") for p in ports)]
    cylinders = [kind for kind in holding if entries[kind]["friction"]]
    sources = [kind for kind in holding if gas_of[kind][0]["holds"] == "pressure"]
    others = [kind for kind in entries if kind not in holding]
    kinds = [draw.one(*sources), "tank"] + [draw.one(*sorted(holding)) for _ in range(int(draw.linear(0, 3)))]
    kinds += [draw.one(*others) for _ in range(int(draw.linear(1, 7)))]
    if any(port["kind"] == "axis" for kind in kinds for port in entries[kind]["ports"]):
        kinds.append(draw.one(*sorted(cylinders)))
    names = {f"c{i}": kind for i, kind in enumerate(kinds)}
    components = {name: component(draw, kind, dict(entries[kind])) for name, kind in names.items()}
    places, open_ports, pilots, axes, rods = [AMBIENT], [], [], [], []
    for name, kind in names.items():
        for port in entries[kind]["ports"]:
            one = f"{name}.{port['name']}"
            if port["kind"] == "pilot":
                pilots.append(one)
            elif port["kind"] == "axis":
                moves = entries[kind]["friction"] or port["holds"] == "motion"
                (rods if moves else axes).append(one)
            elif port["holds"] in ("volume", "pressure"):
                places.append(one)
            elif not port["exhaust"] or draw.chance(0.4):
                open_ports.append(one)
    connections, plugged = [], []
    order = [open_ports[i] for i in draw.rng.permutation(len(open_ports))]
    while order:
        one = order.pop()
        other = next((port for port in order if port.partition(".")[0] != one.partition(".")[0]), None)
        if draw.chance(0.04):
            plugged.append(one)
        elif other is not None and draw.chance(0.4):
            order.remove(other)
            connections.append(f"{one} -> {other}")
        else:
            connections.append(f"{one} -> {draw.one(*places)}")
    joined = [AMBIENT, *open_ports, *places[1:]]
    connections += [f"{draw.one(*[port for port in joined if port not in plugged])} .. {pilot}" for pilot in pilots]
    connections += [joined_axis(draw, axis, rods, components) for axis in axes]
    # A chamber to which nothing is joined is shut on purpose, a slide moves by itself.
    alone = [rod for rod in rods if names[rod.partition(".")[0]] == "slide"]
    plugged += [place for place in places[1:] + alone if not any(place in chain.split() for chain in connections)]
    tables = {"schema": 1, "components": components, "connections": connections, "plugged": plugged}
    drawn = Drawn(tables, duration=draw.linear(0.1, 0.6))
    if draw.chance(0.3):
        tables["junctions"] = "series"
    return drawn


def case(seed: int, n: int) -> tuple[Drawn, Circuit, Counter[str]]:
    """Draw circuit `n`: the first draw that is one, and why those before were refused."""
    draw, refused = Draw(seed, n), Counter[str]()
    for _ in range(MOST_REFUSED):
        drawn = draw_circuit(draw)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", PneudriveWarning)
                circuit = Circuit.model_validate(drawn.tables)
                core = _core.Circuit(circuit.core_json())
        except (DescriptionError, ValueError) as error:
            first = str(error).partition("\n")[0]
            refused[re.sub(r"\bc\d+(\.\w+)?|\d[\d.e+-]*", "#", first)[:90]] += 1
            continue
        drawn.plans = plans(draw, core, circuit, drawn.duration)
        volumes = [name for name in core.start_names if name.endswith(".pressure_pa")]
        given = {name.removesuffix(".pressure_pa"): q(draw.log(0.3e5, 8e5), "Pa abs") for name in volumes}
        drawn.tables["initial"] = {name: value for name, value in given.items() if draw.chance(0.7)}
        return drawn, circuit, refused
    raise RuntimeError(f"none of {MOST_REFUSED} draws is a circuit: {refused}")


def plans(draw: Draw, core: _core.Circuit, circuit: Circuit, duration: float) -> list[Any]:
    """Draw steps of some inputs: commands, pressures, forces."""
    out = []
    for name, unit, *_ in core.inputs:
        times = [0.0, *sorted(draw.linear(0.0, duration) for _ in range(int(draw.linear(1, 4))))]
        of = circuit.components[name.partition(".")[0]]
        if name.endswith(".command"):
            # A switching valve without pulses is on or off, as a lock is.
            switches = of.kind.startswith(("valve/switching", "valve/impulse", "rod-lock"))
            is_whole = switches and not getattr(of, "pwm_frequency_hz", 0.0)
            low = 0.0 if switches and not of.kind.endswith(("5/3", "impulse-5/2")) else -1.0
            values = [draw.one(1.0, low, 0.0, 1.0 if is_whole else draw.linear(low, 1.0)) for _ in times]
        elif unit == "Pa" and draw.chance(0.4):
            values = [draw.linear(1.2e5, 9e5) for _ in times]
        elif unit == "N" and draw.chance(0.3):
            values = [draw.linear(-40.0, 40.0) for _ in times]
        elif unit == "m/s3":  # of a carriage
            values = [draw.linear(-2.0, 2.0) for _ in times]
        elif name.endswith(".giving_way"):
            values = [draw.one(0.0, 1.0) for _ in times]
        else:
            continue
        out.append((name, times, values))
    return out


@dataclass
class Outcome:
    """Result of one circuit."""

    kinds: set[str]
    broken: list[str] = field(default_factory=list)
    seconds: float = 0.0


def outcome(drawn: Drawn, circuit: Circuit) -> Outcome:
    """Run a circuit and hold it to the rules."""
    out = Outcome(drawn.kinds)
    started = time.process_time()
    try:
        start = circuit.core_initial(drawn.tables["initial"])
        result = _core.Circuit(circuit.core_json()).simulate(
            drawn.plans, drawn.duration, RATE, start, RTOL, ledger=True
        )
    except Exception as error:
        out.broken.append(f"{type(error).__name__}: {str(error)[:300]}")
    else:
        out.broken += broken(result)
    out.seconds = time.process_time() - started
    return out


def broken(result: Any) -> list[str]:
    """Return the rules that a finished run breaks."""
    out = []
    for name, values in result["columns"].items():
        values = np.asarray(values)  # noqa: PLW2901 - as an array
        if not np.isfinite(values).all():
            out.append(f"{name} is not finite")
        elif name.endswith(("pressure_pa", "temperature_k")) and not values.min() > 0.0:
            out.append(f"{name} = {values.min():g}")
    ledger = result["ledger"]
    for what, most in (("mass_error", MASS_CLOSES), ("energy_error", ENERGY_CLOSES)):
        if not abs(ledger[what]) <= most:
            out.append(f"{what} {ledger[what]:.1e}")
    return out


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", action="store_true", help="print each circuit that breaks a rule")
    arguments = parser.parse_args()
    refused, kinds, outcomes = Counter[str](), Counter[str](), []
    for n in range(arguments.first, arguments.first + arguments.count):
        drawn, circuit, why = case(arguments.seed, n)
        one = outcome(drawn, circuit)
        outcomes.append(one)
        refused += why
        kinds.update(one.kinds)
        for what in one.broken:
            sys.stdout.write(f"{n} {sorted(one.kinds)}: {what}\n")
        if one.broken and arguments.show:
            sys.stdout.write(json.dumps(drawn.__dict__) + "\n")
        sys.stdout.flush()
    seconds = sorted(one.seconds for one in outcomes)
    wrong = sum(bool(one.broken) for one in outcomes)
    sys.stdout.write(f"{len(outcomes)} circuits, {wrong} break a rule; {math.fsum(seconds):.0f} s of processor, ")
    sys.stdout.write(f"median {1e3 * seconds[len(seconds) // 2]:.0f} ms, worst {seconds[-1]:.2f} s\n")
    for title, counter in (("kinds", kinds), ("refused", refused)):
        sys.stdout.write(f"{title}\n" + "".join(f"{count:6d} {what}\n" for what, count in counter.most_common(40)))
    sys.exit(wrong > 0)


if __name__ == "__main__":
    main()
