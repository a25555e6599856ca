"""Files as other programs write them, with a known truth: kinds of times, units, numbers, headers, at random together.

Each file is a recording of a rodless piston of 25 mm bore with constant friction. `make` writes one, `judge` says what
the product made of it. Nothing here uses the product to write a file.
"""

from __future__ import annotations

import datetime as dt
import re
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

AREA = np.pi / 4 * 0.025**2
SIGMA_N = 0.3  # noise of the force
G, A, NONE = "gauge", "abs", ""
#: Unit of pressure -> Pa, and its spellings with and without gauge or absolute.
PRESSURES = {
    "bar": (1e5, {"barg": G, "bar(g)": G, "bar g": G, "bar gauge": G, "bara": A, "bar abs": A, "bar": NONE}),
    "mbar": (1e2, {"mbar": NONE, "mbarg": G}),
    "kPa": (1e3, {"kPag": G, "kPa(a)": A, "kPa": NONE, "kPa abs": A}),
    "MPa": (1e6, {"MPa(G)": G, "MPa": NONE, "MPag": G}),
    "psi": (6894.757293168361, {"psig": G, "psia": A, "PSIG": G, "psi": NONE}),
    "inHg": (3386.3886, {"inHg": NONE}),
    "torr": (133.32237, {"torr": NONE}),
    "kgf/cm2": (98066.5, {"kgf/cm2": NONE, "kgf/cm2(g)": G}),
}
LENGTHS = {"mm": 1e-3, "m": 1.0, "um": 1e-6, "µm": 1e-6, "in": 0.0254, "cm": 1e-2, "inch": 0.0254}
FORCES = {"N": 1.0, "kN": 1e3, "lbf": 4.4482216152605, "kgf": 9.80665, "lbs": 4.4482216152605, "daN": 10.0}
TIMES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "sec": 1.0, "min": 60.0, "µs": 1e-6}
NAMES = {
    "en": ("Time", "Position", "Force", "Pressure A", "Pressure B"),
    "short": ("t", "x", "F", "pA", "pB"),
    "de": ("Zeit", "Weg", "Kraft", "Druck A", "Druck B"),
    "numbered": ("Time", "Pos", "Load", "P1", "P2"),
    "camel": ("TimeStamp", "RigPosition", "LoadCellForce", "ChamberPressureA", "ChamberPressureB"),
    "sides": ("Time", "Stroke", "Force", "Pressure cap side", "Pressure rod side"),
}
MAGIC_DAY = dt.datetime(2026, 3, 2, 9, 18, 17)


@dataclass
class Truth:
    """What a right reading finds."""

    friction_n: float
    speed_m_s: float
    gauge_a_pa: float
    gauge_b_pa: float
    kinds: list[str] = field(default_factory=list)


@dataclass
class Sheet:
    """A table before it is written: rows of texts, with names, units and descriptions."""

    columns: dict[str, list[str]]
    names: dict[str, str]
    units: dict[str, str]


def motion(rng: np.random.Generator) -> tuple[Truth, dict[str, np.ndarray], float]:
    """Return a random truth, its channels in SI (pressures gauge), and the rate."""
    speed = float(rng.choice([0.008, 0.015, 0.03, 0.06, 0.12]))
    travel = float(rng.choice([0.03, 0.04, 0.06]))
    rate = float(np.round(rng.uniform(60, 160) * speed / travel))
    strokes, dwell = 6, 0.2
    corners_t, corners_x = [0.0, dwell], [0.0, 0.0]
    for stroke in range(strokes):
        corners_t += [corners_t[-1] + travel / speed, corners_t[-1] + travel / speed + dwell]
        corners_x += [travel * (stroke % 2 == 0)] * 2
    time = np.arange(int(corners_t[-1] * rate)) / rate
    x = np.interp(time, corners_t, corners_x)
    direction = np.sign(np.gradient(x))
    for i in range(1, direction.size):
        direction[i] = direction[i] or direction[i - 1]
    direction[direction == 0] = 1
    friction, offset = float(rng.uniform(6, 25)), float(rng.uniform(-2, 2))
    a, b = rng.choice([0.0, 1e5, 2e5, 3e5, 4.5e5], 2)
    noise = rng.normal(size=(4, time.size))
    p_a, p_b = a + 150 * noise[0], b + 150 * noise[1]
    away = np.where(direction > 0, x, travel - x)
    force = friction * direction * (1 - 2 * np.exp(-away / 2e-4)) + offset + AREA * (b - a) + SIGMA_N * noise[2]
    channels = {"t": time, "x": 0.01 + x + 2e-6 * noise[3], "f": force, "a": p_a, "b": p_b}
    return Truth(friction, speed, float(a), float(b)), channels, rate


