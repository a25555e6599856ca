"""Source code in an FMU, and the library that this machine's compiler builds from it."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.fmu.description import build_description, compiled_files

if TYPE_CHECKING:
    from pneudrive.fmu.variables import FmuPlan

_HERE = Path(__file__).parent / "sources"
#: File that checks a compiled copy, for people and not for compilers.
_CHECK = "conformance.txt"
#: Options by which a compiler keeps the bits of the core.
_OPTIONS = ("-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-shared")


def source_entries(plan: FmuPlan, version: str, place: str) -> list[tuple[str, bytes]]:
    """Return names and contents of the files of a controller in C.

    Parameters
    ----------
    plan : FmuPlan
        With source code.
    version : str
        ``"2.0"`` or ``"3.0"``.
    place : str
        Name of the library in the archive. Without a C compiler there is none, and a tool compiles the code.
    """
    code = plan.code
    assert code is not None, "a plan with source code"
    files = {name: text.encode() for name, text in code.files}
    check = files.pop(_CHECK)
    files["variables.h"] = _variables(plan).encode()
    files |= {name: (_HERE / name).read_bytes() for name in ("instance.h", f"fmi{version[0]}.c")}
    library = _compiled(files, compiled_files(code, version))
    if version != "2.0":
        files["buildDescription.xml"] = build_description(code)
    entries = [(f"sources/{name}", content) for name, content in files.items()]
    entries.append((f"resources/{_CHECK}", check))
    return entries + ([] if library is None else [(place, library)])


def _variables(plan: FmuPlan) -> str:
    """Return the header that names the variables of the model for the interface."""
    assert plan.code is not None
    name = plan.code.identifier
    counts = {kind: sum(one.causality == kind for one in plan.variables) for kind in ("input", "parameter", "output")}
    types = "".join(f"typedef {name}_{own} model_{own};\n" for own in ("input", "parameters", "output", "memory"))
    numbers = "".join(f"#define MODEL_{kind.upper()}S {count}\n" for kind, count in counts.items())
    return (
        f'/* Names of the controller {name} for its interface. */\n#include "{name}.h"\n\n{types}'
        f"{numbers}#define MODEL_STEP {name}_step\n#define MODEL_TUNED {name}_tuned\n"
        f'#define MODEL_PERIOD {plan.code.period_s!r}\n#define MODEL_TOKEN "{plan.token}"\n'
    )


def _compiled(files: dict[str, bytes], sources: tuple[str, ...]) -> bytes | None:
    """Return the library, or None without a C compiler."""
    compiler = shutil.which(os.environ.get("CC", "cc"))
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            (Path(folder) / name).write_bytes(content)
        command = [compiler, *_OPTIONS, *sources, "-o", "library", "-lm"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode:
            message = done.stderr.strip().splitlines()
            raise CommandError("the C compiler rejects the code", where=compiler, value=message[0] if message else "")
        return (Path(folder) / "library").read_bytes()
