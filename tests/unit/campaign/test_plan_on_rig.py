"""What a plan says of time, samples and size is what a rig then does; synthetic: the rig is the simulated one."""

from dataclasses import replace

import pytest

from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.planning.preflight import size_of
from pneudrive.campaign.planning.protocol import parse_protocol
from pneudrive.campaign.storage.folder import Head, write_cycle
from pneudrive.errors import RigError
from pneudrive.rig import Samples, load_rig

TEXT = """
directions = "+x"
[speed]
list = ["40 mm/s", "300 mm/s"]
[stop]
durations = "3 s"
preconditioning = { strokes = 1, speed = "200 mm/s" }
[pressure]
both = "0.5 bar gauge"
[before_block]
tare = "2 s"
"""


@pytest.mark.parametrize("name", ["default", "common-manifold"])
def test_a_rig_does_what_the_plan_says(tmp_path, name):
    rig = load_rig(name, seed=1)
    plan = lay_out(parse_protocol(TEXT), rig.identity(), rig.limits())
    written = 0.0
    for index, one in enumerate(plan.planned, start=1):
        cycle = one.cycle
        rig.set_pressure(cycle.pressure_a_pa, cycle.pressure_b_pa)
        if rig.state().position_m != cycle.start_m:
            rig.move(cycle.start_m, 0.1)
        samples = Samples.join(list(rig.acquire(cycle.steps, cycle.sampling)))
        assert samples.time_s[-1] == pytest.approx(one.axis_s, abs=1e-6)
        assert abs(len(samples) - one.samples) <= len(cycle.steps)  # a sample more where a border rounds up
        written += write_cycle(tmp_path, Head(index, cycle), samples).stat().st_size
    assert 0.5 < written / size_of(plan.planned) < 1.5


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"area_a_m2": "25 mm"}, "area_a_m2 = '25 mm'"),
        ({"area_b_m2": -1.0}, "area_b_m2 = -1"),
        ({"mass_beyond_sensor_kg": float("nan")}, "mass_beyond_sensor_kg = nan"),
        ({"limits": {"force_n": (200.0, -200.0)}}, "limits.force_n"),
    ],
)
def test_what_no_rig_is_is_refused_before_a_folder_is_made(change, words):
    rig = load_rig("default")
    with pytest.raises(RigError) as caught:
        lay_out(parse_protocol(TEXT), replace(rig.identity(), **change), rig.limits())
    assert words in caught.value.what
    assert rig.identity().name in caught.value.where
