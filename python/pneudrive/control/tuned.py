"""A tuned controller: its gains, the linear model of its drive, and its controller file."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive import _core, units
from pneudrive.control.controller import AFTER_S, BAND_M, USUAL_FACTORS, Factors, HoldBand, gain_quantity
from pneudrive.control.own_law import OWN, OwnLaw
from pneudrive.control.setup import USUAL, Supervision
from pneudrive.describe.files import toml
from pneudrive.describe.files.catalogue import PREFIX
from pneudrive.own_code import split
from pneudrive.repr_tables import Shown
from pneudrive.simulation.trajectory import whole
from pneudrive.views import VALUE, ShownValue, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.describe.circuit import Circuit


class TunedGain(NamedTuple):
    """A gain of a law.

    Attributes
    ----------
    key : str
        In a controller file.
    unit : str
        SI; ``"1"`` for a pure number.
    value : float
    meaning, rule : str
        What it is, and what it follows from.
    given : bool
        Whether it was given and does not follow from its rule.
    """

    key: str
    unit: str
    value: float
    meaning: str
    rule: str
    given: bool

    @property
    def quantity(self) -> str | float:
        """Value as a controller file writes it."""
        return gain_quantity(self.unit).show(self.value)

    def __str__(self) -> str:
        """Return the rounded value with its unit."""
        return f"{self.value:.4g} {'' if self.unit == '1' else self.unit}".rstrip()


@dataclass(frozen=True, repr=False)
class Plant(Shown):
    """Linear model of a drive at mid-stroke, with both chambers at the mean of supply and ambient pressure.

    Attributes
    ----------
    natural_frequency_rad_s : float
        Of the mass on its air, shut in.
    damping_ratio : float
        From viscous friction.
    speed_m_s : float
        Steady speed at full opening, the exhaust choked.
    force_rate_n_s : float
        Rate of the force of a chamber at full opening.
    lag_s : float
        By which a command acts late: dead time of the valve, its spool, half a period.
    coulomb_n : float
    stroke_m : float
    rest_pressures_pa : list of float
        Of chambers a and b, absolute, about the mean of supply and ambient pressure: the piston rests without friction.
    cylinder : str
        Name of the component.
    valves : list of str
        Names of the valves in the order of their commands.
    left_out : list of str
        Components of which the law knows nothing but the volume of tubes at the chambers, and parts of cylinder and
        valve that it does not know.
    pressure_decay_1_s : list of float
        Rates at which the pressures of both shut chambers return by leakage and heat, mid stroke.
    least_force_shares : list of float
        Shares of the supply's force that weight and friction at rest take in +x and against it, mid stroke.
    """

    natural_frequency_rad_s: float
    damping_ratio: float
    speed_m_s: float
    force_rate_n_s: float
    lag_s: float
    coulomb_n: float
    stroke_m: float
    rest_pressures_pa: list[float]
    cylinder: str
    valves: list[str]
    left_out: list[str]
    pressure_decay_1_s: list[float]
    least_force_shares: list[float]

    def rows(self) -> list[tuple[str, str]]:
        """Return name and value with unit of each number."""
        hertz = self.natural_frequency_rad_s / 6.283185307179586
        return [
            ("natural frequency", f"{self.natural_frequency_rad_s:.3g} rad/s ({hertz:.3g} Hz)"),
            ("damping ratio", f"{self.damping_ratio:.3g}"),
            ("speed at full opening", f"{self.speed_m_s:.3g} m/s"),
            ("rate of force at full opening", f"{1e-3 * self.force_rate_n_s:.3g} kN/s"),
            ("lag of the command", f"{1e3 * self.lag_s:.3g} ms"),
            ("Coulomb friction", f"{self.coulomb_n:.3g} N"),
            ("stroke", f"{1e3 * self.stroke_m:g} mm"),
        ]


class LawModel(NamedTuple):
    """Data of the drive that a custom law gets before a run.

    Attributes
    ----------
    plant : Plant
        What the drive is to a law: natural frequency, speed at full opening, lag, and so on.
    drive : Circuit
        The drive as the law may believe it to be.
    """

    plant: Plant
    drive: Circuit


@dataclass(frozen=True, repr=False)
class Tuning(Viewed):
    """A law with all its gains, for its model of the drive.

    Attributes
    ----------
    law : str
    period_s : float
    hold : HoldBand or None
        Standing still; None: it never holds.
    adaptation : bool
        It learns friction, mass and valve of its drive while it runs.
    gains : tuple of TunedGain
    plant : Plant
    belief : Circuit
        The drive as the law believes it to be.
    source : str
        File of that drive, or its name in the catalogue, where a controller file names one.
    limits : tuple of str
        What limits the law, in words.
    own : OwnLaw or None
        The law, where it is one of one's own: it has no gains here.
    supervision : Supervision
        Limits, when a motion is complete, and what is done about faults.
    valves : tuple of TunedGain
        Numbers of several or switching valves.
    factors : Factors
        What the gains are multiplied by.
    """

    law: str
    period_s: float
    hold: HoldBand | None
    adaptation: bool
    gains: tuple[TunedGain, ...]
    plant: Plant
    belief: Circuit
    source: str = ""
    limits: tuple[str, ...] = ()
    own: OwnLaw | None = None
    supervision: Supervision = USUAL
    valves: tuple[TunedGain, ...] = ()
    factors: Factors = USUAL_FACTORS

    @property
    def model(self) -> LawModel:
        """Data of the drive that a custom law gets."""
        return LawModel(self.plant, self.belief)

    @property
    def numbers(self) -> tuple[TunedGain, ...]:
        """Gains of the law and numbers of its valves."""
        return (*self.gains, *self.valves)

    def core(self) -> dict[str, Any]:
        """Return it in the core's form, SI."""
        each = {"gains": self.gains, "valves": self.valves}
        numbers = {table: {one.key: one.value for one in own} for table, own in each.items()}
        word = self.law if self.own is None else OWN
        form = core_form(word, self.period_s, self.hold, self.adaptation, self.belief, numbers)
        form |= factors_form(self.factors)
        return form | self.supervision.core(self.belief.ambient.pressure_pa)

    def to_toml(self, folder: str | Path = "") -> str:
        """Write it as a controller file for a folder, with meaning and rule of each gain."""
        word = self.law if self.own is None else _code_seen_from(folder, self.law)
        lines = ["schema = 1", f'law = "{word}"', f'period = "{units.write(self.period_s, "s", "ms")}"']
        if self.source:
            lines.append(f"drive = {toml.value_text(_seen_from(folder, self.source))}")
        if self.factors != USUAL_FACTORS:
            given = ", ".join(f"{key} = {value!r}" for key, value in self.factors.to_dict().items())
            lines.append(f"factors = {{ {given} }}  # of {_factored(self.law)}")
        for name, numbers in (("gains", self.gains), ("valves", self.valves)):
            lines += ["", f"[{name}]", *_lines(numbers)] if numbers or name == "gains" else []
        if not self.adaptation:
            lines.insert(3, "adaptation = false")
        if self.hold is None:
            lines.insert(3, "hold = false")
        else:
            band, after = units.write(self.hold.band_m, "m", "um"), units.write(self.hold.after_s, "s", "ms")
            lines += ["", "[hold]", f'band = "{band}"', f'after = "{after}"']
            if (self.hold.band_m, self.hold.after_s) == (BAND_M, AFTER_S):
                lines[-2:] = [f"{line}  # assumed" for line in lines[-2:]]
        lines += self.supervision.lines()
        return "\n".join([*lines, ""])

    def save(self, path: str | Path) -> Path:
        """Write it as a controller file. Files that it names are named from its folder.

        If `believes` was a drive object, the output has no file name for it: add one as ``drive``.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        with whole(Path(path)) as temporary:
            temporary.write_text(self.to_toml(Path(path).parent), encoding="utf-8")
        return Path(path)

    def view(self) -> View:
        """Return the gains with their rules, the drive as assumed, and the limits."""
        rows = [
            ShownValue(f"{gain.key}.{name}", gain.key, name, text)
            for gain in self.numbers
            for name, text in (
                (VALUE, str(gain)),
                ("meaning", gain.meaning),
                ("follows from", "given" if gain.given else gain.rule),
            )
        ]
        rows += [ShownValue(name, name, "assumed drive, near mid-stroke", text) for name, text in self.plant.rows()]
        title = f"{self.law} for {self.belief.name}, every {1e3 * self.period_s:g} ms"
        factors = " ".join(f"{factor:g}" for factor in self.factors.values)
        given = () if set(self.factors.values) == {1.0} else (f"given factors {factors} of {_factored(self.law)}",)
        return View(title, tuple(rows), notes=(*given, *self.limits))


def _lines(numbers: tuple[TunedGain, ...]) -> list[str]:
    """Return numbers as lines of a controller file, each with its meaning and rule."""
    return [
        f"{one.key} = {toml.value_text(one.quantity)}  # {one.meaning}: {'given' if one.given else one.rule}"
        for one in numbers
    ]


def factors_form(factors: Factors) -> dict[str, Any]:
    """Return the factors of the gains in the core's form; empty for the usual ones."""
    return {} if factors == USUAL_FACTORS else {"factors": factors.values}


