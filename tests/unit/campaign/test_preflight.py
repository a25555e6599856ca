"""A plan that the rig must not run is refused before anything moves: cycle, value, limit, remedy."""

import pytest

from pneudrive.campaign.planning import preflight
from pneudrive.errors import ProtocolError

SWEEP = '[speed]\nlist = ["10 mm/s", "500 mm/s"]\nsettled_time = "0 s"\n'
BOTH = '[pressure]\nboth = "2 bar gauge"\n'
UNEQUAL = '[pressure]\npairs = [{ a = "2 bar gauge", b = "0 bar gauge" }]\n'

# name: protocol, changes of the envelope, changes of the identity, what the message says; a relaxed twin passes
BROKEN = {
    "speed": (
        SWEEP,
        {"speed_m_s": 0.4},
        {},
        ["cycle b1/sweep/v500/a0/b0/r1", "500 mm/s; at most 400 mm/s", "Lower the"],
    ),
    "ramp": (
        SWEEP + '[position]\nrange = "100 mm .. 140 mm"\n',
        {},
        {},
        ["500 mm/s within 40 mm; at most", "starting and stopping take", "use more of the stroke"],
    ),
    "acceleration": (
        SWEEP + '[limits]\nacceleration = "2 m/s2"\n',
        {},
        {},
        ["v500", "5 m/s2; at most 2 m/s2", "the rig ramps with its own acceleration"],
    ),
    "stroke": (
        '[stop]\ndurations = "1 s"\nposition = "290 mm"\nrecovery = "20 mm"\n',
        {},
        {},
        ["stroke: cycle b1/stop/t1/a0/b0/v10/held/x290mm/+x", "310 mm; allowed: 5 mm to 295", "approach or recovery"],
    ),
    "force, unequal pressures": (
        SWEEP + UNEQUAL,
        {"force_n": 110.0},
        {},
        ["force", "20 N friction + 98 N difference of the pressure forces", "at most 110 N", "closer together"],
    ),
    "force, areas differ": (
        SWEEP + BOTH,
        {"force_n": 60.0},
        {"area_b_m2": 2.9e-4},
        ["40 N difference", "at most 60 N", "chamber a closer to 0.592 times that of chamber b"],
    ),
    "force, incline": (SWEEP, {"force_n": 27.0}, {"incline_rad": 1.5707}, ["7.85 N weight of the moving parts"]),
    "force, known weight": (
        SWEEP + "[before_block]\nknown_weight = { mass = '21 kg' }\n",
        {},
        {},
        ["cycle b1/weight", "206 N known weight", "Take a smaller weight"],
    ),
    "release, pressure": (
        UNEQUAL + '[stop]\ndurations = "1 s"\naxis = "released"\n',
        {},
        {},
        ["release: cycle b1/stop/t1/a2/b0/v10/released", "axis with 98 N", "at most 20 N"],
    ),
    "release, weight": (
        SWEEP + '[before_block]\ntare = "5 s"\n',
        {"expected_friction_n": 7.0},
        {"incline_rad": -1.5707963},
        ["release: cycle b1/tare", "axis with 7.85 N"],
    ),
    "pressure": (
        SWEEP + BOTH,
        {"pressure_pa": (1e5, 2.5e5)},
        {},
        ["3 bar abs in chamber a", "1 bar abs to 2.5 bar abs"],
    ),
    "manifold": (
        SWEEP + UNEQUAL,
        {"separate_pressures": False},
        {},
        ["3 bar abs and 1 bar abs", "common manifold", "key `both`"],
    ),
    "temperature": (
        SWEEP + '[conditions]\ntemperature = "40 degC .. 60 degC"\n',
        {},
        {},
        ["40 to 60 degC", "15 to 30 degC", "protocol.toml:5"],
    ),
    "range": (SWEEP + '[position]\nrange = "0 mm .. 200 mm"\n', {}, {}, ["from 0 mm to 200 mm", "from 5 mm to 295 mm"]),
    "no range": (SWEEP + '[position]\nmargin = "145 mm"\n', {}, {}, ["from 150 mm to 150 mm"]),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_protocol_that_breaks_a_limit_is_refused(name, planned):
    text, envelope, identity, says = BROKEN[name]
    with pytest.raises(ProtocolError) as caught:
        planned(text, envelope, identity)
    message = str(caught.value)
    for words in says:
        assert words in message
    assert "protocol.toml" in message


@pytest.mark.parametrize(
    ("text", "envelope"),
    [
        (SWEEP, {"speed_m_s": 0.5}),
        (SWEEP + '[limits]\nacceleration = "5 m/s2"\n', {}),
        (SWEEP + UNEQUAL, {"force_n": 20.0 + 98.0 + 4.0}),  # friction, 2 bar on 4.9 cm2, 0.8 kg at 5 m/s2
        (SWEEP + BOTH, {"pressure_pa": (1e5, 3e5), "separate_pressures": False}),
        (SWEEP + '[conditions]\ntemperature = "10 degC .. 20 degC"\n', {}),
        (SWEEP + '[position]\nrange = "0 % .. 100 %"\n', {}),
    ],
)
def test_exactly_at_the_limit_is_allowed(text, envelope, planned):
    planned(text, envelope)


def test_a_slow_move_never_reaches_the_acceleration_of_the_axis(planned):
    """10 mm/s ends its ramp while the jerk still raises the acceleration: sqrt(v j) = 1.41 m/s2."""
    planned('[speed]\nlist = "10 mm/s"\n[limits]\nacceleration = "1.42 m/s2"\n')
    with pytest.raises(ProtocolError, match=r"1\.414 m/s2; at most 1\.41 m/s2"):
        planned('[speed]\nlist = "10 mm/s"\n[limits]\nacceleration = "1.41 m/s2"\n')


def test_all_violations_are_counted(planned):
    text = SWEEP + '[pressure]\nboth = ["1 bar gauge", "9 bar gauge"]\n'
    with pytest.raises(ProtocolError) as caught:
        planned(text, {"speed_m_s": 0.3})
    message = str(caught.value)
    assert "3 of 4 cycles break limits of the rig" in message
    assert "speed: cycle b1/sweep/v500/a1/b1/r1" in message
    assert "pressure: cycle b1/sweep/v10/a9/b9/r1: 10 bar abs in chamber a" in message
    assert message.count("(2 cycles)") == 2


NOTES = {
    "burst_rate is 1000 Hz": '[sampling]\nburst_rate = "1 kHz"\n',
    "5000 samples per stroke give 17 samples per second": "",
    "but the means leave out only 5 %": '[speed]\nlist = "500 mm/s"\n',
    "repeatability cannot be determined": "",
    "cannot be separated from an offset": 'directions = "+x"\n',
    "separated from the effect of a new set-up": '[mounting]\nlevels = ["a", "b"]\n',
    "recovery after a stop has no reference": '[stop]\ndurations = "1 s"\nreference_strokes = 0\n',
    "raise conditions.supply_pressure": BOTH + '[conditions]\nsupply_pressure = "1 bar gauge"\n',
    "more than limits.time = 0.0833 h": '[limits]\ntime = "5 min"\n',
    "less than speed.settled_time = 30 s": '[speed]\nlist = "500 mm/s"\nsettled_time = "30 s"\n',
}


@pytest.mark.parametrize("words", NOTES)
def test_what_a_plan_tells_badly_is_said(words, planned):
    quiet = 'repeats = 2\n[speed]\nlist = "100 mm/s"\n'
    assert planned(quiet).notes == ()
    extra = NOTES[words]
    speed = "" if extra.startswith("[speed]") else '[speed]\nlist = "1 mm/s"\n'
    top = extra if extra.startswith("directions") else ""
    notes = planned(top + speed + (extra if not top else "")).notes
    assert any(words in note for note in notes), notes


def test_repeats_are_checked_once_and_all_counted(planned, monkeypatch):
    checked, violations = [], preflight.violations
    monkeypatch.setattr(preflight, "violations", lambda one, *rest: checked.append(one.key) or violations(one, *rest))
    planned("repeats = 50\n" + SWEEP)
    assert len(checked) == 2
    with pytest.raises(
        ProtocolError, match=r"50 of 100 cycles break limits of the rig[^$]*v500[^$]*at most 400 mm/s \(50 cycles\)"
    ):
        planned("repeats = 50\n" + SWEEP, {"speed_m_s": 0.4})
