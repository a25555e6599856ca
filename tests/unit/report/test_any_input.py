"""Whatever the recordings hold, there is a report: sections that have no data are left out."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pneudrive.characterise import characterise_recordings, load_recordings
from pneudrive.identify.static.fit import fit_characterisation
from pneudrive.report import write_report
from pneudrive.report.page import Report
from pneudrive.report.speed import verdict
from pneudrive.rig import SimulatedRig, sweep
from pneudrive.signals.load import from_run
from pneudrive.studies.bracha.stick_slip import creep

DATA = Path(__file__).resolve().parents[3] / "data" / "measurements" / "zillen-2021-pneumatic-piston"


def recording():
    return load_recordings([DATA / "friction" / "NAPN_5bar.csv.xz"])[0]


def part_of(whole, stop):
    channels = ("time_s", "position_m", "force_n", "pressure_a_pa", "pressure_b_pa")
    return replace(whole, **{name: getattr(whole, name)[:stop] for name in channels})


def unpressurised(whole):
    return replace(whole, pressure_b_pa=np.full(len(whole), whole.ambient_pressure_pa), accuracy={}, labels={})


INPUTS = {
    "one recording": lambda: [recording()],
    "one stroke": lambda: [part_of(recording(), 700)],
    "no pressure, no labels": lambda: [unpressurised(recording())],
    "both chambers": lambda: sweep(SimulatedRig.default(), [0.01, 0.1], ((1e5, 0.0), (0.0, 1e5), (2e5, 1e5))),
    "one simulated cycle": lambda: [SimulatedRig.default().measure(0.05)],
}


@pytest.mark.parametrize("name", INPUTS)
def test_there_is_a_report(name, tmp_path):
    found = characterise_recordings(INPUTS[name]())
    fits, _ = fit_characterisation(found)
    page = write_report(found, fits, tmp_path).read_text(encoding="utf-8")
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", page, flags=re.DOTALL).lower().split()
    assert 3 <= len(verdict(found, fits, None)) <= 5
    assert ("synthetic" in page.split("</nav>")[0].split("<nav")[1]) == found.synthetic


def test_no_fit_and_no_stick_slip_are_said(tmp_path):
    found = characterise_recordings([recording()])
    page = write_report(found, {}, tmp_path).read_text(encoding="utf-8")
    assert "No law could be fitted" in page
    assert "shows stick-slip. Sampling" in page


def test_stick_slip_of_a_recording_is_measured_and_drawn(tmp_path):
    found = characterise_recordings([from_run(creep("stribeck"))])
    page = write_report(found, {}, tmp_path).read_text(encoding="utf-8")
    assert "1 of 1 stroke stick and slip" in page
    assert (tmp_path / "figures" / "stick-slip-recordings-phase.png").is_file()


def test_text_from_files_cannot_become_markup():
    name = "<script>alert(1)</script>"
    assert name not in Report(name, [name], []).html()


def test_signs_that_turn_a_text_are_shown_and_the_page_runs_nothing():
    name = f"seal {chr(0x202E)}raB 5{chr(0x202C)}{chr(7)}"
    page = Report(name, [name], []).html()
    assert "seal \\u202eraB 5\\u202c\\x07" in page
    assert not set(page) & {chr(0x202E), chr(0x202C), chr(7)}
    policy = page.partition("Content-Security-Policy")[2].partition(">")[0]
    assert "default-src &#39;none&#39;" in policy
    assert "script-src" not in policy
