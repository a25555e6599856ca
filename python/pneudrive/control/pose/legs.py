"""Legs of a platform as axes: circuit and controller of each, its reference and its preview, and checks of a path."""

from __future__ import annotations

import json
import warnings
from collections import defaultdict
from math import comb
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.control.axis import supply_of
from pneudrive.control.motion import POWERS, polynomials
from pneudrive.control.tuning import tune
from pneudrive.describe.circuit import Circuit
from pneudrive.errors import CommandError, warn
from pneudrive.platforms.kinematics import LEAST_SINGULAR_VALUE

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.control.motion import Reference
    from pneudrive.control.pose.path import PosePath
    from pneudrive.control.setup import Setup
    from pneudrive.control.tuning import Controller, Tuning
    from pneudrive.platforms import Platform

    Array = NDArray[np.float64]

#: Distance of the knots of a leg's reference, and how far it goes beyond the run, for the horizon of a controller, s.
KNOT_S, BEYOND_S = 5e-3, 0.1
#: Half step of the differences that give jerk and rate of the load, s. Their relative error is 1e-6 at 2 Hz.
STEP_S = 1e-4
#: Part of the force of one leg that acts on another, above which single controllers of the legs may swing (measured).
MOST_COUPLED = 0.4


class Demands(NamedTuple):
    """Motion, force and load of each leg at the knots of a path, shape (m, n); SI units.

    Attributes
    ----------
    times_s : ndarray, shape (m,)
    positions_m, velocities_m_s, accelerations_m_s2, jerks_m_s3 : ndarray
    forces_n, masses_kg : ndarray
        Force of each leg without friction, and its moving mass.
    loads_n, load_rates_n_s : ndarray
        m_i a_i - F_i: force in +x that neither air nor friction gives, and its rate.
    couplings : ndarray, shape (m, n, n)
        Part of the force of leg j that acts on leg i as a load; zero for i = j.
    singular_values : ndarray, shape (m,)
        The smallest one of each pose.
    """

    times_s: Array
    positions_m: Array
    velocities_m_s: Array
    accelerations_m_s2: Array
    jerks_m_s3: Array
    forces_n: Array
    masses_kg: Array
    loads_n: Array
    load_rates_n_s: Array
    couplings: Array
    singular_values: Array


def demands(platform: Platform, path: PosePath, duration_s: float) -> Demands:
    """Return motion, force and load of each leg along a path, by inverse dynamics.

    Raises
    ------
    CommandError
        An arm does not reach a pose.
    """
    times = np.arange(0.0, duration_s + BEYOND_S + KNOT_S, KNOT_S)
    around = [platform.dynamics(*path.at(times + shift)) for shift in (0.0, -STEP_S, STEP_S)]
    own, before, behind = around
    if not np.all(np.isfinite(own.positions_m)):
        row, leg = np.argwhere(~np.isfinite(own.positions_m))[0]
        raise CommandError(f"{platform.legs[leg].name} does not reach the path at t = {times[row]:.4g} s")
    loads = [one.masses_kg * one.accelerations_m_s2 - one.forces_n for one in around]
    return Demands(
        times,
        own.positions_m,
        own.velocities_m_s,
        own.accelerations_m_s2,
        (behind.accelerations_m_s2 - before.accelerations_m_s2) / (2.0 * STEP_S),
        own.forces_n,
        own.masses_kg,
        loads[0],
        (loads[2] - loads[1]) / (2.0 * STEP_S),
        own.couplings * (1.0 - np.eye(len(platform.legs))),
        platform.singular_values(path.at(times)[0])[:, -1],
    )


