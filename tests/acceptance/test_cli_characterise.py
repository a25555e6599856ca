"""`pneudrive characterise` and `pneudrive layout` from end to end, and what they say to wrong input."""

import lzma
from pathlib import Path

import pytest

import pneudrive as pn
from oracle.campaigns import World, write_campaign
from pneudrive.characterise import read_map
from pneudrive.cli.main import run
from pneudrive.errors import RecordingError
from pneudrive.signals.load import recordings_in

DATA = Path(__file__).resolve().parents[2] / "data" / "measurements" / "zillen-2021-pneumatic-piston"


def test_a_folder_of_recordings_is_all_files_that_its_layout_describes(tmp_path, capsys):
    folder = tmp_path / "bench"
    folder.mkdir()
    (folder / "layout.toml").write_text((DATA / "layout.toml").read_text())
    (folder / "notes.md").write_text("two seals")
    for name in ("PK_1bar", "NAPN_1bar"):
        (folder / f"{name}.csv.xz").write_bytes((DATA / "friction" / f"{name}.csv.xz").read_bytes())
    for name in ("layout.png", "photo.JPG", "sheet.pdf"):
        (folder / name).write_bytes(b"\x89PNG\0")
    assert run(["characterise", str(folder), "--out", str(folder)]) == 0
    assert read_map(folder / "map.csv")["seal"].to_numpy().tolist() == ["NAPN", "NAPN", "PK", "PK"]
    said = capsys.readouterr().out
    for name in ("map.parquet", "map.csv", "effects.toml", "fit-NAPN.toml", "fit-PK.toml", "report.html"):
        assert (folder / name).stat().st_size > 500, name
        assert name in said
    assert "PK_1bar" in said
    assert 'file = "map.parquet"' in (folder / "fit-PK.toml").read_text()
    # Results beside the recordings are no recordings of the next call.
    assert [file.name for file in recordings_in(folder)] == ["NAPN_1bar.csv.xz", "PK_1bar.csv.xz"]


def test_a_foreign_recording_by_way_of_a_proposed_layout(tmp_path, capsys):
    foreign = tmp_path / "bench.txt"
    foreign.write_bytes(lzma.decompress((DATA / "friction" / "NAPN_3bar.csv.xz").read_bytes()))
    layout = tmp_path / "bench.toml"
    assert run(["layout", str(foreign), "--out", str(layout)]) == 0
    assert layout.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    assert "guess" in layout.read_text()
    assert run(["characterise", str(foreign), "--layout", str(layout), "--out", str(tmp_path / "out")]) == 0
    friction = read_map(tmp_path / "out" / "map.parquet").friction_n.to_numpy()
    assert friction == pytest.approx(6.93, abs=0.15)
    capsys.readouterr()


def test_a_campaign_becomes_curves_effects_fit_and_report(tmp_path, printed):
    folder = write_campaign(tmp_path / "campaign", World(samples=300, gauges_pa=((0.0, 0.0), (1e5, 1e5))), 1)
    out = tmp_path / "out"
    said = printed(["characterise", folder, "--out", out])
    for name in ("map.parquet", "map.csv", "curves.parquet", "effects.toml", "fit.toml", "report.html"):
        assert (out / name).stat().st_size > 500, name
        assert name in said
    with pytest.raises(RecordingError, match=r"not a friction map.*lacks recording"):
        pn.load(out / "curves.parquet")
    assert "! Both" in said or "cannot be determined" in said  # equal pressures tell the sum only
    assert "Remedy:" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["empty"], "this is not a campaign folder"),
        (["campaign", "empty"], "a campaign cannot be characterised together with other files"),
        (["campaign", "--layout", "layout.toml"], "a campaign cannot be characterised together with other files"),
    ],
)
def test_what_is_no_campaign_is_one_message_and_status_2(tmp_path, refusal, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    write_campaign("campaign", World(samples=100, repeats=1), 1)
    refusal(["characterise", *arguments], words)
    assert not Path("characterisation").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["none.csv"], "no such file"),
        (["empty_1bar.cvs", "--layout", "layout.toml"], "Did you mean empty_1bar.csv?"),
        (["layout.toml", "--layout", "layout.toml"], 'a file of the kind "layout", not a recording'),
        (["empty_1bar.csv", "--layout", "layout.toml"], "the file is empty"),
        (["binary_1bar.csv", "--layout", "layout.toml"], "binary"),
        (["empty_1bar.csv", "--layout", "bad.toml"], "bad.toml:1"),
        (["empty_1bar.csv"], "there is no layout for this file"),
        (["empty_1bar.csv", "--layout", "layout.toml", "--out", "binary_1bar.csv"], "cannot be written to"),
    ],
)
def test_wrong_input_is_one_message_and_status_2(tmp_path, refusal, monkeypatch, arguments, words):
    monkeypatch.chdir(tmp_path)
    Path("empty_1bar.csv").touch()
    Path("binary_1bar.csv").write_bytes(bytes(range(256)) * 8)
    Path("layout.toml").write_text((DATA / "layout.toml").read_text())
    if "--layout" not in arguments:
        Path("layout.toml").unlink()
    Path("bad.toml").write_text("channels = 3\n")
    refusal(["characterise", *arguments], words)
    assert not Path("characterisation").exists(), "nothing is left behind"


def test_a_file_without_a_table_has_no_layout(tmp_path, refusal):
    (tmp_path / "a.txt").write_text("no numbers here\n" * 30)
    refusal(["layout", tmp_path / "a.txt"], "no table of numbers")
