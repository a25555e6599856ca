"""The library that every FMU and every C program of a drive carries."""

from __future__ import annotations

import ctypes
import lzma
import sys
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

from pneudrive.errors import CommandError, DescriptionError

#: Platform -> suffix of a library, folder of FMI 2.0, folder of FMI 3.0.
PLATFORMS = {
    "linux": (".so", "linux64", "x86_64-linux"),
    "darwin": (".dylib", "darwin64", "x86_64-darwin"),
    "win32": (".dll", "win64", "x86_64-windows"),
}
_OK = 0


def binary_name() -> str:
    """Return the file name that the library has on this platform."""
    return f"libpneudrive{PLATFORMS.get(sys.platform, PLATFORMS['linux'])[0]}"


@lru_cache(maxsize=1)
def binary_bytes() -> bytes:
    """Return the library: in a copy of the source as it was built, in a wheel packed by xz.

    Raises
    ------
    CommandError
        This installation lacks it.
    """
    built = Path(__file__).with_name(binary_name())
    packed = built.with_name(f"{built.name}.xz")
    if built.is_file():
        return built.read_bytes()
    if packed.is_file():
        return lzma.decompress(packed.read_bytes())
    raise CommandError(
        "this installation of pneudrive lacks the library for FMUs and C",
        where=str(built),
        remedy="Install a wheel of pneudrive; or, in a copy of its source, run `make setup`.",
    )


@lru_cache(maxsize=1)
def load_library() -> ctypes.CDLL:
    """Return the library, loaded into this process.

    Raises
    ------
    CommandError
        This installation lacks it, or the folder for temporary files does not let it run.
    """
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:  # Windows keeps a loaded file
        file = Path(folder) / binary_name()
        file.write_bytes(binary_bytes())
        try:
            library = ctypes.CDLL(str(file))
        except OSError as error:
            raise CommandError(
                "the library for FMUs and C cannot be loaded",
                where=str(file),
                value=error,
                remedy="Name a folder for temporary files from which programs may run: TMPDIR=FOLDER.",
            ) from None
    library.fmi3InstantiateModelExchange.restype = ctypes.c_void_p
    return library


_LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


def try_plan(json: str, token: str, states: int) -> tuple[int, list[float]]:
    """Return what the library has for a plan, which it reads, checks and starts: event indicators, sizes of its states.

    Parameters
    ----------
    json, token : str
        Of a `pneudrive.fmu.variables.FmuPlan`.
    states : int
        How many states the other tool integrates.

    Returns
    -------
    int
        How many event indicators there are.
    list of float
        Nominal values of the states, SI.

    Raises
    ------
    DescriptionError
        The library refuses the plan.
    CommandError
        This installation lacks the library.
    """
    library, messages = load_library(), []

    def log(_environment: Any, _status: int, _category: bytes, message: bytes) -> None:  # noqa: ANN401
        messages.append(message.decode())

    callback = _LOG(log)
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "drive.json").write_text(json, encoding="utf-8")
        text = [ctypes.c_char_p(one.encode()) for one in ("export", token, folder)]
        instance = ctypes.c_void_p(library.fmi3InstantiateModelExchange(*text, False, False, None, callback))
    count, sizes = ctypes.c_size_t(), (ctypes.c_double * states)()
    try:
        start = (instance, False, ctypes.c_double(0.0), ctypes.c_double(0.0), False, ctypes.c_double(0.0))
        done = instance.value is not None and all(
            status == _OK
            for status in (
                library.fmi3EnterInitializationMode(*start),
                library.fmi3ExitInitializationMode(instance),
                library.fmi3GetNumberOfEventIndicators(instance, ctypes.byref(count)),
                library.fmi3GetNominalsOfContinuousStates(instance, sizes, ctypes.c_size_t(states)),
            )
        )
        if not done:
            raise DescriptionError("the library refuses the drive: " + "; ".join(dict.fromkeys(messages)))
    finally:
        library.fmi3FreeInstance(instance)
    return count.value, list(sizes)
