"""Work in advance: the results keep their order, and threads never run far ahead of who takes them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from pneudrive import processor
from pneudrive.batching import in_advance


def test_results_come_in_turn_and_little_is_done_that_nobody_takes():
    started = []
    found = in_advance(lambda n: started.append(n) or n * n, range(100), 2)
    taken = [next(found) for _ in range(10)]
    assert taken == [n * n for n in range(10)]
    found.close()
    assert 10 <= len(started) <= 10 + 5


def test_what_is_raised_reaches_who_takes_it():
    found = in_advance(lambda n: 1 // n, [1, 1, 0, 1], 2)
    assert [next(found), next(found)] == [1, 1]
    with pytest.raises(ZeroDivisionError):
        next(found)


# --- An old processor gets one message instead of a crash in the middle of a run.


def test_an_old_processor_is_named_by_what_it_lacks() -> None:
    """An x86-64-v2 processor lacks the fused multiply-add on which the core is built."""
    assert processor.missing("flags\t\t: fpu sse4_2 avx movbe f16c bmi1 bmi2\n") == ["avx2", "fma"]


def test_a_new_one_and_an_unknown_one_pass() -> None:
    """A list that names all passes; a system without a list is not judged."""
    assert processor.missing("flags : avx2 fma bmi1 bmi2 f16c movbe\n") == []
    assert processor.missing("BogoMIPS : 50\n") == []


def test_the_message_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """Import ends in one ImportError with the remedy."""
    if not Path("/proc/cpuinfo").exists():
        pytest.skip("no list of processor flags on this system")
    monkeypatch.setattr(processor, "NEEDED", ("no-such-instruction",))
    with pytest.raises(ImportError, match=r"no-such-instruction(?s:.*)make setup"):
        processor.require()


# --- Every source key that the product uses resolves in references.bib, and every entry there is usable.
#
# Keys stand in Rust as ``Source: [key].`` in a doc comment or ``source: "key"`` in a table, in the documentation as
# ``{cite}`` roles, in the data as ``source = "key"``.

ROOT = Path(__file__).resolve().parent.parent.parent
BIB = (ROOT / "references.bib").read_text()
ENTRIES = re.findall(r"^@(\w+)\{([^,\s]+),(.*?)^\}", BIB, re.M | re.S)
KEYS = {key for _, key, _ in ENTRIES}
ASSUMED = "assumed"  # said where the user sees it; no source


def rust_uses(text: str) -> set[str]:
    """Return the keys in doc comments, from 'Source:' to the end of the comment's paragraph, and in tables."""
    found = set(re.findall(r'\bsource: "([^"]*)"', text))
    for paragraph in re.findall(r"Source:(?!:)((?:[^\n]*\n\s*//[/!] ?)*[^\n]*)", text):
        found.update(re.findall(r"\[([A-Za-z0-9.+_-]+)\]", paragraph.split("\n\n")[0]))
    return found


def markdown_uses(text: str) -> set[str]:
    """Return the keys in cite roles."""
    return {key.strip() for role in re.findall(r"\{cite(?::\w+)?\}`([^`]+)`", text) for key in role.split(",")}


def toml_uses(text: str) -> set[str]:
    """Return the keys of values."""
    return set(re.findall(r'\bsource\s*=\s*"([^"]*)"', text))


def used() -> list[tuple[str, str]]:
    """Return (key, file) for all uses."""
    places = (("crates", "*.rs", rust_uses), ("docs", "*.md", markdown_uses), ("data/catalogue", "*.toml", toml_uses))
    found: set[tuple[str, str]] = set()
    for folder, pattern, uses in places:
        for path in (ROOT / folder).rglob(pattern):
            if "_build" not in path.parts:
                found |= {(key, str(path.relative_to(ROOT))) for key in uses(path.read_text()) if key != ASSUMED}
    return sorted(found)


def test_source_keys_resolve():
    found = used()
    assert [(file, key) for key, file in found if key not in KEYS] == []
    # The search itself finds what is known to be there, so that an empty list cannot pass for success.
    assert {"canudas1995", "armstrong1994", "iso6358-2013", "steinebach2023", "bracha", "gum2008"} <= dict(found).keys()