def check_path(
    platform: Platform, tunings: list[Tuning], needs: Demands, least: float = LEAST_SINGULAR_VALUE
) -> dict[str, float]:
    """Reject a path that a leg cannot follow, and return the smallest margins of the others.

    Returns
    -------
    dict
        ``singular_value``, and the largest fraction of the force of the supply and of the speed of a leg.

    Raises
    ------
    CommandError
        A pose is nearly singular, or a leg leaves its stroke, is too fast, or needs more force than the supply gives.
        The message names time, leg and margin.
    """
    times = needs.times_s
    row = int(np.argmin(needs.singular_values))
    if needs.singular_values[row] < least:
        what = f"the path of {platform.name} comes to a nearly singular pose at t = {times[row]:.4g} s"
        value, rule = f"smallest singular value {needs.singular_values[row]:.3g}", f"at least {least:g}"
        raise CommandError(what, value=value, rule=rule, remedy="Tilt less, or move the path towards half strokes.")
    coupled = float(np.abs(needs.couplings).max())
    if coupled > MOST_COUPLED:
        said = f"up to {100.0 * coupled:.0f} % of the force of a leg of {platform.name} acts on another leg"
        warn(f"{said}: the controllers of single legs may oscillate; inversion stands more of it than nmpc")
    most = {"force": 0.0, "speed": 0.0}
    for i, tuning in enumerate(tunings):
        name, x, v = platform.legs[i].name, needs.positions_m[:, i], needs.velocities_m_s[:, i]
        stroke = tuning.plant.stroke_m
        _within(name, "position", "mm", 1e3 * x, (0.0, 1e3 * stroke), times, "Make the path smaller, or move it.")
        fastest = tuning.plant.speed_m_s
        remedy = "Make the path slower, or take a larger valve."
        _within(name, "velocity", "m/s", v, (-fastest, fastest), times, remedy)
        friction = tuning.plant.coulomb_n * np.sign(v) + _viscous(tuning) * v
        force, (low, high) = needs.forces_n[:, i] + friction, _forces(platform, i, tuning)
        remedy = "Make the path slower, or take a larger cylinder or a higher pressure."
        _within(name, "force", "N", force, (low, high), times, remedy)
        most["speed"] = max(most["speed"], float(np.abs(v).max() / fastest))
        most["force"] = max(most["force"], float((force / high).max()), float((force / low).max()))
    return {"singular_value": float(needs.singular_values[row]), **most}


def _within(
    name: str, what: str, unit: str, values: Array, ends: tuple[float, float], times: Array, remedy: str
) -> None:
    low, high = ends
    margins = np.minimum(values - low, high - values)
    row = int(np.argmin(margins))
    if margins[row] < 0.0:
        said = f"the path asks {name} for a {what} of {values[row]:.4g} {unit} at t = {times[row]:.4g} s"
        rule = f"{low:.4g} {unit} to {high:.4g} {unit}"
        raise CommandError(said, value=f"beyond by {-margins[row]:.3g} {unit}", rule=rule, remedy=remedy)


def _viscous(tuning: Tuning) -> float:
    form = json.loads(tuning.belief.core_json())
    cylinder = next(one for one in form["components"] if one["name"] == tuning.plant.cylinder)
    return float(((cylinder["friction"] or {}).get("parameters") or {}).get("viscous", 0.0))


def _forces(platform: Platform, leg: int, tuning: Tuning) -> tuple[float, float]:
    """Return the force that the supply gives against +x and in +x, N."""
    gauge = supply_of(tuning.belief.core_json())[0] - platform.ambient_pa
    area_a, area_b = platform.legs[leg].areas_m2
    return -gauge * area_b, gauge * area_a


def leg_reference(needs: Demands, leg: int, text: str) -> tuple[Reference, dict[str, Any]]:
    """Return the reference of a leg, polynomials of order 7 between its knots, and its preview in the core's form."""
    h = float(needs.times_s[1] - needs.times_s[0])
    ends = np.stack([needs.positions_m, needs.velocities_m_s, needs.accelerations_m_s2, needs.jerks_m_s3])[:, :, leg]
    scaled = ends * np.array([1.0, h, h**2 / 2.0, h**3 / 6.0])[:, None]
    # Values of the powers and of their derivatives over the factorials at the end of a piece.
    binomials = np.array([[comb(n, k) for n in range(8)] for k in range(4)], dtype=float)
    low = scaled[:, :-1]
    high = np.linalg.solve(binomials[:, 4:], scaled[:, 1:] - binomials[:, :4] @ low)
    rows = np.zeros((low.shape[1], 2 + POWERS))
    rows[:, 0], rows[:, 1] = needs.times_s[:-1], h
    rows[:, 2:6], rows[:, 6:10] = low.T, high.T
    made = polynomials(text, float(needs.positions_m[0, leg]), rows.tolist())
    efforts = np.stack([needs.masses_kg[:, leg], needs.loads_n[:, leg], needs.load_rates_n_s[:, leg]], axis=1)
    return made, {"period_s": h, "rows": efforts.tolist(), "others": needs.couplings[:, leg].tolist()}


