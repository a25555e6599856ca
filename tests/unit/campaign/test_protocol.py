"""A protocol is read to the last digit, or refused with file, line, value, rule and remedy."""

import itertools
import json
from pathlib import Path

import pytest

from pneudrive.campaign.planning.protocol import parse_protocol, protocol_schema, read_protocol, ready_protocols
from pneudrive.errors import ProtocolError

SPEED = '[speed]\nfrom = "1 mm/s"\nto = "450 mm/s"\ncount = 20\n'


def test_log_spacing_has_exact_ends_and_even_steps():
    levels = parse_protocol(SPEED).speed.levels_m_s
    assert (levels[0], levels[-1], len(levels)) == (0.001, 0.45, 20)
    ratio = 450.0 ** (1.0 / 19.0)
    for low, high in itertools.pairwise(levels):
        assert high / low == pytest.approx(ratio, rel=1e-3)  # levels between the ends have 4 digits


def test_linear_spacing_of_pressures_is_exact():
    text = SPEED + '[pressure]\nboth = { from = "0.1 bar gauge", to = "1.5 bar gauge", count = 8 }\n'
    levels = parse_protocol(text).pressure.levels
    assert [a.value_pa for a, b in levels] == [1e4, 3e4, 5e4, 7e4, 9e4, 11e4, 13e4, 15e4]
    assert all(a == b and a.gauge for a, b in levels)


def test_pressures_of_a_grid_are_crossed():
    text = SPEED + '[pressure]\na = ["0 bar gauge", "1 bar gauge"]\nb = ["1.5 bar abs"]\n'
    assert [(a.value_pa, b.value_pa, b.gauge) for a, b in parse_protocol(text).pressure.levels] == [
        (0.0, 1.5e5, False),
        (1e5, 1.5e5, False),
    ]


# what is changed in a good protocol, and what the message has to say
GOOD = (Path(__file__).parents[2] / "data" / "good_protocol.toml").read_text("utf-8")
WRONG = [
    ("[speed]", "[sped]", 4, "sped is not a known key", "Did you mean 'speed'?"),
    ("count = 20", "", 4, "speed.count is missing", "either list, or from, to and count"),
    ("count = 20", 'count = 20\nlist = "1 mm/s"', 5, "speed.list and speed.from cannot be given together", ""),
    ('"450 mm/s"', '"0.45"', 6, '"0.45" has no unit', "20 mm/s"),
    ('"450 mm/s"', '"0.5 mm/s"', 6, "the range is empty", "`from` must lie below `to`"),
    ('"1 mm/s"', '"0 mm/s"', 5, '"0 mm/s" is out of bounds', "greater than 0 m/s"),
    ('"1 bar gauge"', '"1 bar"', 10, 'pressure "1 bar" does not state abs or gauge', '"1 bar gauge"'),
    ('both = "1 bar gauge"', 'a = "1 bar gauge"', 9, "pressure.b is missing", "0 bar gauge"),
    ('["1 s", "15 s"]', '["1 s", "1 s"]', 13, "1 s occurs twice", "repeats"),
    ('["1 s", "15 s"]', '{ from = "1 s", to = "15 s", cont = 3 }', 13, "'cont' is not known here", "'count'"),
    ('"50 %"', '"150 %"', 14, '"150 %" lies outside the range', "0 % to 100 %"),
    ('["a", "b"]', '["a", "a"]', 17, "'a' is empty or occurs twice", "levels must differ"),
    ("average = 5", "average = 0", 20, "0 is not a number of samples", '"none"'),
    ("repeats = 2", "repeats = 0", 2, "0 is out of bounds", "at least 1"),
    ("[mounting]", '[order]\nkind = "random"\n[mounting]', 17, "is not known", "Did you mean 'randomised'?"),
]


@pytest.mark.parametrize(("old", "new", "line", "what", "help_"), WRONG)
def test_a_wrong_protocol_is_refused_with_line_and_remedy(old, new, line, what, help_):
    parse_protocol(GOOD)
    assert GOOD.count(old) == 1
    with pytest.raises(ProtocolError) as caught:
        parse_protocol(GOOD.replace(old, new), "p.toml")
    message = str(caught.value)
    assert what in message
    assert f"p.toml:{line}" in message
    assert help_ in message


def test_an_order_that_is_shuffled_away_is_refused():
    with pytest.raises(ProtocolError, match="contradict each other"):
        parse_protocol(SPEED + 'order = "descending"\n[order]\nkind = "randomised"\n')


def test_a_protocol_that_measures_nothing_is_refused():
    with pytest.raises(ProtocolError, match="measures nothing"):
        parse_protocol('name = "x"')


def test_an_unknown_name_lists_the_ready_protocols():
    with pytest.raises(ProtocolError, match="Did you mean 'paper-speed'"):
        read_protocol("paper-sped")


def test_a_file_goes_before_a_ready_protocol(tmp_path, monkeypatch):
    (tmp_path / "quick-look").write_text(f'name = "mine"\n{SPEED}')
    monkeypatch.chdir(tmp_path)
    assert read_protocol("quick-look").name == "mine"


@pytest.mark.parametrize("name", ready_protocols())
def test_a_ready_protocol_survives_being_written(name):
    """The tables written anew say the same; the text that a campaign keeps is the file to the letter."""
    protocol = read_protocol(name)
    assert protocol.text == ready_protocols()[name].read_text()
    again = parse_protocol(type(protocol).model_validate(protocol.to_dict()).text)
    assert again.model_dump() == protocol.model_dump()


def test_the_schema_describes_every_key():
    schema = protocol_schema()
    assert json.loads(json.dumps(schema)) == schema
    bare = [
        f"{name}.{key}"
        for name, table in schema["$defs"].items()
        for key, about in table.get("properties", {}).items()
        if not about.get("description")
    ]
    assert bare == []
