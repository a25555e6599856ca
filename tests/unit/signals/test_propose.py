"""A proposed layout reads the file that it was proposed for, and marks its guesses."""

from types import SimpleNamespace

import numpy as np
import pytest

from pneudrive.characterise import Layout, characterise, load_recordings
from pneudrive.errors import PneudriveWarning, RecordingError
from pneudrive.signals.channels import FileChannel, open_channels, pairs
from pneudrive.signals.proposal import propose_layout


def columns(make, **options):
    r = make(friction=20.0, gauge_b=3e5, swing=0.02e5, strokes=6, travel=0.1, speed=0.05, rate=200.0, **options)
    return r, r.time_s, r.position_m * 1e3, (r.pressure_b_pa - 101325) / 1e5, r.force_n


def write(path, head, rows, delimiter=" ", decimal="."):
    lines = [delimiter.join(f"{v:.4f}".replace(".", decimal) for v in row) for row in zip(*rows, strict=True)]
    path.write_text("\n".join([*head, *lines]) + "\n", encoding="utf-8")


def check(path, truth, sign=1.0, guessed=0):
    proposal = propose_layout(path)
    assert proposal.problem == ""
    assert proposal.text.count("guessed = true") == guessed
    assert len(proposal.strokes) == 6
    recording = load_recordings([path], Layout.loads(proposal.text))[0]
    assert recording.position_m == pytest.approx(truth.position_m, abs=1e-7)
    assert recording.force_n == pytest.approx(sign * truth.force_n, abs=1e-3)
    assert proposal.text.count("guess") >= 5
    return proposal


def test_bare_numbers_with_voltages_beside_them(make, tmp_path):
    truth, t, x, p, f = columns(make)
    noise = np.random.default_rng(1).normal(0, 1e-3, t.size)
    write(tmp_path / "a.txt", [], [t * 1e3, x / 10 + 1, p / 2, f / 50, x, p + noise * 0, f])
    proposal = check(tmp_path / "a.txt", truth, guessed=3)
    found = {g.role: (g.column, g.unit) for g in proposal.guesses}
    assert found == {"time": (0, "ms"), "position": (4, "mm"), "pressure_b": (5, "bar"), "force": (6, "N")}
    # The bore closes the mean balance: within 1 % of the 25 mm that made the recording.
    bore = float(proposal.text.split('bore = "')[1].split(" mm")[0])
    assert bore == pytest.approx(25.0, rel=0.01)


def test_header_with_units_decimal_comma_and_a_title(make, tmp_path):
    truth, t, x, p, f = columns(make)
    head = ["Prüfstand 3", "", "Zeit [s];Weg [mm];Druck B [bar];Kraft [N]"]
    write(tmp_path / "a.csv", head, [t, x, p, f], ";", ",")
    proposal = check(tmp_path / "a.csv", truth)
    assert 'decimal = ","' in proposal.text
    assert 'delimiter = ";"' in proposal.text
    assert "unit as named" in proposal.text


def test_units_in_a_row_of_their_own_and_a_force_of_the_other_sign(make, tmp_path):
    truth, t, x, p, f = columns(make)
    write(tmp_path / "a.csv", ["time,position,p2,force", "s,mm,bar,N"], [t, x, p, -f], ",")
    proposal = check(tmp_path / "a.csv", truth)
    assert 'positive = "-x"' in proposal.text


@pytest.mark.parametrize("name", ["Pressure (kPa)", "pressure_kPa", "Druck / kPa", "p kPa"])
def test_a_unit_names_no_chamber_and_the_force_s_sign_is_heeded(make, tmp_path, name):
    truth, t, x, p, f = columns(make)
    write(tmp_path / "a.csv", [f"Time (s),Position (mm),{name},Load Cell (N)"], [t, x, p * 100, -f], ",")
    proposal = check(tmp_path / "a.csv", truth)
    assert {g.role: g.unit for g in proposal.guesses}["pressure_b"] == "kPa"
    assert characterise([tmp_path / "a.csv"], Layout.loads(proposal.text)).friction_n.to_numpy() == pytest.approx(
        20, abs=0.2
    )


