"""Coverage of the truth by profile intervals of hidden tubes and drives: ``trials/profile_coverage.py drives``.

Every tube and drive has hidden values, a start value that is off by up to a third, and white noise of its sensors.
Tubes are discharges and fills of a tank by the independent model, half of them without a linear region of flow. Hoses
are tubes with waves from a circuit. The last line counts intervals that
hold the truth, with the 95 % range of a binomial count. It names values that are called undetermined although their
first-order interval is within a tenth of the value.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import binom

import pneudrive as pn
from oracle.drive_records import drive, record
from oracle.tank import pressure
from pneudrive.errors import PneudriveWarning
from pneudrive.identify.base import Fit

#: Share of the value for the first-order interval of a value that the data determine.
DETERMINED = 0.1
AMBIENT_PA = 1.013e5


@dataclass
class Count:
    """Counts over all cases."""

    inside: int = 0
    total: int = 0
    lost: list[str] = field(default_factory=list)
    unfinished: int = 0

    def add(self, name: str, fit: Fit, ends: dict[str, tuple[float, float]], truth: dict[str, float]) -> None:
        """Add one fit and print its intervals."""
        words = []
        for key, value in truth.items():
            low, high = ends.get(key, (np.nan, np.nan))
            k = fit.free.index(key)
            spread = 1.96 * float(np.sqrt(fit.covariance[k, k])) / value
            lost = any(u.parameter == key for u in fit.undetermined)
            if lost:
                words.append(f"{key} not determined ({100 * spread:.3g} %)")
                if spread < DETERMINED:
                    self.lost.append(f"{name} {key}")
            elif key in ends:
                held = low <= value <= high
                self.inside += held
                self.total += 1
                words.append(
                    f"{key} {100 * spread:.2g} %" + ("" if held else f" OUTSIDE {low / value:.4f}..{high / value:.4f}")
                )
        self.unfinished += not fit.converged
        state = "" if fit.converged else " NOT CONVERGED"
        sys.stdout.write(f"{name}{state}: {'; '.join(words)}\n")
        sys.stdout.flush()

    def __str__(self) -> str:
        """Return the counts in words."""
        low, high = binom.interval(0.95, max(self.total, 1), 0.95)
        share = 100 * self.inside / max(self.total, 1)
        return (
            f"{self.inside} of {self.total} inside ({share:.1f} %; by chance {low:.0f} to {high:.0f}); "
            f"called undetermined though determined: {', '.join(self.lost) or 'none'}; "
            f"not converged: {self.unfinished}"
        )


def off(draw: np.random.Generator) -> float:
    """Return the factor of a start value."""
    return float(np.exp(draw.uniform(-0.3, 0.3)))


def tube(seed: int) -> tuple[pn.Tank, dict[str, Any], dict[str, float]]:
    """Return the tank of the start, a recording and the hidden values of a tube."""
    draw = np.random.default_rng([43, seed])
    volume = float(np.exp(draw.uniform(np.log(0.3e-3), np.log(5e-3))))
    c = float(np.exp(draw.uniform(np.log(0.1e-8), np.log(3e-8))))
    b, heat = float(draw.uniform(0.1, 0.5)), float(np.exp(draw.uniform(np.log(0.05), np.log(2.0))))
    noise, fills = float(np.exp(draw.uniform(np.log(100.0), np.log(1500.0)))), bool(draw.integers(2))
    supply = float(draw.uniform(4e5, 9e5))
    duration = float(draw.uniform(2.0, 8.0)) * volume / (c * 1e5)
    time = np.linspace(0.0, duration, int(draw.integers(150, 1200)))
    truth = {"line.conductance": c, "line.critical_pressure_ratio": b, "volume.heat_transfer": heat}
    tables: dict[str, Any] = {
        "ambient": {"pressure": "1.013 bar abs", "temperature": "20 degC"},
        "volume": {"value": f"{volume * 1e3!r} dm3", "heat_transfer": f"{heat * off(draw)} W/K"},
        "line": {"conductance": f"{c * 1e8 * off(draw)} dm3/(s bar)", "critical_pressure_ratio": 0.3},
    }
    other, start = (supply, AMBIENT_PA) if fills else (AMBIENT_PA, supply)
    if fills:
        tables["line"]["pressure"] = f"{supply!r} Pa abs"
    region = float(draw.choice([0.999, 1.0]))
    values = pressure(time, start, volume=volume, c=c, b=b, other=other, heat=heat, linear_above=region)
    columns = {"time_s": time, "pressure_pa": values + noise * draw.standard_normal(time.size)}
    return pn.Tank.model_validate(tables), columns | {"command": np.ones(time.size)}, truth


def hose(seed: int) -> tuple[pn.Tank, dict[str, Any], dict[str, float]]:
    """Return the same for a tube with waves between nozzle and tank, with a pressure at both ends."""
    draw = np.random.default_rng([44, seed])
    litres, length, mm = float(draw.uniform(0.1, 0.6)), float(draw.uniform(0.5, 3.0)), float(draw.choice([2.5, 4.0]))
    c, b = float(draw.uniform(0.2, 1.0)), float(draw.uniform(0.2, 0.45))
    heat, scale = float(draw.uniform(0.1, 0.6)), float(draw.uniform(0.7, 1.6))
    noise = float(np.exp(draw.uniform(np.log(100.0), np.log(1000.0))))
    run = pn.Circuit(
        components={
            "mains": {"kind": "reservoir", "pressure": "7 bar abs"},
            "nozzle": {"kind": "fitting", "conductance": f"{c} dm3/(s bar)", "critical_pressure_ratio": b},
            "hose": {
                "kind": "tube/distributed",
                "length": f"{length} m",
                "diameter": f"{mm} mm",
                "friction_scale": scale,
            },
            "tank": {
                "kind": "tank",
                "volume": f"{litres} dm3",
                "wall_area": "0.04 m2",
                "heat_transfer": f"{heat / 0.04} W/(m2 K)",
            },
        },
        connections=["mains -> nozzle -> hose -> tank"],
    ).simulate(None, float(draw.uniform(3.0, 6.0)) * litres / c, initial={"tank.pressure": "1 bar abs"},
               sample_rate="100 Hz", rtol=1e-8)  # fmt: skip
    shaken = noise * draw.standard_normal((2, run.time.size))
    columns = {
        "time_s": run.time.to_numpy(),
        "pressure_pa": run["tank.pressure"].to_numpy() + shaken[0],
        "inlet_pressure_pa": run["nozzle.2.pressure"].to_numpy() + shaken[1],
    }
    started = {
        "volume": {"value": f"{litres} dm3", "heat_transfer": f"{heat * off(draw)} W/K"},
        "line": {
            "conductance": f"{c * off(draw)} dm3/(s bar)",
            "critical_pressure_ratio": 0.3,
            "pressure": "7 bar abs",
        },
        "tube": {"length": f"{length} m", "diameter": f"{mm} mm"},
    }
    truth = {"line.conductance": c * 1e-8, "line.critical_pressure_ratio": b, "volume.heat_transfer": heat}
    return pn.Tank.model_validate(started), columns, truth | {"tube.friction_scale": scale}


#: Values of a drive that are hidden: SI unit for the description, range of the truth.
HIDDEN = {
    "friction.coulomb": ("N", 15.0, 45.0),
    "friction.viscous": ("N s/m", 20.0, 90.0),
    "valve.conductance": ("m3/(s Pa)", 1.2e-8, 3e-8),
    "cylinder.moving_mass": ("kg", 1.0, 4.0),
}


def hidden_drive(seed: int) -> tuple[pn.Drive, Any, dict[str, float]]:
    """Return the drive of the start, a record of the hidden one and its values."""
    draw = np.random.default_rng([45, seed])
    truth = {name: float(draw.uniform(low, high)) for name, (_, low, high) in HIDDEN.items()}
    written = {name.replace(".", "__"): f"{value!r} {HIDDEN[name][0]}" for name, value in truth.items()}
    hidden = drive(friction__breakaway=f"{1.3 * truth['friction.coulomb']} N", **written)
    made = record(
        hidden,
        seed,
        duration_s=3.0,
        noise_m=float(np.exp(draw.uniform(np.log(1e-6), np.log(2e-5)))),
        noise_pa=float(np.exp(draw.uniform(np.log(100.0), np.log(2e3)))),
        steps=[(0.25 * k, float(draw.uniform(0.05, 0.3)) * (-1.0) ** k) for k in range(12)],
    )
    start = {name: f"{value * off(draw)!r} {HIDDEN[name][0]}" for name, value in truth.items()}
    start["friction.coulomb"] = f"{truth['friction.coulomb'] * float(draw.uniform(0.7, 1.0))!r} N"
    return hidden.replace(start), made, truth


def main() -> None:
    """Print all cases and the counts."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kind", choices=("tubes", "hoses", "drives"))
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--first", type=int, default=0)
    options = parser.parse_args()
    warnings.simplefilter("error")
    warnings.simplefilter("ignore", PneudriveWarning)
    count = Count()
    for seed in range(options.first, options.first + options.count):
        if options.kind == "drives":
            start, made, truth = hidden_drive(seed)
            fit: Fit = pn.identify(start, made, free=list(truth))
            ends = fit.profile(fit.determined) if fit.converged else {}
        else:
            tank, columns, truth = (tube if options.kind == "tubes" else hose)(seed)
            fit = pn.identify_volume(tank, columns, free=list(truth))
            ends = fit.intervals
        count.add(f"{options.kind} {seed}", fit, ends, truth)
    sys.stdout.write(f"{count}\n")
    sys.exit(bool(count.inside < binom.ppf(0.001, count.total, 0.95)))


if __name__ == "__main__":
    main()
