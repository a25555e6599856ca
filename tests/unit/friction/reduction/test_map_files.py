"""The friction map: exactly the contract's columns, the same numbers back from its files."""

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.characterise import characterise, read_map, write_map
from pneudrive.errors import CommandError, RecordingError

CONTRACT = [
    *(
        "recording",
        "direction",
        "velocity_m_s",
        "pressure_a_pa",
        "pressure_b_pa",
        "balance_n",
        "friction_n",
        "offset_n",
    ),
    *("stderr_n", "u_systematic_n", "samples", "strokes", "strokes_recorded", "position_from_m", "position_to_m"),
    *("breakaway_n", "dwell_s", "loading_rate_n_s", "flags", "ambient_pressure_pa"),
]


def test_dataset_has_the_contract_s_variables_with_units(make):
    assert characterise is pn.characterise  # one function, also for the folder of a campaign
    curves = characterise([make(), make(name="b", seed=2)])
    assert list(curves.data_vars) == CONTRACT
    assert dict(curves.sizes) == {"row": 4}
    assert all("units" in curves[name].attrs for name in CONTRACT)
    assert curves.friction_n.attrs["units"] == "N"
    assert curves.attrs["ambient_pressure_pa"] == 101325.0


@pytest.mark.parametrize("suffix", [".parquet", ".csv"])
def test_files_hold_the_same_columns_and_numbers(make, tmp_path, suffix):
    import polars as pl

    curves = characterise([make(), make(name="7,5 bar", strokes=1)])  # NaN, empty flags and a comma in a name
    path = write_map(curves, tmp_path / f"map{suffix}")
    frame = pl.read_parquet(path) if suffix == ".parquet" else pl.read_csv(path)
    assert frame.columns == CONTRACT
    again = read_map(path)
    for name in CONTRACT:
        if curves[name].dtype == object:
            assert again[name].to_numpy().tolist() == curves[name].to_numpy().tolist()
        else:
            np.testing.assert_array_equal(again[name].to_numpy(), curves[name].to_numpy())
    assert again.attrs["ambient_pressure_pa"] == curves.attrs["ambient_pressure_pa"]
    assert not list(tmp_path.glob(".*"))


def test_a_map_of_earlier_versions_lacks_some_columns(make, tmp_path):
    old = characterise(make()).drop_vars(["ambient_pressure_pa", "strokes_recorded"])
    again = read_map(write_map(old, tmp_path / "map.parquet"))
    assert "ambient_pressure_pa" not in again.attrs
    assert "strokes_recorded" not in again


def test_what_cannot_be_written_or_read(make, tmp_path):
    curves = characterise(make())
    with pytest.raises(CommandError, match=r"'\.xlsx' cannot be written"):
        write_map(curves, tmp_path / "map.xlsx")
    with pytest.raises(CommandError, match="does not exist"):
        write_map(curves, tmp_path / "none" / "map.csv")
    (tmp_path / "a.csv").write_text("recording,direction\nx,1\n")
    with pytest.raises(RecordingError, match="lacks velocity_m_s"):
        read_map(tmp_path / "a.csv")
    with pytest.raises(RecordingError, match="there is no such file"):
        read_map(tmp_path / "none.parquet")


def test_the_map_keeps_every_label_so_that_a_fit_can_ask_for_it(make, tmp_path, capsys):
    from pneudrive.cli.main import run
    from pneudrive.identify import FrictionFit

    recordings = [
        make(name=f"{seal}{number}", friction=friction, seed=number, labels={"seal": seal, "run": f"0{number}"})
        for seal, friction in (("lip", 5.0), ("cup", 9.0))
        for number in (1, 2)
    ]
    path = write_map(characterise(recordings), tmp_path / "map.parquet")
    again = read_map(path)
    assert again["seal"].to_numpy().tolist() == [*["lip"] * 4, *["cup"] * 4]
    assert again["run"].to_numpy().tolist() == ["01", "01", "02", "02"] * 2
    fit = ["fit", str(path), "--laws", "coulomb", "--pressure", "none", "--out", str(tmp_path / "fit.toml")]
    assert run(fit) == 0
    said = capsys.readouterr().out
    warning = "the map has 2 values of seal (cup, lip) and the fit averages over them; --by seal fits each"
    assert warning in said
    assert said.startswith("! the map has")  # before the fit, not after it
    assert "2 values of run" in said
    assert run([*fit, "--by", "seal"]) == 0
    assert "values of seal" not in capsys.readouterr().out
    levels = [FrictionFit.from_toml(tmp_path / f"fit-{seal}.toml").parameters["coulomb"] for seal in ("lip", "cup")]
    assert levels == pytest.approx([5.0, 9.0], abs=0.05)