@pytest.mark.parametrize(("name", "ambient"), [("P rod (psia)", 1.01325), ("P rod (psig)", 0.0), ("p_psi", 0.0)])
def test_inches_pounds_and_absolute_psi_are_read_as_named(make, tmp_path, name, ambient):
    truth, t, x, p, f = columns(make)
    rows = [t, 10.0 * x / 25.4, (p + ambient) * 14.503774, 10.0 * f / 4.4482216152605]  # four decimals: tenfold
    write(tmp_path / "a.csv", [f"Time (s),Position (in),{name},Load (lbf)"], rows, ",")
    proposal = propose_layout(tmp_path / "a.csv")
    units = {guess.role: guess.unit for guess in proposal.guesses}
    assert (units["position"], units["pressure_b"], units["force"]) == ("in", "psi", "lbf")
    (recording,) = load_recordings([tmp_path / "a.csv"], Layout.loads(proposal.text))
    assert recording.position_m == pytest.approx(10.0 * truth.position_m, abs=2e-6)
    assert recording.pressure_b_pa == pytest.approx(truth.pressure_b_pa, abs=5.0)
    assert recording.force_n == pytest.approx(10.0 * truth.force_n, abs=1e-3)


@pytest.mark.parametrize(("unit", "scale", "zero"), [("V", 0.4, 0.5), ("mA", 1.6, 4.0), ("counts", 100.0, 0.0)])
def test_pressures_in_volts_ask_for_a_scale_and_give_the_friction_with_it(make, tmp_path, unit, scale, zero):
    _, t, x, p, f = columns(make)
    rows = [t, x, zero + scale * 0.02 * np.sign(np.gradient(x)), zero + scale * p, f]
    names = f"Time (s),Position (mm),Pressure A ({unit}),Pressure B ({unit}),Force (N)"
    write(tmp_path / "a.csv", [names], rows, ",")
    proposal = propose_layout(tmp_path / "a.csv")
    for side in "ab":
        assert f"pressure_{side}: this column contains {unit}: state the unit, and the scale" in proposal.problem
    assert "\nopen_to_ambient" not in proposal.text
    text = proposal.text.replace("# pressure_", "pressure_")
    text = text.replace("offset = 0.0", f"offset = {-zero / scale}").replace("scale = 1.0", f"scale = {1 / scale}")
    found = characterise([tmp_path / "a.csv"], Layout.loads(text))
    assert found.friction_n.to_numpy() == pytest.approx(20.0 + 2e3 * np.pi / 4 * 0.025**2, abs=0.2)
    # A layout that leaves them out, as by hand, is warned of.
    sides = "".join(f"[chamber_{side}]\nopen_to_ambient = true\n" for side in "ab")
    with pytest.warns(PneudriveWarning, match="'Pressure A.* is not used"):
        load_recordings([tmp_path / "a.csv"], Layout.loads(proposal.text + sides))


def test_a_force_or_a_position_in_volts_is_asked_for(make, tmp_path):
    _, t, x, p, f = columns(make)
    write(tmp_path / "a.csv", ["Time (s),Position (V),Pressure B (bar),Load cell (mV)"], [t, x / 20, p, f / 9], ",")
    problem = propose_layout(tmp_path / "a.csv").problem
    assert "position: this column contains V: state the unit, and the scale (unit per V)" in problem
    assert "force: this column contains mV: state the unit, and the scale (unit per mV)" in problem