def _digits(values: np.ndarray, count: int = 6) -> list[str]:
    """Write numbers with as many decimals as keep `count` significant digits of the span."""
    span = float(np.ptp(values[np.isfinite(values)])) or 1.0
    decimals = int(np.clip(count - np.ceil(np.log10(span)), 0, 9))
    return [f"{value:.{decimals}f}" for value in values]


def _write_time(rng: np.random.Generator, time: np.ndarray, rate: float, truth: Truth) -> tuple[str, Sheet]:
    """Write the times in one of many ways; return its kind."""
    kind = rng.choice(
        ["unit", "unit", "unit", "offset", "micros", "bare", "epoch", "date", "clock", "midnight", "ampm", "two",
         "index", "none", "stamps", "wrap16", "wrap32"]
    )  # fmt: skip
    sheet = Sheet({}, {}, {})
    start = MAGIC_DAY + dt.timedelta(milliseconds=int(rng.integers(0, 1000)))
    if kind == "midnight":
        start = dt.datetime(2026, 3, 2, 23, 59, 59 - int(min(time[-1] / 2, 50)), 250000)
    stamps = [start + dt.timedelta(microseconds=round(1e6 * t)) for t in time]
    if kind in ("unit", "offset"):
        unit = str(rng.choice(list(TIMES)))
        first = float(rng.uniform(5, 5000)) if kind == "offset" else 0.0
        decimals = {"s": 5, "sec": 5, "ms": 3, "min": 8}.get(unit, 0)
        sheet.columns["t"], sheet.units["t"] = [f"{(t + first) / TIMES[unit]:.{decimals}f}" for t in time], unit
    elif kind == "micros":
        sheet.columns["t"], sheet.names["t"] = (
            [f"{5e6 + 1e6 * t:.0f}" for t in time],
            str(rng.choice(["micros", "micros()"])),
        )
    elif kind in ("bare", "epoch"):
        factor = float(rng.choice([1.0, 1e3] if kind == "epoch" else [1.0, 1e3, 1e6]))
        first = 1.7724e9 if kind == "epoch" else 0.0
        sheet.columns["t"] = [f"{factor * (first + t):.{4 if factor == 1.0 else 0}f}" for t in time]
    elif kind == "date":
        form = rng.choice(
            ["%Y-%m-%dT%H:%M:%S.%f", "%d.%m.%Y %H:%M:%S.%f", "%m/%d/%Y %H:%M:%S.%f", "%Y-%m-%d %H:%M:%S.%f"]
        )
        sheet.columns["t"] = [s.strftime(str(form)) for s in stamps]
    elif kind in ("clock", "midnight"):
        sheet.columns["t"] = [s.strftime("%H:%M:%S.%f")[:-3] for s in stamps]
    elif kind == "ampm":
        sheet.columns["t"] = [s.strftime("%m/%d/%Y %I:%M:%S.%f %p") for s in stamps]
    elif kind == "two":
        late = dt.datetime(2026, 3, 2, 23, 59, 59 - int(min(time[-1] / 2, 50)))
        stamps = [late + dt.timedelta(microseconds=round(1e6 * t)) for t in time]
        sheet.columns = {
            "d": [s.strftime("%Y-%m-%d") for s in stamps],
            "t": [s.strftime("%H:%M:%S.%f") for s in stamps],
        }
        sheet.names["d"] = "Date"
    elif kind == "index":
        sheet.columns["t"] = [str(i) for i in range(time.size)]
        sheet.names["t"] = str(rng.choice(["Sample", "Index", "No", "n"]))
    elif kind == "stamps":
        sheet.columns["t"] = [s.strftime("%Y-%m-%d %H:%M:%S") for s in stamps]
    elif kind in ("wrap16", "wrap32"):
        bits, factor = (16, 1e3) if kind == "wrap16" else (32, 1e6)
        first = 2.0**bits - factor * time[-1] * rng.uniform(0.2, 0.8)
        sheet.columns["t"] = [f"{(first + factor * t) % 2.0**bits:.0f}" for t in np.round(time * factor) / factor]
        sheet.units["t"] = "ms" if bits == 16 else "us"
    truth.kinds.append(f"time:{kind}")
    return str(kind), sheet


