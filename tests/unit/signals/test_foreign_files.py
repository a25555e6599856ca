"""Files of other programs give the right friction and speed, or one sentence that names what the file does not tell."""

import collections
import datetime as dt

import numpy as np
import pytest

from oracle.foreign_files import judge, make
from pneudrive.characterise import Layout, characterise_recordings
from pneudrive.errors import PneudriveWarning, RecordingError
from pneudrive.signals.drive_recording import read_volume_recordings
from pneudrive.signals.proposal import propose_layout
from trials.foreign_trials import trials

FRICTION_N, SPEED_M_S, RATE = 12.0, 0.015, 50.0
NAMES = ["Time", "Position", "Force", "Pressure A", "Pressure B"]
BRACKETS = ["Time [s]", "Position [mm]", "Force [N]", "Pressure A [barg]", "Pressure B [barg]"]


@pytest.fixture(scope="module")
def table():
    """Return 6 strokes of 40 mm at 15 mm/s, friction 12 N, 3 and 1 bar gauge: s, mm, N, bar gauge."""
    time = np.arange(850) / RATE
    x = 10 + 40 * (1 - np.abs(1 - (time / (2 * 40 / 15)) % 1 * 2))
    direction = np.where((time / (2 * 40 / 15)) % 1 < 0.5, 1.0, -1.0)
    rng = np.random.default_rng(5)
    force = FRICTION_N * direction + 1.5 - 2e5 * np.pi / 4 * 0.025**2 + 0.2 * rng.normal(size=time.size)
    noise = rng.normal(size=(3, time.size))
    return np.column_stack([time, x + 0.002 * noise[0], force, 3 + 0.002 * noise[1], 1 + 0.002 * noise[2]])


def text_of(head, rows, sign=","):
    return "\n".join(sign.join(row) for row in [*head, *rows])


def fields(table, decimals=(3, 5, 4, 4, 4)):
    return [[f"{v:.{d}f}" for v, d in zip(row, decimals, strict=True)] for row in table]


@pytest.fixture
def sheet(tmp_path):
    """Write a table of texts under its head; return its file."""

    def write(head, rows, name="a.csv", sign=",", before=""):
        (tmp_path / name).write_text(before + text_of(head, rows, sign), encoding="utf-8")
        return tmp_path / name

    return write


def check(path, text=None):
    text = text or propose_layout(path).text
    found = characterise_recordings([path], Layout.loads(text)).friction_map
    assert found.friction_n.to_numpy() == pytest.approx(FRICTION_N, abs=0.15)
    assert np.abs(found.velocity_m_s.to_numpy()) == pytest.approx(SPEED_M_S, rel=0.01)
    assert found.pressure_a_pa.to_numpy() == pytest.approx(401325, abs=500)
    return found.flags.values.tolist()


def proposed(path):
    proposal = propose_layout(path)
    assert proposal.problem == ""
    check(path, proposal.text)
    return proposal


def test_waveforms_that_start_at_different_times(table, tmp_path):
    from nptdms import ChannelObject, TdmsWriter

    start = np.datetime64("2026-03-02T09:18:17", "us")
    channels = []
    for at, (name, unit) in enumerate(zip(NAMES[1:], ("mm", "N", "bar", "bar"), strict=True), 1):
        late = 100 if name == "Force" else 0  # samples
        step = 5 if name.startswith("Pressure") else 1
        about = {"wf_start_time": start + np.timedelta64(20000 * late, "us"), "wf_increment": step / RATE}
        values = table[late::step, at].copy()
        channels.append(ChannelObject("rig", name, values, about | {"unit_string": unit, "wf_start_offset": 0.0}))
    with TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(channels)
    proposed(tmp_path / "a.tdms")


@pytest.mark.parametrize(("name", "factor"), [("micros", 1e6), ("millis", 1e3), ("Time (us)", 1e6), ("Time", 1e3)])
def test_the_unit_of_the_time_by_its_name_or_by_the_speed(table, name, factor, sheet):
    rows = [[f"{5e6 + factor * row[0]:.0f}", *texts[1:]] for row, texts in zip(table, fields(table), strict=True)]
    proposed(sheet([[name, *BRACKETS[1:]]], rows))


