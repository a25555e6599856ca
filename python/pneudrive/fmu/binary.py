"""The library inside every FMU and every C program of a drive."""

from __future__ import annotations

import ctypes
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
    """Return the file name of the library on this platform."""
    return f"libpneudrive{PLATFORMS.get(sys.platform, PLATFORMS['linux'])[0]}"


@lru_cache(maxsize=1)
def binary_path() -> Path:
    """Return the library of this installation.

    Raises
    ------
    CommandError
        This installation does not include a library for this platform.
    """
    path = Path(__file__).with_name(binary_name())
    if not path.is_file():
        raise CommandError(
            f"this installation of pneudrive has no library for FMUs and C on {sys.platform}",
            where=str(path),
            remedy="Install a wheel; or, in a copy of the source, run `make setup`.",
        )
    return path


@lru_cache(maxsize=1)
def load_library() -> ctypes.CDLL:
    """Return the library in this process, as C functions."""
    library = ctypes.CDLL(str(binary_path()))
    library.fmi3InstantiateModelExchange.restype = ctypes.c_void_p
    return library


_LOG = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_int, ctypes.c_char_p, ctypes.c_char_p)


def try_plan(json: str, token: str, states: int) -> tuple[int, list[float]]:
    """Check and start a plan in the library; return the number of its event indicators and the sizes of its states.

    Parameters
    ----------
    json, token : str
        Form and token of a `pneudrive.fmu.variables.FmuPlan`.
    states : int
        Number of states that the other tool integrates.

    Returns
    -------
    int
        Number of event indicators.
    list of float
        Nominal values of the states, SI.

    Raises
    ------
    DescriptionError
        The library rejects the plan.
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
