"""Foreign files at random: every one is read right or asked about, and a damaged one ends in one message.

    python -m trials.foreign_trials --count 10000 --seed 1

Some changes of a file of `foreign_files.make` keep its truth: remarks, empty lines, line ends, further columns,
footers. Others damage it: it is cut off, bytes are exchanged, or lines are lost or doubled. The exit status is 1 if a
file with its truth is read wrongly without a flag. It is also 1 if any file raises an exception that is not of the
package.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from oracle.foreign_files import Truth, judge, make
from trials.shares import options

Lines = list[str]
Rng = np.random.Generator


def _remarks(lines: Lines, rng: Rng) -> Lines:
    return [
        f"# remark {at}: {'bench 3' if at else 'Channel 1: Range: 10 V/div'}" for at in range(rng.integers(1, 9))
    ] + ["", *lines]


def _preamble(lines: Lines, rng: Rng) -> Lines:
    return [*(f"Key {at}: value {rng.integers(100)}" for at in range(rng.integers(1, 12))), *lines]


def _empty_lines(lines: Lines, rng: Rng) -> Lines:
    places = set(rng.integers(0, len(lines), 5).tolist())
    return [text for at, line in enumerate(lines) for text in ([line, ""] if at in places else [line])]


def _blanks(lines: Lines, _: Rng) -> Lines:
    return [f"{line} " for line in lines]


def _footer(lines: Lines, rng: Rng) -> Lines:
    return [*lines, *["", "End of measurement"][rng.integers(2) :]]


def _remark_inside(lines: Lines, rng: Rng) -> Lines:
    at = int(rng.integers(len(lines) // 2, len(lines)))
    return [*lines[:at], "# operator pressed a key", *lines[at:]]


def _last_separator(lines: Lines, _: Rng) -> Lines:
    mark = max(";\t,", key=lines[-1].count)
    return [f"{line}{mark}" if line.count(mark) > 1 else line for line in lines]


#: Changes that keep the truth of a text file.
KEPT: dict[str, Callable[[Lines, Rng], Lines]] = {
    "remarks": _remarks,
    "preamble": _preamble,
    "empty lines": _empty_lines,
    "blanks": _blanks,
    "footer": _footer,
    "remark inside": _remark_inside,
    "last separator": _last_separator,
    "as written": lambda lines, _: lines,
}


def _cut(data: bytes, rng: Rng) -> bytes:
    return data[: int(rng.integers(0, len(data)))]


def _exchanged(data: bytes, rng: Rng) -> bytes:
    out = bytearray(data)
    for at in rng.integers(0, len(out), int(rng.choice([1, 5, 50]))):
        out[at] = rng.integers(256)
    return bytes(out)


def _doubled(data: bytes, rng: Rng) -> bytes:
    begin, end = sorted(int(at) for at in rng.integers(0, len(data), 2))
    return data[:end] + data[begin:]


def _lost(data: bytes, rng: Rng) -> bytes:
    begin = int(rng.integers(0, len(data)))
    return data[:begin] + data[begin + int(rng.choice([1, 20, 2000])) :]


DAMAGES = {"cut": _cut, "exchanged": _exchanged, "doubled": _doubled, "lost": _lost}


def changed(seed: int, folder: Path) -> tuple[Path, Truth, bool]:
    """Write a file of this seed; return it, its truth, and whether it is damaged."""
    path, truth = make(seed, folder)
    rng = np.random.default_rng([seed, 1])
    if rng.random() < 0.25:
        name = str(rng.choice(list(DAMAGES)))
        path.write_bytes(DAMAGES[name](path.read_bytes(), rng))
        truth.kinds.append(f"damage:{name}")
        return path, truth, True
    if path.suffix == ".csv":
        data = path.read_bytes()
        encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "latin-1"
        names = rng.choice(list(KEPT), 2, replace=False).tolist()
        lines = data.decode(encoding).split("\n")
        for name in names:
            lines = KEPT[name](lines, rng)
        end = str(rng.choice(["\n", "\n", "\r\n"]))
        path.write_bytes(end.join(lines).encode(encoding))
        truth.kinds += [f"kept:{name}" for name in names]
    return path, truth, False


def trials(seeds: range, folder: Path) -> tuple[Counter[str], list[str]]:
    """Return the counts of verdicts, and a line for each failure."""
    counts, failures = Counter[str](), []
    for seed in seeds:
        path, truth, is_damaged = changed(seed, folder)
        try:
            verdict, how = judge(path, truth)
        except Exception as error:  # any other exception than the product's is a failure
            verdict, how = "exception", f"{type(error).__name__}: {error}"
        if verdict == "exception" or (verdict == "wrong" and not is_damaged):
            failures.append(f"seed {seed}: {verdict}: {how}; {', '.join(truth.kinds)}")
        counts["damaged, " * is_damaged + verdict] += 1
        path.unlink()
    return counts, failures


def main() -> None:
    """Run trials and print the verdicts."""
    given, begin = options(__doc__, 1000), time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        counts, failures = trials(range(given.seed, given.seed + given.count), Path(folder))
    lines = [*(f"{count:7d} {verdict}" for verdict, count in sorted(counts.items())), *failures]
    sys.stdout.write("\n".join([*lines, f"{time.process_time() - begin:.0f} s of processor", ""]))
    sys.exit(bool(failures))


if __name__ == "__main__":
    main()