def test_a_time_that_may_be_in_seconds_or_milliseconds_is_asked_for(table, sheet):
    rows = [
        [f"{row[0] / RATE * 10:.4f}", *texts[1:]]
        for row, texts in zip(table * [100, 1, 1, 1, 1], fields(table), strict=True)
    ]
    path = sheet([["Time", *BRACKETS[1:]]], rows)
    assert "the unit of the time is not stated (s or ms): state it" in propose_layout(path).problem


@pytest.mark.parametrize("whole", [True, False])
def test_a_counter_that_wraps(table, whole, sheet):
    counts = (30000 + np.round(1000 * (table[:, 1] - 10))) % 2**16
    rows = [
        [t[0], f"{c:.0f}" if whole else f"{c * 1e-3:.3f}", *t[2:]] for t, c in zip(fields(table), counts, strict=True)
    ]
    head = [BRACKETS[0], "Encoder counts" if whole else BRACKETS[1], *BRACKETS[2:]]
    path = sheet([head], rows)
    layout = propose_layout(path).text
    if whole:
        assert "position: this column contains counts: state the unit, and the scale" in propose_layout(path).problem
        layout = layout.replace("# position = {", "position = {").replace("scale = 1.0", "scale = 0.001")
        assert all("counter_wrap" in flags for flags in check(path, layout))
    else:  # no whole numbers: nothing is changed, but the jumps are named
        flags = characterise_recordings([path], Layout.loads(layout)).friction_map.flags.values.tolist()
        assert all("position_jump" in flag for flag in flags)
        stated = layout.replace('"Position [mm]", unit', '"Position [mm]", wraps = 65.536, unit')
        assert not any("counter_wrap" in flag or "position_jump" in flag for flag in check(path, stated))


@pytest.mark.parametrize("bits", [16, 32])
def test_a_clock_of_counts_that_wraps(table, bits, sheet):
    factor, unit = (1e3, "ms") if bits == 16 else (1e6, "us")
    clock = (2**bits - 4000 + np.round(factor * table[:, 0])) % 2**bits
    rows = [[f"{c:.0f}", *texts[1:]] for c, texts in zip(clock, fields(table), strict=True)]
    proposed(sheet([[f"Time [{unit}]", *BRACKETS[1:]]], rows))


@pytest.mark.parametrize(
    ("unit", "factor", "shift"),
    [("barg", 1, 0), ("[psia]", 14.503774, 1.01325), ("MPa(G)", 0.1, 0), ("inHg", 29.52999, 0)],
)
def test_rows_of_units_and_of_descriptions(table, unit, factor, shift, sheet):
    numbers = table.copy()
    numbers[:, 3:] = (numbers[:, 3:] + shift) * factor
    head = [NAMES, ["s", "mm", "N", unit, unit], ["clock", "Linear enc", "Load cell", "P-101", "P-102"]]
    proposal = proposed(sheet(head, fields(numbers, (3, 5, 4, 6, 6))))
    assert {g.role: g.column for g in proposal.guesses}["pressure_a"] == "Pressure A"


def test_a_unit_that_nobody_knows_is_asked_for(table, sheet):
    assert (
        "pressure_a: the unit 'psid' of this column is not known: state the unit"
        in propose_layout(sheet([NAMES, ["s", "mm", "N", "psid", "barg"]], fields(table))).problem
    )


def test_a_decimal_comma_does_not_separate_columns(tmp_path):
    time = 0.1 + np.arange(600) / 1000.0
    pressure = np.linspace(601.0, 40.0, time.size)  # in most rows a blank before three digits looks like thousands
    rows = [[f"{t:.3f}".replace(".", ","), f"{p:.1f}".replace(".", ",")] for t, p in zip(time, pressure, strict=True)]
    (tmp_path / "a.txt").write_text(text_of([["Zeit[s]", "Druck[kPa]"]], rows, " "))
    form = propose_layout(tmp_path / "a.txt").file.form
    assert (form.delimiter, form.decimal, form.thousands) == (None, ",", None)


def lvm(table, times, segment=0):
    head = [["LabVIEW Measurement", ""], ["X_Columns", times], ["***End_of_Header***", ""], [""]]
    block = [["Channels", "4"], ["Y_Unit_Label", "mm", "N", "bar", "bar"], ["X0", *["0,000"] * 4],
             ["Delta_X", *["0,020"] * 4], ["***End_of_Header***"], ["X_Value", *NAMES[1:], "Comment"]]  # fmt: skip
    rows = [[text.replace(".", ",") for text in row] for row in fields(table)]
    rows = [["" if times == "No" else row[0], *row[1:]] for row in rows]
    step = segment or len(rows)
    parts = [line for at in range(0, len(rows), step) for line in [*block, *rows[at : at + step], [""]]]
    return text_of(head, parts, "\t")


