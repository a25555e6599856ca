"""Requests of the page as models, shell and Python lines that repeat them, and answers: problems, data, frames.

A frame consists of the length of its head (4 bytes, little-endian), the head (JSON), and arrays. Each array is aligned
to 8 bytes, so that the page can read it in place.
"""

from __future__ import annotations

import json
import shlex
import struct
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import cache
from importlib import import_module
from inspect import Parameter, signature
from traceback import print_exception
from typing import Annotated, Any

import numpy as np
import pydantic
from pydantic import AfterValidator, BaseModel, FiniteFloat, StrictInt, StrictStr, ValidationError, WrapValidator
from typing_extensions import Self

from pneudrive.arrays import Keyed, Plain, attributes_of
from pneudrive.errors import CommandError, PneudriveError, package_table
from pneudrive.figures import plain_data
from pneudrive.web.workspace import safe

ALIGNED = 8
LONGEST_NAME = 200  # longest name in a message
TYPES = {"float32": "<f4", "float64": "<f8"}


def pack(head: Keyed, arrays: Keyed, *, drawn: bool = False) -> bytes:
    """Pack a head and arrays of 32- or 64-bit floats.

    The head gets ``arrays``: name, type (``"f4"`` or ``"f8"``), offset after the head and length of each. Infinite
    values and NaN in the head become null, because JSON does not support them.

    Parameters
    ----------
    head : mapping
    arrays : mapping
        Shape (n,) each.
    drawn : bool
        Whether arrays are only drawn. They are then sent in 32 bits as differences from a middle value, which is the
        last number of the entry in ``arrays``. The error of each value is at most 2^-25 of the range of its array.
    """
    listed, blocks, at = [], [], 0
    for name, values in arrays.items():
        if drawn:
            ends = np.fmin.reduce(values, initial=np.inf), np.fmax.reduce(values, initial=-np.inf)
            middle = 0.5 * float(ends[0]) + 0.5 * float(ends[1]) if np.isfinite(ends).all() else 0.0
            own = np.subtract(values, middle, dtype=float).astype("<f4")
        else:
            middle, own = None, np.ascontiguousarray(values, dtype=TYPES[values.dtype.name])
        offset = [] if middle is None else [middle]
        listed.append([name, own.dtype.str[1:], at, len(own), *offset])
        padding = -own.nbytes % ALIGNED
        blocks += [own.tobytes(), bytes(padding)]
        at += own.nbytes + padding
    text = json.dumps(plain_data({**head, "arrays": listed}), default=str, allow_nan=False).encode()
    text += b" " * (-(4 + len(text)) % ALIGNED)
    return b"".join([struct.pack("<I", len(text)), text, *blocks])


def problems_of(error: PneudriveError) -> list[Plain]:
    """Return an error and its sub-errors as plain data: file, line, what, value, rule and remedy."""
    out = []
    for one in error.each():
        file, _, line = (one.where or "").rpartition(":")
        out.append(
            {
                "file": (file if line.isdigit() else one.where or "").rpartition("/")[2],
                "line": int(line) if line.isdigit() else None,
                "value": None if one.value is None else str(one.value),
                **attributes_of(one, "key", "what", "rule", "remedy"),
            }
        )
    return out


#: Exceptions caused by a missing key, a value of another kind, or damaged bytes of a file.
OF_DAMAGE = (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, EOFError, zlib.error, struct.error)


def page_error(error: BaseException, path: str = "") -> PneudriveError:
    """Return the error that the page shows for an exception. An unexpected one is also printed on the terminal.

    Parameters
    ----------
    error : BaseException
        The exception. Panics of the core are not of the class `Exception`.
    path : str
        File that was read. Empty if the request names no file.
    """
    if isinstance(error, PneudriveError):
        return error
    text = f"{type(error).__name__}: {error}"
    if path and isinstance(error, OF_DAMAGE):
        value = f"{error.args[0]} is missing" if isinstance(error, KeyError) and error.args else text
        return CommandError.of("web.damaged", value=value, path=path[:LONGEST_NAME])
    print_exception(error)
    return CommandError.of("web.fault", text=text)


# --- Requests, whose fields are checked once, and the lines that repeat them elsewhere.

MOST_PIXELS, LEAST_PIXELS = 4000, 10
#: Width of a drawing, clipped to its bounds.
Pixels = Annotated[StrictInt, AfterValidator(lambda width: max(LEAST_PIXELS, min(width, MOST_PIXELS)))]
#: Text or number of a value that a field of the page changes. A boolean is a number.
Value = StrictStr | StrictInt | FiniteFloat


