"""Each fault does to the samples what it says, in its cycle and interval, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from oracle.rig_faults import KINDS, Fault, FaultyRig
from pneudrive.errors import RigError
from pneudrive.rig import Move, Reproducible, Rig, Samples, Sampling, load_rig

STEPS = [Move(0.2, 0.1)]
SAMPLING = Sampling(samples_per_stroke=400, burst_rate_hz=0.0)


def run(*faults):
    """Run three cycles, the second of them struck; give what came and what would have come without faults."""
    out = []
    for told in (faults, ()):
        rig = FaultyRig(load_rig(seed=1), told)
        for key in ("1", "2", "3"):
            rig.move(0.02, 0.2)
            rig.begin_cycle(key)
            out.append(Samples.join(list(rig.acquire(STEPS, SAMPLING))))
    return out[:3], out[3:]


def window(samples):
    return (samples.time_s >= 0.5) & (samples.time_s < 1.0)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind not in ("lost", "state")])
def test_it_strikes_its_interval_alone(kind):
    value = {"offset": 3.0, "clock": 0.7}.get(kind)
    spoiled, clean = run(Fault(kind, cycles=(2,), begin_s=0.5, end_s=1.0, value=value))
    for i in (0, 2):
        np.testing.assert_array_equal(spoiled[i].force_n, clean[i].force_n)
        np.testing.assert_array_equal(spoiled[i].time_s, clean[i].time_s)
    inside, got, had = window(clean[1]), spoiled[1], clean[1]
    changed = {
        "stuck": lambda: np.all(got.force_n[inside] == had.force_n[inside][0]),
        "nan": lambda: np.all(np.isnan(got.force_n[inside])),
        "saturated": lambda: np.all(got.force_n[inside] == 200.0),
        "offset": lambda: np.allclose(got.force_n[inside], had.force_n[inside] + 3.0),
        "dropped": lambda: len(got) == len(had) - inside.sum() and not window(got).any(),
        "duplicated": lambda: np.sum(np.diff(got.time_s) == 0.0) == inside.sum() == len(got) - len(had),
        "clock": lambda: np.allclose(got.time_s[inside], had.time_s[inside] - 0.7),
    }
    assert changed[kind]()
    if len(got) == len(had):
        np.testing.assert_array_equal(got.force_n[~inside], had.force_n[~inside])


def test_a_lost_connection_leaves_the_axis_at_rest():
    rig = FaultyRig(load_rig(seed=1), [Fault("lost", begin_s=0.5)])
    assert isinstance(rig, Rig)
    assert isinstance(rig, Reproducible)
    with pytest.raises(RigError, match="connection to the rig is lost"):
        list(rig.acquire(STEPS, SAMPLING))
    assert not rig.state().moving
    rig.home()


def test_the_state_shows_it_for_some_looks():
    faults = [Fault("state", cycles=(1,), channel="supply_pressure_pa", value=2e5, looks=2)]
    rig = FaultyRig(load_rig(), [*faults, Fault("state", cycles=(2,), text="drive fault 7", looks=1)])
    assert [rig.state().supply_pressure_pa for _ in range(3)] == [2e5, 2e5, 7e5]
    list(rig.acquire(STEPS, SAMPLING))
    assert [rig.state().fault for _ in range(2)] == ["drive fault 7", None]


def test_unknown_faults_are_refused():
    with pytest.raises(RigError, match=r"(?s)'stck' is unknown.*Did you mean 'stuck'"):
        Fault("stck")
    with pytest.raises(RigError, match="'force' is unknown"):
        Fault("nan", channel="force")