def test_measurement_files_without_a_column_of_times_and_in_segments(table, tmp_path):
    (tmp_path / "a.lvm").write_text(lvm(table, "No"))
    assert 'time = { rate = "50 Hz" }' in proposed(tmp_path / "a.lvm").text
    (tmp_path / "late.lvm").write_text(lvm(table, "No").replace("X0\t0,000", "X0\t0,100"))
    text = propose_layout(tmp_path / "late.lvm").text
    assert 'position = { column = "Position", unit = "mm", delay = "-0.1 s" }' in text  # it starts 0.1 s later
    (tmp_path / "b.lvm").write_text(lvm(table, "One", segment=200))
    proposed(tmp_path / "b.lvm")
    again = table.copy()
    again[400:, 0] -= again[400, 0]
    (tmp_path / "c.lvm").write_text(lvm(again, "One", segment=200))
    text = propose_layout(tmp_path / "b.lvm").text
    with pytest.raises(RecordingError, match="the time restarts in segment 3"):
        check(tmp_path / "c.lvm", text)


def test_a_file_without_times_asks_for_a_rate(table, tmp_path, sheet):
    path = sheet([BRACKETS[1:]], [row[1:] for row in fields(table)])
    proposal = propose_layout(path)
    assert (
        'no column increases like a time: state the rate of the samples, time = { rate = "50 Hz" }' in proposal.problem
    )
    check(path, proposal.text.replace("[columns]", '[columns]\ntime = { rate = "50 Hz" }'))
    rows = [[str(at), *row[1:]] for at, row in enumerate(fields(table))]
    second = sheet([["Sample", *BRACKETS[1:]]], rows, "b.csv")
    assert "column 'Sample' numbers the rows: state the rate" in propose_layout(second).problem
    (tmp_path / "c.csv").write_text("Sample rate: 50 Hz\n" + second.read_text())
    proposed(tmp_path / "c.csv")


def dated(table, form, start=dt.datetime(2026, 3, 2, 9, 18, 17)):
    return [(start + dt.timedelta(seconds=row[0])).strftime(form) for row in table]


def test_stamps_that_many_samples_share(table, sheet):
    stamps = dated(table, "%m/%d/%Y %I:%M:%S %p")
    rows = [[stamp, *row[1:]] for stamp, row in zip(stamps, fields(table), strict=True)]
    path = sheet([["Timestamp", *BRACKETS[1:]]], rows)
    proposal = propose_layout(path)
    assert "50 samples share each stamp of column 'Timestamp': state the rate" in proposal.problem
    text, rate = proposal.text, '[columns]\ntime = { rate = "50 Hz" }'
    check(path, text.replace("[columns]", rate))
    stamped = '[columns]\ntime = { column = "Timestamp", unit = "date-time", format = "%m/%d/%Y %I:%M:%S %p" }'
    with pytest.raises(RecordingError, match=r"50 samples share each time stamp(?s:.*)give their rate instead"):
        check(path, text.replace("[columns]", stamped))


@pytest.mark.parametrize("form", ["%H:%M:%S.%f", "%I:%M:%S.%f", "%Y-%m-%d|%H:%M:%S.%f", "%d.%m.%Y|%H:%M:%S.%f"])
def test_times_of_day_across_midnight_and_noon_with_a_date_beside_them(table, form, sheet):
    start = dt.datetime(2026, 3, 2, 12, 59, 52) if "%I" in form else dt.datetime(2026, 3, 2, 23, 59, 52)
    stamps = [stamp.split("|") for stamp in dated(table, form, start)]
    head = [["Date", "Clock"][2 - len(stamps[0]) :] + BRACKETS[1:]]
    text = proposed(sheet(head, [[*stamp, *row[1:]] for stamp, row in zip(stamps, fields(table), strict=True)])).text
    assert ("date = " in text) == ("|" in form)