def bounded(low: float, high: float, rule: str = "") -> WrapValidator:
    """Return the validator of a number in a request. Text that is not a number counts as out of bounds."""

    def check(given: Any, read: Any, info: Any) -> Any:  # noqa: ANN401 - signature of pydantic
        with suppress(ValidationError):
            value = read(given)
            if value is None or low <= value <= high:
                return value
        what = f"{info.field_name} = {str(given)[:80]} is out of bounds"
        raise CommandError(what, rule=rule or f"a whole number, {low} to {high}")

    return WrapValidator(check)


class PageRequest(BaseModel):
    """Request of the page. Additional fields are ignored, because one message may contain several requests."""

    model_config = {"frozen": True, "extra": "ignore"}

    @classmethod
    def of(cls, given: Keyed) -> Self:
        """Read a request.

        Raises
        ------
        CommandError
            A field of the request is missing or has the wrong type.
        """
        try:
            return cls.model_validate(given)
        except ValidationError:
            raise wrong_request() from None


#: Parameters of answering functions that are not fields of the request.
OF_SERVER = ("workspace", "control", "build", "limit", "given")


@cache
def _door(name: str) -> tuple[Callable[..., Any], Mapping[str, Parameter], type[PageRequest]]:
    """Return the function ``module:function``, its parameters, and a model of the parameters that a request gives."""
    module, _, function = name.partition(":")
    found = getattr(import_module(f"pneudrive.web.{module}"), function)
    parameters = signature(found, eval_str=True).parameters
    fields: Plain = {
        key: (each.annotation, ... if each.default is each.empty else each.default)
        for key, each in parameters.items()
        if key not in OF_SERVER
    }
    return found, parameters, pydantic.create_model(function, __base__=PageRequest, **fields)


def answer_of(name: str, table: Keyed, known: Keyed, *, has_defaults: bool = False) -> Any:  # noqa: ANN401 - plain data, or a frame
    """Call the function of an address with the values of a request.

    The parameters of the function define the request. The server provides the parameters in
    `OF_SERVER`; ``given`` is the whole request. All other parameters are validated by their annotations.

    Parameters
    ----------
    name : str
        ``module:function``
    table : mapping
        Request.
    known : mapping
        Values from the server.
    has_defaults : bool
        Whether each missing required field counts as an empty text.
    """
    function, parameters, request = _door(name)
    if has_defaults:
        table = {key: "" for key, field in request.model_fields.items() if field.is_required()} | dict(table)
    models = [key for key, each in parameters.items() if hasattr(each.annotation, "model_fields")]
    values = {**known, "given": table, **vars(request.of({**table, **dict.fromkeys(models, table)}))}
    return function(**{key: values[key] for key in parameters})


def table_of(request: str | bytes) -> Plain:
    """Read a request in JSON, which must be a table.

    Raises
    ------
    CommandError
        The request is not such a table.
    """
    try:
        table = json.loads(request)
        json.dumps(table, ensure_ascii=False).encode()  # half of a surrogate pair is not text
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise wrong_request()
    return table


def wrong_request() -> CommandError:
    """Return the error for a request that the page does not send."""
    return CommandError("this page does not send such a request", remedy="Reload the page.")


def python(name: str, **values: Any) -> str:  # noqa: ANN401 - any value
    """Return lines of Python from ``python.toml``."""
    return package_table(__file__, "python.toml")[name].format(**values)


def words(command: str, /, *names: str, **options: Any) -> list[str]:  # noqa: ANN401 - texts, numbers, lists of them
    """Return the words of a command: its arguments, then its non-empty options.

    Examples
    --------
    >>> words("fit", "-map.csv", laws="stribeck", by=None, yes=True, set=["a = 1", "b = 2"])
    ['fit', './-map.csv', '--laws', 'stribeck', '--yes', '--set', 'a = 1', '--set', 'b = 2']
    """
    out = [*command.split(), *map(safe, names)]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is True:
            out.append(flag)
        elif not _is_empty(value):
            out += [word for text in (value if isinstance(value, list) else [value]) for word in (flag, str(text))]
    return out


def shell(command: str, /, *names: str, **options: Any) -> str:  # noqa: ANN401 - as for `words`
    """Return a line of a shell. See `words`."""
    return shlex.join(["pneudrive", *words(command, *names, **options)])


def call(function: str, /, *positional: str, **options: Any) -> str:  # noqa: ANN401 - any value
    """Return a call in Python: arguments unchanged, then the non-empty options.

    Examples
    --------
    >>> call("pn.simulate", "drive", "'0.5 s'", initial="", rtol=1e-4)
    "pn.simulate(drive, '0.5 s', rtol=0.0001)"
    """
    return f"{function}({(', '.join(positional) + keywords(**options)).removeprefix(', ')})"


def keywords(**options: Any) -> str:  # noqa: ANN401 - any value
    """Return the non-empty keyword arguments in Python, each after a comma."""
    return "".join(f", {name}={value!r}" for name, value in options.items() if not _is_empty(value))


def _is_empty(value: object) -> bool:
    return value is None or value is False or value in ("", {}, [])
