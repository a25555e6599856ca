"""Calls a tool might make of an FMU 2.0, in any order and with any numbers: each has to end in a status.

python fmu_calls.py UNPACKED_FMU TOKEN
"""

from __future__ import annotations

import ctypes
import random
import sys
from ctypes import byref, c_double, c_int, c_size_t, c_uint, c_void_p

LIVES, CALLS, STATUSES = 60, 120, 6
NUMBERS = (0.0, 0.5, -1.0, 1e300, float("nan"), float("inf"))


class Callbacks(ctypes.Structure):
    """No functions of the tool."""

    _fields_ = [(name, c_void_p) for name in ("log", "allocate", "free", "finished", "environment")]


def calls(rng: random.Random) -> dict:
    """Functions by name, each with a maker of its arguments; room is enough for all lengths."""
    doubles, references, flags = (c_double * 64)(), (c_uint * 64)(), (c_int * 64)()
    kept, info = c_void_p(), (ctypes.c_char * 64)()

    def some(most: int) -> c_size_t:
        for i in range(64):
            doubles[i] = rng.choice([*NUMBERS, rng.random()])
            references[i] = rng.randrange(80)
        return c_size_t(rng.randrange(most))

    def one_of(*values: float) -> c_double:
        return c_double(rng.choice(values))

    return {
        "SetupExperiment": lambda: (c_int(rng.randrange(2)), one_of(1e-6, 7.0), one_of(0), c_int(0), one_of(1)),
        "EnterInitializationMode": tuple,
        "ExitInitializationMode": tuple,
        "Terminate": tuple,
        "GetReal": lambda: (references, some(9), doubles),
        "GetReal ": lambda: (None, c_size_t(2), None),
        "SetReal": lambda: (references, some(3), doubles),
        "GetBoolean": lambda: (references, c_size_t(1), flags),
        "GetFMUstate": lambda: (byref(kept),),
        "SetFMUstate": lambda: (kept,),
        "FreeFMUstate": lambda: (byref(kept),),
        "EnterEventMode": tuple,
        "EnterContinuousTimeMode": tuple,
        "NewDiscreteStates": lambda: (info,),
        "CompletedIntegratorStep": lambda: (c_int(1), flags, flags),
        "SetTime": lambda: (one_of(0.0, 1.0, float("nan")),),
        "SetContinuousStates": lambda: (doubles, some(9)),
        "GetContinuousStates": lambda: (doubles, some(9)),
        "GetDerivatives": lambda: (doubles, some(9)),
        "GetEventIndicators": lambda: (doubles, some(3)),
        "GetDirectionalDerivative": lambda: (references, some(3), references, some(3), doubles, doubles),
        "DoStep": lambda: (one_of(0.0, 1e-3), one_of(1e-3, -1.0, float("nan")), c_int(1)),
        "CancelStep": tuple,
    }


def main(folder: str, token: str) -> list[int]:
    """Return how often each status came."""
    library = ctypes.CDLL(f"{folder}/binaries/linux64/pneudrive.so")
    library.fmi2Instantiate.restype = c_void_p
    rng, answers = random.Random(7), [0] * STATUSES
    resources = f"file://{folder}/resources".encode()
    for life in range(LIVES):
        known = calls(rng)
        own = c_void_p(library.fmi2Instantiate(b"x", life % 2, token.encode(), resources, byref(Callbacks()), 0, 0))
        assert own.value
        likely = ["EnterInitializationMode", "ExitInitializationMode", "EnterContinuousTimeMode"]
        for _ in range(CALLS):
            name = rng.choice([*known, *likely])
            answers[getattr(library, "fmi2" + name.strip())(own, *known[name]())] += 1
        library.fmi2FreeFMUstate(own, *known["FreeFMUstate"]())
        library.fmi2FreeInstance(own)
    return answers


if __name__ == "__main__":
    ok, _, _, error, fatal, _ = main(*sys.argv[1:3])
    assert ok > 500, ok
    assert error > 500, error
    assert fatal == 0, fatal
