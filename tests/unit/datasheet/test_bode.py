"""The frequency response and the steady velocity are two views of one drive: at low frequency they agree.

A valve with overlap is shut at command 0: its response is that of the edge, not that of its leak or none at all.
A slide behind a coupling moves with the piston: a model in which it stands still has no response.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.datasheet.characteristics.steady import velocity_gain
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.describe.files.load import load_described
from pneudrive.errors import CommandError

EXAMPLES = Path(__file__).parents[3] / "examples"
#: All with one piston under proportional valves. Those of the starter and of lines share their code, and are slow.
ONE_PISTON = ("controlled_axis", "cushioned_axis", "axes/bench", "axes/starter", "axes/tubes", "axes/upright")


@pytest.mark.parametrize("name", ONE_PISTON)
def test_both_characteristics_agree_for_every_example(name):
    drive = load_described(str(EXAMPLES / f"{name}.toml"))
    plant = HeldDrive(drive).static
    by_response = float(pn.drive_characteristic(drive, "bode", intervals=False).velocity_gain)
    assert by_response == pytest.approx(velocity_gain(plant, 1.0)[0], rel=0.02)


def overlapped(overlap):
    axis = pn.Circuit.load(EXAMPLES / "controlled_axis.toml")
    tables = axis.to_dict()
    tables["components"]["valve"] |= {"overlap": overlap}
    del tables["components"]["valve"]["leakage"]
    return pn.Circuit.model_validate(tables)


def test_a_shut_valve_is_seen_at_the_edge_of_its_overlap():
    overlap = 0.1
    axis = overlapped(overlap)
    gain = float(pn.drive_characteristic(axis, "bode", intervals=False).velocity_gain)
    # The edge opens from 0 to 1 over the rest of the travel: the slope of the same valve without overlap, steeper.
    open_gain = float(pn.drive_characteristic(overlapped(0.0), "bode", intervals=False).velocity_gain)
    assert gain == pytest.approx(open_gain / (1.0 - overlap), rel=0.02)
    zone = pn.drive_characteristic(axis, "velocity", intervals=False).dead_zone
    assert zone.values == pytest.approx([overlap, overlap], abs=1e-3)
    linear, beyond = pn.linearise(axis, opening="-"), pn.linearise(axis, command=-overlap - 0.01)
    row = linear.state_labels.index("mass_a_kg")
    mass_a, mass_beyond = (np.asarray(one.B)[row, 0] for one in (linear, beyond))
    assert mass_a > 0.0  # more command: less gas out of a
    assert mass_a == pytest.approx(mass_beyond, rel=0.05)


def test_a_command_within_the_overlap_is_refused_with_the_one_that_opens_the_valve():
    with pytest.raises(CommandError, match=r"shut up to a command of 0\.04") as refused:
        pn.linearise(overlapped(0.04), command=-0.03)
    assert "0.09" in str(refused.value.remedy)
    assert refused.value.rule


def test_a_slide_behind_a_coupling_moves_with_the_piston():
    axis = pn.Circuit.load(EXAMPLES / "cushioned_axis.toml")
    gain = float(pn.drive_characteristic(axis, "bode", intervals=False).velocity_gain)
    rest = pn.equilibrium(axis, 0.02, load=0.0)
    start = {f"axis.{side}": f"{getattr(rest, f'pressure_{side}_pa')} Pa abs" for side in "ab"}
    run = axis.simulate(0.02, "4 s", initial={"axis.position": "40 mm", **start}, sample_rate="1 Hz")
    way = float(run["slide.position"][4] - run["slide.position"][1])
    assert gain == pytest.approx(way / 3.0 / 0.02, rel=0.03)
    # Piston and slide swing as one mass: as with the mass of the slide on the rod.
    rigid = axis.to_dict()
    rigid["connections"] = [*(line for line in rigid["connections"] if "slide" not in line), "axis.rod -> load"]
    parts = {key: rigid["components"][key] for key in ("mains", "valve", "axis")}
    rigid["components"] = parts | {"load": {"kind": "load", "mass": "4 kg"}}
    found = [pn.drive_characteristic(one, "natural-frequency") for one in (axis, pn.Circuit.model_validate(rigid))]
    moving, joined = (one.natural_frequency[:12].values for one in found)  # then the absorber stops the slide
    assert moving == pytest.approx(joined, rel=1e-3)


def test_the_panels_are_a_bode_plot_in_decibels_and_its_phase_over_a_logarithmic_axis():
    from pneudrive.report.datasheet import characteristic_panels

    found = pn.drive_characteristic(pn.Drive.load("catalogue:reference"), "bode", intervals=False)
    assert found.velocity_magnitude.attrs["units"] == "dB"
    assert np.allclose(10.0 ** (found.velocity_magnitude / 20.0), found.velocity_response)
    size, phase = characteristic_panels(found)
    assert (size.x.scale, "dB" in size.y.label, "deg" in phase.y.label) == ("log", True, True)
    assert np.allclose(phase.marks[0].y, found.velocity_phase)
    titles = [f"Frequency response: Reference rodless drive, {part}" for part in ("magnitude", "phase")]
    assert [size.title, phase.title] == titles
    drawn = pn.report.plot_characteristic(found).axes[1]
    assert set(np.diff(drawn.get_yticks())) == {45.0}


@pytest.mark.parametrize("viscous", [0.0, 2.0, 20.0, 80.0])
def test_the_table_reaches_the_peak_of_the_resonance_at_any_damping(viscous):
    axis = pn.Circuit.load(EXAMPLES / "controlled_axis.toml")
    tables = axis.to_dict()
    tables["components"]["cylinder"]["friction"]["viscous"] = f"{viscous} N s/m"
    found = pn.drive_characteristic(pn.Circuit.model_validate(tables), "bode", intervals=False)
    near = np.linspace(0.999, 1.001, 4001) * float(found.resonance)
    fine = pn.drive_characteristic(pn.Circuit.model_validate(tables), "bode", intervals=False, frequencies=near)
    peak = float(fine.velocity_magnitude.max())
    assert peak == pytest.approx(float(found.peak), abs=1e-3)
    assert peak == pytest.approx(float(found.velocity_magnitude.max()), abs=0.1)
    # Of a second-order mode: 3 dB below its peak, the frequencies are 2 zeta apart.
    zeta = float(found.damping_ratio)
    sides = float(found.resonance) * np.array([1.0 - zeta, 1.0 + zeta])
    if zeta < 0.02:
        at = pn.drive_characteristic(pn.Circuit.model_validate(tables), "bode", intervals=False, frequencies=sides)
        assert peak - at.velocity_magnitude.values == pytest.approx(3.0, abs=0.2)
