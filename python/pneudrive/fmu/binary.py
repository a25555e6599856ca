"""The library that every FMU and every C program of a drive carries."""

from __future__ import annotations

import ctypes
import struct
import sys
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

from pneudrive import _core
from pneudrive.errors import CommandError, DescriptionError

#: Platform -> suffix of a library, folder of FMI 2.0, folder of FMI 3.0.
PLATFORMS = {
    "linux": (".so", "linux64", "x86_64-linux"),
    "darwin": (".dylib", "darwin64", "x86_64-darwin"),
    "win32": (".dll", "win64", "x86_64-windows"),
}
_OK = 0
# Of the format ELF: kind of a section, place of a symbol, bindings (System V Application Binary Interface, chapter 4).
_DYNAMIC_SYMBOLS, _UNDEFINED, _GLOBAL, _WEAK = 11, 0, 1, 2


def binary_name() -> str:
    """Return the file name that the library has on this platform."""
    return f"libpneudrive{PLATFORMS.get(sys.platform, PLATFORMS['linux'])[0]}"


@lru_cache(maxsize=1)
def binary_bytes() -> bytes:
    """Return the library: the core, as another tool than Python can load it.

    Raises
    ------
    CommandError
        The core of this platform is no library for other tools.
    """
    try:
        return weakened(Path(_core.__file__).read_bytes())
    except ValueError:
        built = Path(__file__).with_name(binary_name())
        if built.is_file():
            return built.read_bytes()
        raise CommandError(
            f"this installation of pneudrive has no library for FMUs and C on {sys.platform}",
            where=str(built),
            remedy="Export on Linux; or, in a copy of the source, run `make setup`.",
        ) from None


def weakened(library: bytes) -> bytes:
    """Return an extension module that loads where there is no Python: its references to Python may be empty.

    Parameters
    ----------
    library : bytes
        A library in the format ELF, 64 bits, little endian.

    Raises
    ------
    ValueError
        It is no such library.
    """
    if library[:6] != b"\x7fELF\x02\x01":
        raise ValueError("no ELF of 64 bits")
    changed = bytearray(library)
    (sections,) = struct.unpack_from("<Q", library, 0x28)
    size, count = struct.unpack_from("<HH", library, 0x3A)
    heads = [struct.unpack_from("<IIQQQQIIQQ", library, sections + size * i) for i in range(count)]
    for _, kind, _, _, offset, length, link, _, _, entry in heads:
        if kind != _DYNAMIC_SYMBOLS:
            continue
        names = heads[link][4]
        for at in range(offset, offset + length, entry):
            name, info, _, section = struct.unpack_from("<IBBH", library, at)
            of_python = library.startswith((b"Py", b"_Py"), names + name)
            if section == _UNDEFINED and info >> 4 == _GLOBAL and of_python:
                changed[at + 4] = _WEAK << 4 | info & 0xF
    return bytes(changed)


@lru_cache(maxsize=1)
def load_library() -> ctypes.CDLL:
    """Return the core of this process as a library of C functions."""
    library = ctypes.CDLL(_core.__file__)
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
