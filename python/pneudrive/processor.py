"""Check that this processor can run the compiled core, before the core is loaded."""

from __future__ import annotations

import os
from pathlib import Path

# Instruction sets of x86-64-v3, for which the core is built (docs/architecture/core.md). Older processors lack some.
NEEDED = ("avx2", "fma", "bmi1", "bmi2", "f16c", "movbe")


def missing(cpuinfo: str) -> list[str]:
    """Return the required instruction sets that are missing in the text of ``/proc/cpuinfo``."""
    lines = (line for line in cpuinfo.splitlines() if line.startswith("flags"))
    flags = next((line.split(":", 1)[1].split() for line in lines), None)
    return [] if flags is None else [name for name in NEEDED if name not in flags]


def require() -> None:
    """Check the processor.

    Raises
    ------
    ImportError
        If the x86-64 processor is too old. Other architectures are not checked.
    """
    info = Path("/proc/cpuinfo")
    if os.name != "posix" or os.uname().machine != "x86_64" or not info.exists():
        return
    with info.open(encoding="ascii", errors="replace") as lines:
        head = "".join(line for line, _ in zip(lines, range(40), strict=False))
    if absent := missing(head):
        msg = (
            f"pneudrive needs an x86-64-v3 processor (2013 or later); this one lacks {', '.join(absent)}.\n"
            "    Build from source: set target-cpu in .cargo/config.toml to your processor, then run `make setup`."
        )
        raise ImportError(msg)
