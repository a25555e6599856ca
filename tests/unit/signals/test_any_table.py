"""Whatever stands in a table: a friction map or one message, never a traceback and never a warning."""

import numpy as np
import pytest

from pneudrive.characterise import Layout, characterise_recordings
from pneudrive.errors import PneudriveError
from pneudrive.signals.proposal import propose_layout

LAYOUT = """
[columns]
time = { column = 0, unit = "s" }
position = { column = 1, unit = "mm" }
pressure_b = { column = 2, unit = "bar gauge" }
force = { column = 3, unit = "N" }
[geometry]
bore = "25 mm"
[chamber_a]
open_to_ambient = true
"""


def put(table: np.ndarray, where: object, what: object) -> np.ndarray:
    table = table.copy()
    table[where] = what
    return table


SPOILERS = [
    lambda t, some, c, rng: t[: rng.integers(0, 60)],
    lambda t, some, c, rng: put(t, np.s_[:, c], t[0, c]),
    lambda t, some, c, rng: put(t, (some, c), np.nan),
    lambda t, some, c, rng: put(t, (some, c), rng.choice([1e308, -1e308, 1e30])),
    lambda t, some, c, rng: put(t, np.s_[:, c], -t[:, c]),
    lambda t, some, c, rng: put(t, np.s_[:, c], rng.normal(size=len(t))),
    lambda t, some, c, rng: put(t, (some, c), np.inf),
    lambda t, some, c, rng: put(t, np.s_[:, 1], np.round(t[:, 1] / 20) * 20),
    lambda t, some, c, rng: put(t, np.s_[:, 1], np.sort(t[:, 1])),
    lambda t, some, c, rng: t[rng.permutation(len(t))],
    lambda t, some, c, rng: t[:: rng.choice([2, 20, 100])],
    lambda t, some, c, rng: put(t, np.s_[:, c], t[:, rng.integers(4)]),
    lambda t, some, c, rng: put(t, np.s_[:, 2:], 0.0),
]


def spoil(table: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Do one of many things that happen to recordings."""
    some = rng.integers(0, max(len(table), 1), len(table) // 20)
    return SPOILERS[rng.integers(len(SPOILERS))](table, some, int(rng.integers(4)), rng) if len(table) else table


def map_or_message(attempt) -> str:
    try:
        attempt()
    except PneudriveError as error:
        return str(error)
    return "a friction map or a layout"


@pytest.mark.parametrize("seed", range(20))
def test_a_map_or_one_message(make, tmp_path, seed):
    rng = np.random.default_rng(seed)
    r = make(strokes=4, swing=0.05e5, seed=seed)
    table = np.column_stack([r.time_s, r.position_m * 1e3, (r.pressure_b_pa - 101325) / 1e5, r.force_n])
    table = spoil(table, rng)
    if seed % 3 == 0:
        table = spoil(table, rng)
    path = tmp_path / "a.csv"
    np.savetxt(path, table)
    layout = LAYOUT + ('[window]\nposition = "5 mm .. 60 mm"\n' if seed % 4 == 0 else "")
    layout += '[rig]\nmass_beyond_sensor = "2 kg"\n' if seed % 5 == 0 else ""
    for attempt in (lambda: characterise_recordings(path, Layout.loads(layout)), lambda: propose_layout(path)):
        assert len(map_or_message(attempt)) > 20
