"""Air and exergy that a cycle takes from the supply, and the exergy losses of each component."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from pneudrive.arrays import Array, NamedNumbers, Pair
from pneudrive.constants import AIR_GAS_CONSTANT_J_KG_K
from pneudrive.datasheet.characteristic import Found, characteristic
from pneudrive.datasheet.characteristics.response import cycle, simulate_plant, square, start_of
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.datasheet.strokes import litres_anr
from pneudrive.describe import Circuit
from pneudrive.ensemble.outputs import Reduction, member_plans
from pneudrive.ensemble.variation import CoreMembers, run_members
from pneudrive.errors import warn
from pneudrive.progress import Flag, Watch
from pneudrive.simulation.command import Commands
from pneudrive.simulation.simulate import run
from pneudrive.simulation.start import DriveOrCircuit, StartState
from pneudrive.views import ShownValue, View, Viewed

FULL_S = 20.0  # half a cycle: chambers fill and empty, and take the temperature of the wall
SLOW = 4.0  # a slow drive is given this times the half cycle in which its piston reaches both ends
NO_STROKES = "the piston does not reach both ends under full command, so the air per cycle is not that of full strokes"
REPEATS, RTOL = 3, 1e-8  # cycles before the one that counts, and tolerance
NORMAL_DENSITY_KG_M3 = 1.2929  # dry air at 0 degC and 101325 Pa (normal litre, DIN 1343)
_BOUNDARY = ("mass over the boundary [kg]", "enthalpy over the boundary [J]", "entropy over the boundary [J/K]")


def full_half_s(plant: HeldDrive) -> float:
    """Return the half period (s) of a cycle in which the chambers fill, empty, and reach the wall temperature.

    Warn if the piston does not move from end to end.
    """
    strokes = cycle(plant)
    if not strokes.arrived():
        warn(f"{plant.name}: {NO_STROKES}")
    return max(FULL_S, SLOW * strokes.half_s)


@lru_cache(maxsize=64)  # characteristics of one drive share runs
def drawn_mass(plant: HeldDrive, half_s: float) -> float:
    """Return the mass (kg) that one cycle draws from the supply, integrated over the solver's steps."""
    plans = plant.plans(square(half_s, REPEATS + 1))
    start = {f"{plant.piston}.position": "0 mm"}
    if f"{plant.piston}.b" in plant.nodes:
        start[f"{plant.piston}.b"] = f"{plant.before(1.0)[1]!r} Pa abs"
    reservoir = plant.supply.removesuffix(".pressure_pa")
    ends_s = [2 * REPEATS * half_s, (2 * REPEATS + 2) * half_s]
    (found,) = _supplied(plant.circuit, plans, ends_s, [reservoir], initial=start, rtol=RTOL)
    return np.diff(np.abs(found)).item()


def _supplied(
    circuit: Circuit,
    plans: Commands,
    duration: Any,  # noqa: ANN401 - of one run, or of each
    reservoirs: Sequence[str],
    *,
    initial: Any,  # noqa: ANN401 - a start state of the circuit
    rtol: float,
    cancel: Flag | None = None,
) -> list[Array]:
    """Return the mass (kg) that each reservoir supplies in each run: the integral of its flow over time."""
    watch, commands = Watch(cancel=cancel), member_plans(plans, duration, circuit.commandable)
    runs = CoreMembers([], np.empty((len(commands.durations), 0)), dict(circuit.core_initial(initial)))
    flows = [Reduction("integral", (f"{name}.mass_flow_kg_s",), name, "kg", "") for name in reservoirs]
    return run_members(circuit.system, runs, commands, rtol, flows, look=lambda _: watch.look())[0]


def _entering(plant: HeldDrive, pressure: float, temperature: float) -> Pair:
    """Return specific enthalpy (J/kg) and entropy (J/(kg K)) of gas that flows from a reservoir into a small tank."""
    circuit = type(plant.circuit).model_validate(
        {
            **{key: table for key, table in plant.circuit.to_dict().items() if key in ("gas", "ambient")},
            "name": "flow out of a reservoir",
            "components": {
                "reservoir": {
                    "kind": "reservoir",
                    "pressure": f"{pressure!r} Pa abs",
                    "temperature": f"{temperature!r} K",
                },
                "edge": {"kind": "fitting", "conductance": "1 dm3/(s bar)", "critical_pressure_ratio": 0.3},
                "tank": {"kind": "tank", "volume": "1 l"},
            },
            "connections": ["reservoir -> edge -> tank"],
        }
    )
    start = circuit.core_initial({"tank": f"{0.1 * pressure!r} Pa abs"})
    found = circuit.system.compiled().simulate([], 0.05, 100.0, start, RTOL, True)["ledger"]
    accounts = (found or {})["accounts"]
    mass, enthalpy, entropy = (_sum(accounts, ending) for ending in _BOUNDARY)
    return enthalpy / mass, entropy / mass