def _factored(law: str) -> str:
    """Return the gain that each factor multiplies, in words."""
    return ", ".join(f"{gain} ({factor})" for of, factor, gain in _core.control_factors() if of == law)


def core_form(
    law: str,
    period_s: float,
    hold: HoldBand | None,
    adaptation: bool,
    belief: Circuit,
    numbers: Mapping[str, dict[str, float]],
) -> dict[str, Any]:
    """Return a controller in the core's form, SI. `numbers` are those of ``gains`` and of ``valves``."""
    held = None if hold is None else hold.core()
    core = {"law": law, "period_s": period_s, "gains": {}, "hold": held, "adaptation": adaptation}
    core |= {table: each for table, each in numbers.items() if each or table == "gains"}
    return core | {"belief": json.loads(belief.core_json())}


def _seen_from(folder: str | Path, source: str) -> str:
    """Return the name of a drive, or the path of a file relative to the folder of a controller file."""
    return source if source.startswith(PREFIX) else Path(os.path.relpath(source, folder or ".")).as_posix()


def _code_seen_from(folder: str | Path, law: str) -> str:
    """Return the name of a custom law as written in a controller file of a folder."""
    module, name = split(law) or ("", OWN)
    return f"{_seen_from(folder, module)}:{name}" if is_code_file(module) else law if module else name


def is_code_file(module: str) -> bool:
    """Return whether the module of a custom law is named by a file."""
    return module.endswith(".py")