@pytest.mark.parametrize("style", ["german", "english", "quoted decimals", "blanks"])
def test_signs_of_thousands_and_quoted_decimals(table, style, sheet):
    numbers = table * [1000, 1000, 1, 1000, 1000]
    head = [NAMES, ["ms", "um", "N", "mbar", "mbar"]]
    marks = {"german": ".,", "english": ",.", "quoted decimals": " ,", "blanks": "\u00a0,"}[style]
    grouped = str.maketrans({",": "" if style == "quoted decimals" else marks[0], ".": marks[1]})
    rows = [[f"{v:,.{d}f}".translate(grouped) for v, d in zip(row, (1, 1, 3, 1, 1), strict=True)] for row in numbers]
    if style in ("english", "quoted decimals"):
        rows = [[f'"{text}"' for text in row] for row in rows]
    proposed(sheet(head, rows, sign="," if '"' in rows[0][0] else ";"))


def test_numbers_that_can_be_read_in_two_ways_are_refused(table, sheet):
    numbers = np.column_stack([np.arange(850) * 20 + 1000, 10000 + 1000 * (table[:, 1] - 10)])
    rows = [[f"{v:,.0f}" for v in row] for row in numbers]
    with pytest.raises(RecordingError, match=r"numbers such as \d+,\d+ are ambiguous: the comma may separate"):
        propose_layout(sheet([["Time [ms]", "Position"]], rows, sign=";"))


def test_empty_fields_of_slow_channels(table, sheet):
    rows = [row if at % 10 == 0 else [*row[:3], "", ""] for at, row in enumerate(fields(table))]
    path = sheet([BRACKETS], rows)
    proposed(path)
    assert not any("non_finite" in flags for flags in check(path))
    recording = propose_layout(path).recording
    assert recording is not None
    assert len(recording) == 841  # to the last value of the slow channels


def test_recordings_of_volumes_state_a_guessed_unit(sheet):
    rows = [[f"{0.01 * at:.2f}", f"{6 * np.exp(-at / 200) + 1:.4f}"] for at in range(600)]
    path = sheet([["Time [s]", "Pressure"]], rows)
    proposal = propose_layout(path)
    assert "guessed = true" in proposal.text
    with pytest.warns(PneudriveWarning, match=r"a.csv has the flag unit_guessed \(1\)"):
        read_volume_recordings([path], Layout.loads(proposal.text))


def test_channels_with_columns_of_times_of_their_own(table, sheet):
    late = 40
    rows = [
        [row[0], row[1], row[0], row[3], row[4], f"{t[0] + late / RATE:.3f}" if f else "", f]
        for row, t, f in zip(fields(table), table, [r[2] for r in fields(table)[late:]] + [""] * late, strict=True)
    ]
    head = [["Time [s]", BRACKETS[1], "Time [s]", BRACKETS[3], BRACKETS[4], "Time [s]", BRACKETS[2]]]
    assert "clock = 5" in proposed(sheet(head, rows)).text


def test_a_time_of_twice_the_step_is_another_clock(table, sheet):
    rows = [[row[0], row[1], f"{2 * t[0]:.3f}", *row[2:]] for row, t in zip(fields(table), table, strict=True)]
    path = sheet([["Time [s]", BRACKETS[1], "Time 2 [s]", *BRACKETS[2:]]], rows)
    assert 'clock = "Time 2 [s]"' in propose_layout(path).text


def test_spaces_before_units_do_not_split_the_names_of_a_header(table, tmp_path):
    """Names and units have as many words as there are columns."""
    rows = [" ".join(row) for row in fields(table, (3, 5, 4, 4, 4))]
    (tmp_path / "a.csv").write_text("\n".join(["# t;x (mm);F (N);pA (barg);pB (barg)", *rows]))
    found = {guess.role: guess.column for guess in proposed(tmp_path / "a.csv").guesses}
    assert (found["position"], found["pressure_a"], found["pressure_b"]) == ("x (mm)", "pA (barg)", "pB (barg)")


