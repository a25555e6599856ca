"""A recording that cannot be used: one clear message each."""

import numpy as np
import pytest

from pneudrive.characterise import Layout, characterise, characterise_recordings
from pneudrive.errors import RecordingError
from pneudrive.signals.proposal import propose_layout

TEXT = """
[columns]
time = { column = 0, unit = "s" }
position = { column = 1, unit = "mm" }
force = { column = 2, unit = "N" }
[geometry]
bore = "25 mm"
[chamber_a]
open_to_ambient = true
[chamber_b]
open_to_ambient = true
"""
LAYOUT = Layout.loads(TEXT)


def table(rows: int = 200) -> list[list[float]]:
    time = np.arange(rows) * 0.1
    position = 20 * np.abs((time / 10) % 2 - 1)
    force = np.sign(np.gradient(position)) * 5
    return np.column_stack([time, position, force]).tolist()


def write(path, rows) -> None:
    path.write_text("\n".join(" ".join(str(v) for v in row) for row in rows))


def test_the_table_itself_is_fine(tmp_path):
    write(tmp_path / "a.csv", table())
    assert characterise(tmp_path / "a.csv", LAYOUT).friction_n.to_numpy() == pytest.approx([5.0, 5.0])


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"", "the file is empty"),
        (b" \n\n", "the file is empty"),
        (bytes(range(256)) * 20, "binary"),
        (b"# only\n# comments\n", "no rows of numbers"),
        (b"1 2\n3 4\n" * 50, r"(?s)there is no column 2.*columns count from 0"),
        (b"a b c\nd e f\n" * 50, r"line 1\n    a b c"),
        (b"0,1;2;3\n" * 50, "there is no column 1"),
        (b"0,5 1 2\n0,6 3 4\n" * 50, '(?s)not contain numbers.*decimal sign than the layout states: decimal = ","'),
        (b"0 1 2\n" * 5, "too few samples"),
        (b"0 1 2\n" * 50, "too few samples|no motion"),
    ],
)
def test_content(tmp_path, content, words):
    (tmp_path / "a.csv").write_bytes(content)
    with pytest.raises(RecordingError, match=words) as caught:
        characterise(tmp_path / "a.csv", LAYOUT)
    assert "a" in str(caught.value)


def test_time_that_runs_backwards(tmp_path):
    rows = table()
    rows[100][0] = 3.0
    write(tmp_path / "a.csv", rows)
    with pytest.raises(RecordingError, match=r"(?s)time runs backwards.*sample 100.*3 s after 9.9 s"):
        characterise(tmp_path / "a.csv", LAYOUT)


def test_a_piston_that_stands_still(tmp_path):
    rows = [[t, 5.0 + 0.001 * (i % 2), f] for i, (t, _, f) in enumerate(table())]
    write(tmp_path / "a.csv", rows)
    with pytest.raises(RecordingError, match="no motion"):
        characterise(tmp_path / "a.csv", LAYOUT)


def test_paths(tmp_path):
    with pytest.raises(RecordingError, match="no such file"):
        characterise(tmp_path / "none.csv", LAYOUT)
    with pytest.raises(RecordingError, match="a folder"):
        characterise_recordings(tmp_path, LAYOUT)
    (tmp_path / "a.csv.xz").write_bytes(b"not xz at all")
    with pytest.raises(RecordingError, match="cannot be decompressed"):
        characterise(tmp_path / "a.csv.xz", LAYOUT)
    (tmp_path / "a.parquet").write_bytes(b"PAR1 and then nothing")
    parquet = Layout.loads('format = "parquet"' + LAYOUT.text)
    with pytest.raises(RecordingError, match="cut off"):
        characterise(tmp_path / "a.parquet", parquet)


def test_a_few_broken_rows_are_counted_and_many_refused(tmp_path):
    rows: list[list] = table()
    rows[50] = ["?", "-", "x"]
    rows[-1] = rows[-1][:2]
    write(tmp_path / "a.csv", rows)
    assert "unreadable_row" in characterise(tmp_path / "a.csv", LAYOUT).flags[0].item()
    for i in range(0, 200, 10):
        rows[i] = ["?", "-", "x"]
    write(tmp_path / "a.csv", rows)
    with pytest.raises(RecordingError, match=r"21 of 200 rows do not contain numbers.*line 1"):
        characterise(tmp_path / "a.csv", LAYOUT)


def test_what_has_no_end_is_refused_before_it_is_read(tmp_path, monkeypatch):
    """A pipe that nobody writes to, a line without an end, a packed file that unpacks to gigabytes."""
    import lzma
    import os

    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(RecordingError, match="a pipe or a device"):
        propose_layout(tmp_path / "pipe.csv")
    (tmp_path / "line.csv").write_bytes(b"1,2," * 500_000)
    with pytest.raises(RecordingError, match="a line is longer than 1,000,000 bytes"):
        propose_layout(tmp_path / "line.csv")
    packer = lzma.LZMACompressor(preset=0)
    (tmp_path / "bomb.csv.xz").write_bytes(packer.compress(b"0" * (1 << 27)) + packer.flush())
    monkeypatch.setenv("PNEUDRIVE_BOUNDS", "unpacked_bytes=1e8")
    with pytest.raises(RecordingError, match="unpacks to"):
        propose_layout(tmp_path / "bomb.csv.xz")


def test_a_header_that_is_not_read_or_not_parted_says_what_to_write(tmp_path):
    (tmp_path / "a.csv").write_text("t,x,F\n" + "\n".join(",".join(map(str, row)) for row in table()))
    text = TEXT.replace("column = 0", 'column = "t"')
    for more, words in (("", "write header = true"), ("header = true\n", 'delimiter = "comma"')):
        with pytest.raises(RecordingError, match="there is no column 't'") as caught:
            characterise(tmp_path / "a.csv", Layout.loads(more + text))
        assert words in str(caught.value.remedy)