def _thousands(text: str, mark: str, decimal: str) -> str:
    """Write a number with a separator of thousands."""
    whole, _, rest = text.partition(".")
    sign, whole = (whole[:1], whole[1:]) if whole[:1] == "-" else ("", whole)
    whole = f"{int(whole):,}".replace(",", mark) if whole.isdigit() else whole
    return f"{sign}{whole}{decimal + rest if rest else ''}"


def _is_plain(text: str) -> bool:
    return re.fullmatch(r"-?\d+(\.\d+)?", text) is not None


def make(seed: int, folder: Path) -> tuple[Path, Truth]:
    """Write a random file; return it with its truth."""
    rng = np.random.default_rng(seed)
    truth, channels, rate = motion(rng)
    kind = rng.choice(["text", "text", "text", "text", "text", "text", "text", "lvm", "tdms"])
    if kind == "tdms":
        return _tdms(rng, folder / f"{seed}.tdms", truth, channels, rate)
    if kind == "lvm":
        return _lvm(rng, folder / f"{seed}.lvm", truth, channels, rate)
    return _text(rng, folder / f"{seed}.csv", truth, channels, rate)


def _units(
    rng: np.random.Generator, truth: Truth, channels: dict[str, np.ndarray]
) -> tuple[dict[str, np.ndarray], dict[str, str]]:
    """Return the channels in random units, and the units as a header writes them."""
    length, force = str(rng.choice(list(LENGTHS))), str(rng.choice(list(FORCES)))
    family = str(rng.choice(list(PRESSURES)))
    pascal, spellings = PRESSURES[family]
    pressure = str(rng.choice(list(spellings)))
    shift = 101325.0 if spellings[pressure] == A else 0.0
    sign = float(rng.choice([1.0, 1.0, -1.0]))
    numbers = {
        "x": channels["x"] / LENGTHS[length],
        "f": sign * channels["f"] / FORCES[force],
        "a": (channels["a"] + shift) / pascal,
        "b": (channels["b"] + shift) / pascal,
    }
    truth.kinds += [f"pressure:{pressure}", f"length:{length}", f"force:{force}"]
    return numbers, {"x": length, "f": force, "a": pressure, "b": pressure}


