"""The energy of one run: its accounts and their closure, the lost exergy, and the air from each supply."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

from pneudrive.datasheet.characteristics.air import losses
from pneudrive.datasheet.strokes import litres_anr
from pneudrive.errors import PneudriveWarning
from pneudrive.numbers import plain
from pneudrive.progress import Watch
from pneudrive.repr_tables import Card, Shown
from pneudrive.simulation.simulate import run

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.describe import Drive, Initial
    from pneudrive.describe.circuit import Circuit
    from pneudrive.progress import Flag
    from pneudrive.simulation.command import Commands

_JOULE = " [J]"
_KIND = "reservoir"
#: Endings of the core's start values -> unit in which they are given.
_UNITS = {"_pa": "Pa abs", "_k": "K", "_m_s": "m/s", "_m": "m"}


@dataclass(frozen=True, repr=False)
class EnergyBalance(Shown):
    """Energy of a run.

    Attributes
    ----------
    accounts_j : dict of str to float
        Component and account -> heat, work and enthalpy over the boundary, J, positive inward.
    open_share : float
        Change of energy that the balances do not explain, relative to the energy throughput.
    lost_j : dict of str to float
        Component and cause -> exergy lost, J: ambient temperature times the entropy produced; the largest first.
    air_kg : dict of str to float
        Reservoir -> mass that it supplied, kg. Negative if it received more.
    anr_density_kg_m3 : float
        Density of the gas at the standard reference atmosphere.
    """

    accounts_j: dict[str, float]
    open_share: float
    lost_j: dict[str, float]
    air_kg: dict[str, float]
    anr_density_kg_m3: float

    @property
    def air_litres_anr(self) -> dict[str, float]:
        """Reservoir -> litres at the standard reference atmosphere (ISO 8778)."""
        return {name: litres_anr(mass, self.anr_density_kg_m3) for name, mass in self.air_kg.items()}

    def _card(self) -> Card:
        rows = [
            ("across boundary, positive inward", name, f"{plain(value)} J") for name, value in self.accounts_j.items()
        ]
        rows += [("exergy lost", name, f"{plain(value)} J") for name, value in self.lost_j.items()]
        rows += [("exergy lost", "all", f"{plain(sum(self.lost_j.values()))} J")]
        rows += [("air given", name, f"{plain(value)} l ANR") for name, value in self.air_litres_anr.items()]
        notes = [f"Residual: {self.open_share:.1e} of the converted energy. Simulated."]
        return Card("Energy of the run", ("what", "where", "value"), rows, notes)


def energy_balance(
    drive: Drive | Circuit,
    command: Commands,
    duration: str | float,
    *,
    initial: Initial | Mapping[str, object] | str | None = None,
    rtol: float = 1e-6,
    cancel: Flag | None = None,
) -> EnergyBalance:
    """Return the energy, the lost exergy and the air of a run.

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
        As `pneudrive.simulate`.

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
    lost = losses(ledger["accounts"], float(circuit.ambient.temperature_k))
    air = _air(drive, command, duration, initial, rtol, cancel)
    return EnergyBalance(accounts, ledger["energy_error"], lost, air, circuit.gas.anr_density_kg_m3)


def _air(
    drive: Drive | Circuit,
    command: Commands,
    duration: str | float,
    initial: Initial | Mapping[str, object] | str | None,
    rtol: float,
    cancel: Flag | None,
) -> dict[str, float]:
    """Return the mass that each reservoir supplies: the integral of its flow, in the circuit of the drive."""
    from pneudrive.ensemble.many import simulate_many

    circuit = drive.circuit
    supplies = [name for name, one in circuit.components.items() if one.kind == _KIND]
    if not supplies:
        return {}
    if drive.system.names:
        start = drive.circuit_start(initial)
        initial = {
            key.removesuffix(end): f"{value!r} {unit}" for key, value in start.items() for end, unit in _one(key)
        }
        command = cast("Commands", dict.fromkeys(circuit.commandable, command))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", PneudriveWarning)
        found = simulate_many(
            circuit,
            command,
            duration,
            vary={f"{supplies[0]}.pressure": [circuit.components[supplies[0]].plain()["pressure"]]},  # as it is
            outputs=[f"air_{number} = integral({name}.mass_flow)" for number, name in enumerate(supplies)],
            initial=initial,
            rtol=rtol,
            cancel=cancel,
        )
    return {name: float(found[f"air_{number}"][0]) for number, name in enumerate(supplies)}


def _one(key: str) -> list[tuple[str, str]]:
    return [(end, unit) for end, unit in _UNITS.items() if key.endswith(end)][:1]