def _sum(accounts: NamedNumbers, ending: str) -> float:
    return sum(value for name, value in accounts.items() if name.endswith(ending))


def losses(accounts: NamedNumbers, ambient_k: float) -> NamedNumbers:
    """Return the exergy (J) lost in each component: ambient temperature times entropy produced."""
    out: NamedNumbers = {}
    for name, value in accounts.items():
        component, _, what = name.partition(": ")
        if what.endswith("[J/K]") and not what.startswith(("entropy over", "wall heat over")):
            out[f"{component}: {what.removesuffix(' [J/K]')}"] = ambient_k * value
    return dict(sorted(out.items(), key=lambda one: -one[1]))


@characteristic(
    "air",
    algorithm="flow out of the supply integrated along the solver's steps, one cycle of several",
    standard="volumes by ISO 8778",
    cites=("iso8778-2003",),
)
def _air(plant: HeldDrive, half_period: float | None = None) -> Found:
    """Air per cycle.

    Mass drawn from the supply in one periodic cycle out and back, as volume at the standard reference atmosphere.
    One value is for a cycle in which the chambers fill and vent completely, the other for the cycle of the square
    response.

    Settings
    --------
    half_period
        half of the period of the second cycle, in s; default: as in the square response

    Results
    -------
    full : l ANR
        litres at 100 kPa, 20 degC and 65 % humidity (ISO 8778), chambers filled and vented
    full_normal : l
        the same in normal litres: 101325 Pa, 0 degC, dry
    cycle : l ANR
        air in a cycle of the half period below
    half_period : s
        half of the period of that cycle
    mean_flow : l/min ANR
        mean flow from the supply in that cycle
    full_half_period : s
        half of the period in which the chambers are filled and vented
    """
    full_half = full_half_s(plant)
    full = drawn_mass(plant, full_half)
    half = half_period or cycle(plant).half_s
    gas = plant.circuit.gas
    density = gas.anr_density_kg_m3
    normal = NORMAL_DENSITY_KG_M3 * (AIR_GAS_CONSTANT_J_KG_K / gas.gas_constant_j_kg_k)
    litres = litres_anr(drawn_mass(plant, half), density)
    return litres_anr(full, density), full / normal * 1e3, litres, half, 30.0 * litres / half, full_half


@characteristic(
    "exergy",
    algorithm="ledger of the run (accounts of energy and entropy), one cycle of several",
    cites=("bejan2016",),
    x="loss",
    y="lost",
)
def _exergy(plant: HeldDrive) -> Found:
    """Exergy and its losses.

    Exergy of the air drawn in one periodic cycle, relative to ambient, and exergy lost in each component: ambient
    temperature times the entropy that it produces. The period is long enough to fill and vent the chambers.

    Results
    -------
    loss : 1
        component and cause
    lost : J over loss
        exergy lost: ambient temperature times entropy produced
    drawn : J
        exergy drawn from the supply in one cycle
    exhausted : J
        exergy that leaves with the exhaust air
    load_work : J
        work done on load and ambient air
    open : 1
        residual of the balance, relative to the exergy drawn
    half_period : s
        half of the period of the cycle
    """
    half_period = full_half_s(plant)
    options = {"initial": start_of(plant, 0.0, plant.before(1.0)), "ledger": True, "rtol": RTOL}
    runs = []  # integrated along the solver's steps
    for count in (REPEATS + 1, REPEATS):
        plans, duration = plant.plans(square(half_period, count)), 2 * count * half_period
        run_of = simulate_plant(plant, plans, duration, 1.0 / half_period, **options)
        runs.append(run_of.attrs["ledger"]["accounts"])
    many, few = runs
    found = {name: value - few[name] for name, value in many.items()}  # the last cycle
    t_0 = plant.ambient[1]
    supply_k = plant.session(1.0, plant.middle_m).read(plant.supply.replace("pressure_pa", "temperature_k"))
    (h, s), (h_0, s_0) = (_entering(plant, *gas) for gas in ((plant.supply_pa, supply_k), plant.ambient))
    # The flow exergy of the supplied gas against ambient is h - h_0 - T_0 (s - s_0).
    drawn = drawn_mass(plant, half_period) * (h - h_0 - t_0 * (s - s_0))
    lost = losses(found, t_0)
    mass, enthalpy, entropy = (_sum(found, ending) for ending in _BOUNDARY)
    entered = enthalpy - t_0 * entropy - mass * (h_0 - t_0 * s_0)  # less what leaves
    wall = _sum(found, "wall heat [J]") - t_0 * _sum(found, "wall heat over wall temperature [J/K]")
    work = _sum(found, "external work [J]") + _sum(found, "ambient work [J]")
    rest = entered + wall + work - sum(lost.values())
    return list(lost), list(lost.values()), drawn, drawn - entered, -work, rest / drawn, half_period


