"""An old processor gets one message instead of a crash in the middle of a run."""

from __future__ import annotations

from pathlib import Path

import pytest

from pneudrive import processor


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