def leg_circuit(circuit: Circuit, platform: Platform, leg: int, mass_kg: float, load_n: float) -> Circuit:
    """Return the circuit of one leg as a single axis: its cylinder, its valves, its supply, and a load at the rod.

    Parameters
    ----------
    circuit : Circuit
    platform : Platform
    leg : int
    mass_kg, load_n : float
        Mass that the leg moves, and force on it in +x.
    """
    form = json.loads(circuit.core_json())
    kinds = {one["name"]: one["kind"] for one in form["components"]}
    beside: dict[str, set[str]] = defaultdict(set)
    for joint in form["joints"]:
        named = {port.rpartition(".")[0] for port in joint} & kinds.keys()
        for name in named:
            beside[name] |= named - {name}
    names = [one.name for one in platform.legs]

    def reached(name: str, *, ends: str, without: set[str]) -> set[str]:
        found, left = set(), [name]
        while left:
            one = left.pop()
            if one in found or one in without:
                continue
            found.add(one)
            if one == name or not kinds[one].startswith(ends):
                left += beside[one]
        return found

    others = {platform.name, *names} - {names[leg]}
    for other in others - {platform.name}:
        behind = reached(other, ends="valve/", without={platform.name, *names} - {other})
        others |= {one for one in behind if not kinds[one].startswith("reservoir")}
    kept = reached(names[leg], ends="reservoir", without=others)
    own = circuit.components[names[leg]]
    described = float(vars(own)["moving_mass_kg"])
    load = {"kind": "load", "mass": f"{max(mass_kg - described, 0.0)!r} kg", "force": f"{load_n!r} N"}
    components: dict[str, Any] = {name: one for name, one in circuit.components.items() if name in kept}
    components[f"{names[leg]}_load"] = load
    chains = [chain for chain in circuit.connections if _named(chain) <= kept | {"ambient"}]
    rod = f"{names[leg]}.rod -> {names[leg]}_load"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the circuit has warned already
        return Circuit(
            name=names[leg],
            gas=circuit.gas,
            ambient=circuit.ambient,
            components=components,
            connections=(*chains, rod),
            plugged=tuple(port for port in circuit.plugged if _named(port) <= kept),
            junctions=circuit.junctions,
        )


def _named(chain: str) -> set[str]:
    return {entry.strip().partition(".")[0] for entry in chain.split("->")}


def leg_tunings(
    circuit: Circuit,
    platform: Platform,
    needs: Demands,
    law: str | None,
    setup: Setup,
    controller: Controller | str | Path | None = None,
) -> list[Tuning]:
    """Return a controller for each leg, tuned for mass and load of the leg at the beginning of a path.

    Raises
    ------
    CommandError
        The controller is custom code.
    DescriptionError
        A leg has no cylinder or no valves that a controller can command.
    """
    out: list[Tuning] = []
    told: Mapping[str, Any] = {"setup": setup, "controller": controller}
    for i, leg in enumerate(platform.legs):
        own = leg_circuit(circuit, platform, i, float(needs.masses_kg[0, i]), float(needs.loads_n[0, i]))
        tuning = tune(own, law, believes=own, **told)
        if tuning.own is not None:
            what = f"{leg.name}: {tuning.law} cannot be given the mass and load of a leg"
            raise CommandError(what, rule="a controller of pneudrive")
        out.append(tuning)
    return out