def test_candidates_of_equal_evidence_are_left_open_and_listed(table, sheet):
    two = np.column_stack([table, table[:, 2] * 0.5 + np.random.default_rng(1).normal(size=len(table))])
    rows = fields(two, (3, 5, 4, 4, 4, 4))
    path = sheet([[*BRACKETS, "Load [N]"]], rows)
    assert "force: more than one column is possible (Force [N], Load [N])" in propose_layout(path).problem
    head = [[*BRACKETS[:3], "P upper [barg]", "P lower [barg]", "P supply [barg]"]]
    three = np.column_stack([table, 1 + table[:, 4]])
    second = sheet(head, fields(three, (3, 5, 4, 4, 4, 4)), "b.csv")
    proposal = propose_layout(second)  # the balance of forces tells the chambers; the supply is another one
    assert {g.role: g.column for g in proposal.guesses}["pressure_a"] == "P upper [barg]"
    assert Layout.loads(proposal.text).for_file(second).channels["pressure_b"].column == "P lower [barg]"


def test_a_workbook_is_named(tmp_path):
    import zipfile

    with zipfile.ZipFile(tmp_path / "a.xlsx", "w") as file:
        file.writestr("xl/workbook.xml", "<workbook/>")
    with pytest.raises(RecordingError, match=r"workbook(?s:.*)as CSV"):
        propose_layout(tmp_path / "a.xlsx")


def test_files_of_random_kinds_together(tmp_path):
    """Files of random kinds are read right, refused, or wrong with a flag (`make` and `judge` take any seed)."""
    verdicts = collections.Counter()
    for seed in range(30):
        path, truth = make(seed, tmp_path)
        verdict, how = judge(path, truth)
        assert verdict in ("right", "refused", "flagged"), (seed, how, truth)
        verdicts[verdict] += 1
    assert verdicts["refused"] < 0.2 * sum(verdicts.values()), verdicts


def test_a_plain_header_below_remarks_is_the_header(table, sheet):
    """Oscilloscopes write remarks behind a comment sign and the names without it; other programs only the names."""
    rows = fields(table)
    remarks = "#Oscilloscope\n#Sample rate: 50Hz, Samples: 850\n\n"
    path = sheet([BRACKETS], rows, before=remarks)
    text = proposed(path).text
    check(path, text.replace("skip_lines = 3\n", ""))
    check(sheet([BRACKETS, NAMES], rows, "b.csv", before="# "), text.replace("skip_lines = 3\n", ""))
    volts = [BRACKETS[0], *(f"Channel {at} (V)" for at in (1, 2, 3, 4))]
    with pytest.raises(RecordingError, match=r"Channel 1 \(V\), .*Channel 4 \(V\) need a role, a unit and a scale"):
        propose_layout(sheet([volts], rows, "c.csv", before=remarks))


def test_minutes_and_seconds_go_on_after_an_hour(table, sheet):
    stamps = [f"{int((3590 + t) % 3600 // 60):02d}:{(3590 + t) % 60:05.2f}" for t in table[:, 0]]
    assert stamps[0] > stamps[-1]
    rows = [[stamp, *row[1:]] for stamp, row in zip(stamps, fields(table), strict=True)]
    assert 'format = "%M:%S.%f"' in proposed(sheet([["Time", *BRACKETS[1:]]], rows)).text


@pytest.mark.parametrize("labelled", [True, False])
def test_signals_of_a_simulink_scope(table, tmp_path, labelled):
    from scipy.io import savemat

    names = ["Position [mm]", "Force [N]", "Pressure A [barg]", "Pressure B [barg]"]
    kinds = [("values", object), ("label", object)]
    signals = np.empty(4, dtype=kinds)
    for at, name in enumerate(names):
        signals[at] = (table[:, at + 1], name if labelled else "")
    savemat(tmp_path / "a.mat", {"ScopeData": {"time": table[:, 0], "signals": signals, "blockName": "rig/Scope"}})
    if labelled:
        proposed(tmp_path / "a.mat")
        return
    channels = zip(
        ("position", "force", "pressure_a", "pressure_b"), ("mm", "N", "bar gauge", "bar gauge"), strict=True
    )
    lines = [f'{c} = {{ column = "ScopeData.signals[{i}].values", unit = "{u}" }}' for i, (c, u) in enumerate(channels)]
    head = 'format = "mat"\n[columns]\ntime = { column = "ScopeData.time", unit = "s" }\n'
    text = "\n".join([head, *lines, '[geometry]\nbore = "25 mm"'])
    check(tmp_path / "a.mat", text)
    with pytest.raises(RecordingError, match=r"there is no column 'ScopeData.signals\(2\)") as refused:
        check(tmp_path / "a.mat", text.replace("signals[1]", "signals(2)"))
    assert "ScopeData.signals[1].values" in str(refused.value)
    assert "delimiter" not in str(refused.value)