def _text(
    rng: np.random.Generator, path: Path, truth: Truth, channels: dict[str, np.ndarray], rate: float
) -> tuple[Path, Truth]:
    time_kind, sheet = _write_time(rng, channels["t"], rate, truth)
    numbers, units = _units(rng, truth, channels)
    language = str(rng.choice(list(NAMES)))
    count = len(channels["t"])
    names = dict(zip("txfab", NAMES[language], strict=True)) | sheet.names
    columns = sheet.columns | {key: _digits(values) for key, values in numbers.items()}
    units |= sheet.units
    truth.kinds.append(f"names:{language}")
    if rng.random() < 0.15:  # a 16-bit counter of micrometres
        start = int(rng.integers(0, 2**16))
        columns["x"] = [f"{(start + round(1e6 * x)) % 2**16}" for x in channels["x"]]
        units["x"] = "um"
        truth.kinds.append("counter16")
    slow = rng.random() < 0.2
    if slow:
        every = int(rng.choice([3, 5, 10]))
        for key in "ab":
            columns[key] = [text if i % every == 0 else "" for i, text in enumerate(columns[key])]
        truth.kinds.append("slow")
    extras = {
        "temp": ("Temperature", "degC", _digits(22 + 0.01 * np.arange(count) / count, 3)),
        "set": ("Position setpoint", "mm", _digits(1e3 * np.round(channels["x"], 3), 4)),
        "state": ("Status", "", [str(1113)] * count),
        "note": ("Comment", "", ["ok"] * count),
        "supply": ("Supply pressure", units["a"], _digits(np.full(count, 7.0) + 0.001 * rng.normal(size=count), 3)),
        "speed": ("Speed", "mm/s", _digits(1e3 * np.gradient(channels["x"]) * rate, 4)),
        "amps": ("LoadCurr", "A", _digits(0.1 + 0.01 * rng.normal(size=count), 3)),
    }
    for key in rng.choice(list(extras), int(rng.integers(0, 3)), replace=False):
        names[key], units[key], columns[key] = extras[key]
        truth.kinds.append(f"extra:{key}")
    order = [key for key in columns if key not in ("d", "t")]
    if rng.random() < 0.3:
        rng.shuffle(order)
    order = [key for key in ("d", "t") if key in columns] + order
    if time_kind == "none":
        truth.kinds.append("no time")
    lines = _lines(rng, truth, {key: columns[key] for key in order}, names, units, rate, time_kind)
    encoding = str(rng.choice(["utf-8", "utf-8", "latin-1", "utf-8-sig", "utf-16"]))
    path.write_bytes("\n".join(lines).encode(encoding))
    return path, truth


