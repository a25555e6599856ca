"""Values of seals that a survey predicts from all other values: each pressure of a seal, or each run."""

from dataclasses import dataclass

import numpy as np

from pneudrive.identify.static.model import selected
from pneudrive.identify.static.survey import of_values, pressure_levels, row_labels, survey_values


@dataclass(frozen=True)
class LeftOut:
    """Measured friction of a seal at a pressure, and its prediction without it."""

    seal: str
    gauge_b_pa: float
    friction_n: float
    predicted_n: float
    lower_n: float
    upper_n: float

    @property
    def is_inside(self):
        return self.lower_n <= self.friction_n <= self.upper_n

    @property
    def error(self):
        return self.predicted_n / self.friction_n - 1.0


def held_out(friction_map, seals, runs, *, by, direction=None):
    """Hold out each pressure of each seal, or each run of seals with several runs, and predict it at 90 %."""
    seal_of, run_of = row_labels(friction_map, seals), row_labels(friction_map, "" if runs is None else runs)
    groups, of_run, out = {}, {}, []
    for seal in dict.fromkeys(seal_of.tolist()):
        part = friction_map.isel(row=np.flatnonzero(seal_of == seal))
        groups[seal] = selected(part, direction=direction, exclude_flags=())[0]
        of_run[seal] = of_values(part, run_of[seal_of == seal], groups[seal])
    for seal, data in groups.items():
        names, run = np.unique(of_run[seal], return_inverse=True)
        parts = pressure_levels(data) if by == "pressure" else run
        for part in np.unique(parts) if by == "pressure" or len(names) > 1 else ():
            left = parts == part
            rest = {**of_run, seal: names[run[~left]].tolist()}
            found = None if left.all() else survey_values({**groups, seal: data.take(~left)}, rest)
            for i in np.flatnonzero(left) if found is not None and seal in found.seals else ():
                known = names[run[i]] if names[run[i]] in found.seals[seal].runs else None
                at = {name: getattr(data, name)[i] for name in ("speed_m_s", "gauge_a_pa", "gauge_b_pa")}
                band = found.predict(seal, **at, run=known, probability=0.9)
                values = (data.friction_n[i], band.friction_n, band.lower_n, band.upper_n)
                out.append(LeftOut(seal, at["gauge_b_pa"], *map(float, values)))
    return out