def test_lists_of_episodes_in_parquet(table, tmp_path):
    import polars as pl

    half = table[: len(table) // 2]
    twice = {"timestamp": np.tile(half[:, 0], 2), "episode_index": np.repeat([0, 1], len(half))}
    frame = pl.DataFrame({"observation.state": np.tile(half[:, 1:], (2, 1)).tolist(), **twice})
    frame.write_parquet(tmp_path / "a.parquet")
    proposal = propose_layout(tmp_path / "a.parquet")
    assert "observation.state[2]" in proposal.text
    assert 'cycle = { column = "episode_index" }' in proposal.text
    units = {"position": "mm", "force": "N", "pressure_a": "bar gauge", "pressure_b": "bar gauge"}
    lines = [f'{c} = {{ column = "observation.state[{at}]", unit = "{u}" }}' for at, (c, u) in enumerate(units.items())]
    head = ['format = "parquet"', "[columns]", 'time = { column = "timestamp", unit = "s" }']
    text = "\n".join([*head, *lines, "CYCLE", '[geometry]\nbore = "25 mm"'])
    check(tmp_path / "a.parquet", text.replace("CYCLE", 'cycle = { column = "episode_index" }'))
    with pytest.raises(RecordingError, match=r"time runs backwards(?s:.*)cycle = "):
        check(tmp_path / "a.parquet", text.replace("CYCLE", ""))


def test_one_row_for_each_value_and_units_inside_the_cells_are_named(table, sheet):
    rows = [
        [f"TAG1.{name}", row[0], text, "Good"]
        for row in fields(table)
        for name, text in zip("xfab", row[1:], strict=True)
    ]
    with pytest.raises(
        RecordingError, match=r"one row for each value(?s:.*)pivot\(index=\"Timestamp\", columns=\"Tag\""
    ):
        propose_layout(sheet([["Tag", "Timestamp", "Value", "Quality"]], rows))
    units = ("s", "mm", "N", "bar(g)", "bar(g)")
    rows = [[f"{text} {unit}" for text, unit in zip(row, units, strict=True)] for row in fields(table)]
    with pytest.raises(RecordingError, match=r"cells contain units(?s:.*)into the header"):
        propose_layout(sheet([NAMES], rows, "b.csv"))


def test_changed_and_damaged_files_are_read_or_refused(tmp_path):
    """`make trials` runs as many as one likes."""
    counts, failures = trials(range(130, 160), tmp_path)
    assert not failures
    assert counts["right"] > 0.5 * sum(counts.values())


def test_a_header_behind_a_comment_sign_with_another_delimiter(table, tmp_path):
    head = "#time(s),Pos(in),Spd(in/s),LoadCurr(A),MachineForce(lbs),LowerPressure(psia),UpperPressure(psia)"
    psi = 14.503774 * (table[:, 3:] + 1.01325)
    speed = np.gradient(table[:, 1])
    numbers = np.column_stack([table[:, 0], table[:, 1] / 25.4, speed, 0.1 + 0 * speed, table[:, 2] / 4.4482216, psi])
    rows = [" ".join(row) for row in fields(numbers, (3, 5, 3, 1, 4, 4, 4))]
    (tmp_path / "a.exp").write_text("\n".join([head, *rows]))
    proposal = proposed(tmp_path / "a.exp")
    assert {g.role: g.column for g in proposal.guesses}["force"] == "MachineForce(lbs)"
    assert 'header_delimiter = ","' in proposal.text
    assert all("no other candidate" in g.reason or "next: " in g.reason for g in proposal.guesses)


def test_slow_channels_under_headers_that_come_again(table, sheet):
    # An empty unit and a sample of every second line: the headers alone fill the columns of the slow channels.
    head = [[*NAMES, "Status"], ["s", "mm", "N", "barg", "barg", ""]]
    rows = [row if at % 10 == 1 else [*row[:3], "", ""] for at, row in enumerate(fields(table))]
    parts = [line for at in (0, 400) for line in [*head, *([*row, "7"] for row in rows[at : at + 400])]]
    text = propose_layout(sheet(parts, [])).text
    assert '"Pressure A"' in text
    assert "no pressure column" not in text