def test_an_unused_column_is_named_and_a_chamber_is_open_only_if_none_can_be_its_pressure(make, tmp_path):
    """A supply pressure beside one chamber's pressure: the other chamber may be at any pressure, and the bore too."""
    _, t, x, p, f = columns(make)
    head = "Time (s),Position (mm),Pressure B (bar),Load (N),Supply pressure (bar),Temperature (degC)"
    supply, warm = 7 + 0.01 * np.sin(t), 22 + 0.1 * np.sin(t)
    write(tmp_path / "a.csv", [head], [t, x, p, f, supply, warm], ",")
    proposal = propose_layout(tmp_path / "a.csv")
    assert "pressure_a: no column name shows the chamber" in proposal.problem
    assert "Supply pressure (bar)" in proposal.problem
    assert "# not used: Temperature (degC)" in proposal.text
    assert 'bore = "25 mm"  # guess: write the real bore' in proposal.text
    head = head.replace("Supply pressure (bar)", "Speed (mm/s)")
    write(tmp_path / "a.csv", [head], [t, x, p, f * 0.5, supply, warm], ",")
    proposal = propose_layout(tmp_path / "a.csv")
    assert (proposal.problem, proposal.unused) == ("", ("Speed (mm/s)", "Temperature (degC)"))
    assert "[chamber_a]\nopen_to_ambient = true" in proposal.text
    assert float(proposal.text.split('bore = "')[1].split(" mm")[0]) == pytest.approx(25.0 / 2**0.5, rel=0.01)


def test_names_in_quotes_with_quotes_and_delimiters(make, tmp_path):
    truth, *rows = columns(make)
    head = ['"time ""t"" [s]", "position, ""x"" [mm]", "pressure B [bar]", "force F [N]"']
    write(tmp_path / "a.csv", head, rows, delimiter=",")
    proposal = check(tmp_path / "a.csv", truth)
    assert {g.column for g in proposal.guesses} >= {'time "t" [s]', 'position, "x" [mm]'}


def test_columns_of_texts_are_no_signals(make, tmp_path):
    truth, *rows = columns(make)
    write(tmp_path / "a.csv", ["state,t [s],position state,x [mm],p_b [bar],f [N]"], rows, delimiter=",")
    head, *lines = (tmp_path / "a.csv").read_text().splitlines()
    moved = [",".join(["ok", line.split(",")[0], "moves", *line.split(",")[1:]]) for line in lines]
    (tmp_path / "a.csv").write_text("\n".join([head, *moved]) + "\n")
    found = {g.role: g.column for g in check(tmp_path / "a.csv", truth).guesses}
    assert found == {"time": "t [s]", "position": "x [mm]", "pressure_b": "p_b [bar]", "force": "f [N]"}
    shown = open_channels(tmp_path / "a.csv", None, tmp_path / "cache")
    assert [one.column for one in shown.channels] == ["t [s]", "x [mm]", "p_b [bar]", "f [N]"]


def test_a_picture_shows_what_was_understood(make, tmp_path):
    from pneudrive.report.recordings import write_layout_figure

    _, t, x, p, f = columns(make)
    write(tmp_path / "a.csv", ["time_s,position_mm,p_b_bar,force_N"], [t, x, p, f], ",")
    picture = write_layout_figure(propose_layout(tmp_path / "a.csv"), tmp_path / "a.png")
    assert picture.read_bytes().startswith(b"\x89PNG")
    (tmp_path / "b.csv").write_text("\n".join(f"{i};{7.3 - 1e-4 * i:.4f}" for i in range(400)))
    assert write_layout_figure(propose_layout(tmp_path / "b.csv"), tmp_path / "b.svg").stat().st_size > 1000


@pytest.fixture(scope="module")
def driven():
    from oracle.drive_records import drive, record

    return record(drive(), 1, duration_s=1.0).columns


@pytest.mark.parametrize("named", [True, False])
def test_the_voltage_of_a_drive_s_valve_is_its_command_and_no_force(driven, tmp_path, named):
    from pneudrive.signals.drive_recording import read_drive_recordings

    volts = 5 + 5 * driven["command"]
    table = [
        driven["time_s"],
        volts,
        driven["position_m"] * 1e3,
        driven["pressure_a_pa"] / 1e5,
        driven["pressure_b_pa"] / 1e5,
    ]
    head = ["t [s],Ventil [V],Weg [mm],p_A [bar abs],p_B [bar abs]"] if named else []
    write(tmp_path / "a.csv", head, table, ",")
    proposal = propose_layout(tmp_path / "a.csv")
    assert "force" not in {g.role for g in proposal.guesses}
    if not named:
        assert "the file does not contain all information" in proposal.problem
        return
    assert proposal.kind == "drive"
    assert 'unit = "V", range = "0 V .. 10 V"' in proposal.text
    assert {g.role: g.index for g in proposal.guesses}["command"] == 1
    assert proposal.problem == ""
    layout = Layout.loads(proposal.text.replace('"bar gauge"', '"bar abs"'))
    read = read_drive_recordings([tmp_path / "a.csv"], layout)[0]
    assert read["command"] == pytest.approx(driven["command"], abs=1e-4)
    assert read["pressure_a_pa"] == pytest.approx(driven["pressure_a_pa"], abs=20)