# --- The energy of one run: its accounts and their closure, the lost exergy, and the air from each supply.

_JOULE = " [J]"


@dataclass(frozen=True, repr=False)
class EnergyBalance(Viewed):
    """Energy of a run.

    Attributes
    ----------
    accounts_j : dict of str to float
        Component and account -> heat, work and enthalpy over the boundary, in J, positive inward.
    open_share : float
        Residual of the energy balance, relative to the energy throughput.
    lost_j : dict of str to float
        Component and cause -> exergy lost, in J: ambient temperature times entropy produced. The largest comes first.
    air_kg : dict of str to float
        Reservoir -> supplied mass, in kg; negative if the reservoir received more than it supplied.
    anr_density_kg_m3 : float
        Density of the gas at the standard reference atmosphere.
    """

    accounts_j: NamedNumbers
    open_share: float
    lost_j: NamedNumbers
    air_kg: NamedNumbers
    anr_density_kg_m3: float

    @property
    def air_litres_anr(self) -> NamedNumbers:
        """Reservoir -> supplied air in litres at the standard reference atmosphere (ISO 8778)."""
        return {name: litres_anr(mass, self.anr_density_kg_m3) for name, mass in self.air_kg.items()}

    def view(self) -> View:
        """Return the view of the accounts, the lost exergy and the air."""
        lost = self.lost_j | {"all": sum(self.lost_j.values())}
        groups = (("across boundary, positive inward", self.accounts_j, "J"), ("exergy lost", lost, "J"))
        groups += (("air given, litres ANR", self.air_litres_anr, ""),)
        rows = [
            ShownValue(f"{group}.{name}", f"{group}, {name}", "value", value, unit)
            for group, values, unit in groups
            for name, value in values.items()
        ]
        note = f"Residual: {self.open_share:.1e} of the converted energy. Simulated."
        return View("Energy of the run", rows, notes=(note,))


def energy_balance(
    drive: DriveOrCircuit,
    command: Commands,
    duration: str | float,
    *,
    initial: StartState = None,
    rtol: float = 1e-6,
    cancel: Flag | None = None,
) -> EnergyBalance:
    """Return the energy accounts, the lost exergy and the supplied air of a run.

    Parameters
    ----------
    drive, command, duration, initial, rtol
        As for `pneudrive.simulate`; the accounts are those of `pneudrive.simulate` with ``ledger=True``.
    cancel : optional
        Flag that ends the call; see `pneudrive.progress.Watch`.

    Returns
    -------
    EnergyBalance
        Air is integrated over the solver's steps.

    Raises
    ------
    PneudriveError
        As for `pneudrive.simulate`.

    Examples
    --------
    >>> import pneudrive as pn
    >>> found = pn.energy_balance(pn.Drive.load("catalogue:reference"), 0.6, "1 s")
    >>> list(found.air_kg), found.accounts_j["cylinder: friction heat"] < 0  # it leaves the drive
    (['supply'], True)
    """
    done = run(drive, command, duration, initial=initial, rtol=rtol, ledger=True, watch=Watch(cancel=cancel))
    ledger = done.provenance["ledger"]
    accounts = {name.removesuffix(_JOULE): value for name, value in ledger["accounts"].items() if name.endswith(_JOULE)}
    circuit = drive.circuit
    lost = losses(ledger["accounts"], circuit.ambient.temperature_k)
    supplies = [name for name, one in circuit.components.items() if one.kind == "reservoir"]
    commands: Any = dict.fromkeys(circuit.commandable, command) if drive.system.names else command
    options = {"initial": drive.circuit_values(initial), "rtol": rtol, "cancel": cancel}
    masses = _supplied(circuit, commands, duration, supplies, **options) if supplies else []
    air = {name: float(mass[0]) for name, mass in zip(supplies, masses, strict=True)}
    return EnergyBalance(accounts, ledger["energy_error"], lost, air, circuit.gas.anr_density_kg_m3)