def _lines(
    rng: np.random.Generator,
    truth: Truth,
    columns: dict[str, list[str]],
    names: dict[str, str],
    units: dict[str, str],
    rate: float,
    time_kind: str,
) -> list[str]:
    """Write numbers, header and preamble in one style."""
    sign = str(rng.choice([";", ",", "\t", "  "]))
    texts = [text for column in columns.values() for text in column[:3]]
    sign = ";" if sign == "  " and not all(map(_is_plain, texts)) else sign  # texts and empty fields
    quoted = sign == "," and rng.random() < 0.3
    decimal = str(rng.choice([".", ","])) if sign in (";", "\t") or quoted else "."
    thousands = None
    if (sign == ";" or quoted) and rng.random() < 0.35:
        thousands = {".": ",", ",": "."}[decimal]

    def quote(text: str) -> str:
        return f'"{text}"' if quoted else text

    def number(text: str) -> str:
        if not _is_plain(text):
            return text
        return _thousands(text, thousands, decimal) if thousands else text.replace(".", decimal)

    rows = [sign.join(quote(number(text)) for text in fields) for fields in zip(*columns.values(), strict=True)]
    styles = ["brackets", "brackets", "parens", "row", "row", "row brackets", "three", "underscore", "comment", "bare"]
    style = str(rng.choice(styles))
    label = [names.get(key, key) for key in columns]
    unit = [units.get(key, "") for key in columns]
    header = [[quote(text) for text in row] for row in _header(style, label, unit, list(columns), sign)]
    header_sign = str(rng.choice([",", ";"])) if style == "comment" and sign == "  " else sign
    head = [header_sign.join(row) for row in header]
    truth.kinds += [f"style:{style}", f"delimiter:{sign}", f"decimal:{decimal}", f"thousands:{thousands}"]
    truth.kinds += ["quoted"] * quoted
    preamble = ["Test bench 3", "Operator: NN", ""] if rng.random() < 0.3 else []
    if time_kind in ("index", "none") and rng.random() < 0.6:
        preamble.append(f"Sample rate: {rate:g} Hz")
        truth.kinds.append("rate stated")
    if not head or rng.random() > 0.1:
        return [*preamble, *head, *rows]
    truth.kinds.append("segments")
    every = max(len(rows) // 4, 50)
    return [*preamble, *(line for at in range(0, len(rows), every) for line in [*head, *rows[at : at + every]])]


def _header(style: str, label: list[str], unit: list[str], keys: list[str], sign: str) -> list[list[str]]:
    """Return the rows of a header; where blanks separate columns, a field holds none."""
    forms = {"brackets": "{} [{}]", "parens": "{} ({})", "comment": "{} ({})", "underscore": "{}_{}"}
    head = [forms[style].format(n, u) if u and style in forms else n for n, u in zip(label, unit, strict=True)]
    if sign == "  " and style != "comment":
        head = [text.replace(" ", "_") for text in head]
        unit = [text.replace(" ", "") or "-" for text in unit]
    if style == "comment":
        head[0] = f"#{head[0]}"
    below = {
        "row": [unit],
        "row brackets": [[f"[{text}]" if text else "-" for text in unit]],
        "three": [unit, [f"sensor-{key}" for key in keys]],
    }
    return [] if style == "bare" else [head, *below.get(style, [])]


def _lvm(
    rng: np.random.Generator, path: Path, truth: Truth, channels: dict[str, np.ndarray], rate: float
) -> tuple[Path, Truth]:
    """Write a file as LabVIEW does: with one column of times, none, or one for each channel; in segments."""
    times = str(rng.choice(["One", "No", "Multi", "late"]))
    decimal = str(rng.choice([".", ","]))
    truth.kinds += [f"lvm:{times}"]
    labels, unit = ("Position", "Force", "Pressure A", "Pressure B"), ("mm", "N", "bar", "bar")
    step = 1.0 / rate
    data = [1e3 * channels["x"], channels["f"], channels["a"] / 1e5, channels["b"] / 1e5]
    starts = [0.0] * 4
    if times in ("late", "Multi"):
        rows = int(rng.integers(5, int(max(rate, 10))))
        starts[1] = rows * step
        data[1] = np.r_[data[1][rows:], np.full(rows, np.nan)]
    count = data[0].size

    def write(value: float) -> str:
        return "" if not np.isfinite(value) else f"{value:.6f}".replace(".", decimal)

    columns, names = [], []
    multi = times == "Multi"
    if not multi:
        columns.append([write(i * step) if times == "One" else "" for i in range(count)])
        names.append("X_Value")
    for label, start, values in zip(labels, starts, data, strict=True):
        if multi:
            columns.append([write(start + i * step) for i in range(count)])
            names.append("X_Value")
        columns.append([write(v) for v in values])
        names.append(label)
    width = len(columns)

    def cells(texts: list[str]) -> list[str]:
        return [text for one in texts for text in (["", one] if multi else [one])][1 if multi else 0 :]

    head = ["LabVIEW Measurement", "Writer_Version\t2", "Separator\tTab", f"Decimal_Separator\t{decimal}",
            f"X_Columns\t{'No' if times == 'late' else times}", "***End_of_Header***", ""]  # fmt: skip
    block = [["Channels", "4"], ["Samples", *cells([str(count)] * 4)], ["Y_Unit_Label", *cells(list(unit))],
             ["X_Dimension", *cells(["Time"] * 4)], ["X0", *cells([write(s) for s in starts])],
             ["Delta_X", *cells([write(step)] * 4)]]  # fmt: skip
    block_lines = ["\t".join(row) for row in block] + ["***End_of_Header***", "\t".join([*names, "Comment"])]
    rows_text = ["\t".join(row) for row in zip(*columns, strict=True)]
    if times == "One" and rng.random() < 0.4:
        truth.kinds.append("segments")
        body = [line for at in range(0, count, 200) for line in [*block_lines, *rows_text[at : at + 200], ""]]
    else:
        body = [*block_lines, *rows_text]
    assert width >= 5 - (not multi)
    path.write_text("\n".join([*head, *body]), encoding="utf-8")
    return path, truth


def _tdms(
    rng: np.random.Generator, path: Path, truth: Truth, channels: dict[str, np.ndarray], rate: float
) -> tuple[Path, Truth]:
    """Write waveforms that start at different times, or have rates of their own."""
    from nptdms import ChannelObject, TdmsWriter

    kind = str(rng.choice(["together", "late", "slow", "no start", "some starts", "no step"]))
    truth.kinds += [f"tdms:{kind}"]
    numbers, units = _units(rng, truth, channels)
    start = np.datetime64("2026-03-02T09:18:17.000000", "us")
    objects = []
    for key, label in zip("xfab", ("Position", "Force", "Pressure A", "Pressure B"), strict=True):
        values, step, begin = numbers[key], 1.0 / rate, start
        if kind == "late" and key == "f":
            rows = int(rng.integers(5, int(max(2 * rate, 10))))
            values, begin = values[rows:], start + np.timedelta64(round(1e6 * rows / rate), "us")
        if kind == "slow" and key in "ab":
            values, step = values[::5], 5.0 / rate
        properties = {
            "unit_string": units[key],
            "wf_increment": step,
            "wf_start_offset": 0.0,
            "wf_samples": values.size,
        }
        if kind != "no start" and not (kind == "some starts" and key == "f"):
            properties["wf_start_time"] = begin
        if kind == "no step":
            properties = {"unit_string": units[key]}
        objects.append(ChannelObject("rig", label, values, properties=properties))
    with TdmsWriter(path) as writer:
        writer.write_segment(objects)
    return path, truth


#: Flags that tell of a doubt about how the file was read.
DOUBTS = {
    *("unit_guessed", "counter_wrap", "position_jump", "non_finite", "repeated_time", "unreadable_row", "spike"),
    *("saturated", "gap", "below_ambient", "beyond_usual", "force_not_pressure", "friction_beyond_piston"),
    *("no_friction", "negative_friction", "unpaired", "stuck"),
}


def judge(path: Path, truth: Truth) -> tuple[str, str]:
    """Return what the product makes of a file: ``right``, ``refused``, ``flagged`` or ``wrong``, and how.

    Any exception but the product's own ones passes.
    """
    from pneudrive.characterise import Layout, characterise_recordings
    from pneudrive.errors import PneudriveError
    from pneudrive.signals.proposal import propose_layout

    try:
        proposal = propose_layout(path)
        if proposal.problem:
            return "refused", proposal.problem
        found = characterise_recordings([path], Layout.loads(proposal.text)).friction_map
    except PneudriveError as error:
        return "refused", str(error)
    wrong = []
    for row in range(found.sizes["row"]):
        friction, speed = float(found.friction_n[row]), abs(float(found.velocity_m_s[row]))
        difference = float(found.pressure_b_pa[row] - found.pressure_a_pa[row])
        if abs(friction - truth.friction_n) > max(0.03 * truth.friction_n, 0.3):
            wrong.append(f"friction {friction:.3g} for {truth.friction_n:.3g} N")
        if abs(speed - truth.speed_m_s) > 0.03 * truth.speed_m_s:
            wrong.append(f"speed {speed:.3g} for {truth.speed_m_s:.3g} m/s")
        if abs(difference - (truth.gauge_b_pa - truth.gauge_a_pa)) > 3e3:
            wrong.append(f"pressures {difference:.4g} for {truth.gauge_b_pa - truth.gauge_a_pa:.4g} Pa")
    if not wrong:
        return "right", ""
    flags = {flag for text in found.flags.values.tolist() for flag in text.split(",")}
    return ("flagged" if flags & DOUBTS else "wrong"), "; ".join(wrong)