def test_a_pressure_alone_is_a_fixed_volume(tmp_path):
    from pneudrive.report.recordings import write_layout_figure

    rows = [f"{100 * i}.000;{3.6 - 1e-4 * i:.4f};{7.2 - 2e-4 * i:.4f}" for i in range(400)]
    (tmp_path / "leak.csv").write_text("\n".join(rows))
    proposal = propose_layout(tmp_path / "leak.csv")
    assert "the unit of the time is not stated (s or ms or us): state it" in proposal.problem
    for name, unit in {"p [barg]": "bar", "Druck relativ [Pa]": "Pa", "p [bar (rel.)]": "bar"}.items():
        (tmp_path / "leak.csv").write_text("\n".join([f"t [ms];U [V];{name}", *rows]))
        proposal = propose_layout(tmp_path / "leak.csv")
        assert (proposal.kind, proposal.problem) == ("fixed-volume", "")
        assert f'pressure = {{ column = "{name}", unit = "{unit} gauge" }}' in proposal.text
    assert write_layout_figure(proposal, tmp_path / "a.png").stat().st_size > 1000


@pytest.mark.parametrize("head", ["id,price,amount", ""])
def test_a_table_that_is_no_recording_gets_no_layout(tmp_path, refusal, head):

    rng = np.random.default_rng(0)
    rows = [f"{i},{rng.uniform(1, 90):.2f},{rng.integers(1, 9)}" for i in range(400)]
    (tmp_path / "a.csv").write_text("\n".join([head, *rows] if head else rows))
    refusal(["layout", tmp_path / "a.csv", "--out", tmp_path / "layout.toml"], "do not match a recording")
    assert not (tmp_path / "layout.toml").exists()


def test_a_layout_that_does_not_read_its_file_says_so_with_a_status(make, tmp_path, capsys):
    from pneudrive.cli.main import run

    _, t, x, p, f = columns(make)
    write(tmp_path / "a.csv", ["time_s,position_mm,p_b_bar,signal"], [t, x, p, f * 0], ",")
    assert run(["layout", str(tmp_path / "a.csv"), "--out", str(tmp_path / "layout.toml")]) == 2
    assert "# not found: force" in (tmp_path / "layout.toml").read_text()
    assert "does not read the file yet" in capsys.readouterr().err


def test_dots_that_separate_thousands(tmp_path):
    rows = [
        f"{f'{i // 10}.{100 * (i % 10):03d}' if i >= 10 else 100 * i}.000;{3.6 - 1e-4 * i:.4f};{7.2 - 2e-4 * i:.4f}"
        for i in range(400)
    ]
    (tmp_path / "leak.csv").write_text("\n".join(rows))
    proposal = propose_layout(tmp_path / "leak.csv")
    assert 'thousands = "."' in proposal.text
    assert proposal.file.values[0][-1] == 39900.0
    assert proposal.kind == "fixed-volume"


@pytest.mark.parametrize(
    ("content", "words"),
    [(b"", "empty"), (b"# only\n# remarks\n", "no table of numbers"), (bytes(range(256)) * 9, "binary")],
)
def test_what_holds_no_table_is_refused(tmp_path, content, words):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(RecordingError, match=words):
        propose_layout(tmp_path / "a.csv")


def test_gauge_pressures_of_two_ambients_are_compared_as_absolute():
    sea, hill = (
        SimpleNamespace(time=None, channels=[FileChannel("p", "p", "bar", "p", 1e5, zero)]) for zero in (1e5, 0.9e5)
    )
    ((_, shared),) = pairs(sea, hill)
    assert (shared.slope, shared.zero) == pytest.approx((1.0, -0.1))
