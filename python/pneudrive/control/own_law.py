"""Custom laws: a Python class that receives the signals of sensors and observer."""

from __future__ import annotations

import inspect
import json
import math
import reprlib
import uuid
from collections import namedtuple
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from pneudrive import _core, own_code
from pneudrive.arrays import Keyed
from pneudrive.errors import CommandError, OwnLawError, nearest

#: Name of all custom laws in the core.
OWN = "own"
_FAILS = 'Correct the law, or let another law take over: [on_fault] law = "inversion" in a controller file.'
_RULE = "a law has inputs, a tuple of names, and step(t, sample, preview), which returns the command"


@dataclass
class RunningLaw:
    """A custom law in a run.

    Attributes
    ----------
    call : callable
        Function that returns the command for a tuple of input values, or NaN if the law fails.
    signals : list of str
        Names of the input values, in their order.
    failure : OwnLawError or None
        The first failure of the law.
    stopped : BaseException or None
        Exception that ends more than this run, such as KeyboardInterrupt.
    """

    name: str
    step: Callable[[tuple[float, ...]], Any]
    signals: list[str]
    failure: OwnLawError | None = None
    stopped: BaseException | None = None

    def call(self, values: tuple[float, ...]) -> float:
        """Return the command for the values of the inputs, or NaN if the law fails."""
        try:
            given = self.step(values)
        except (Exception, SystemExit) as error:
            self._fails(values[0], f"{type(error).__name__}: {error}", own_code.place_of(error), error)
            return math.nan
        except BaseException as error:
            self.stopped = error
            return math.nan
        with suppress(TypeError, ValueError, OverflowError):
            if not isinstance(given, str) and math.isfinite(command := float(given)):
                return command
        self._fails(values[0], f"it returns {reprlib.repr(given)}", None, None)
        return math.nan

    def _fails(self, t: float, what: str, where: str | None, cause: BaseException | None) -> None:
        if self.failure is None:
            what = f"the law {self.name} fails at t = {t:g} s: {what}"
            self.failure = OwnLawError(what, where=where, rule="a command must be a finite number", remedy=_FAILS)
            self.failure.__cause__ = cause


@dataclass(frozen=True)
class OwnLaw:
    """A custom law that can be run.

    Attributes
    ----------
    name : str
        ``"mine.py:Law"``, or the name of the law's class.
    digest : str
        Hash of the file with the law. An object cannot be hashed, so it gets a new identifier each time.
    """

    name: str
    digest: str
    given: Any = field(repr=False, compare=False)  # the law, or a class or a function that makes one for a run

    def begin(self, tuning: Any, motion: Keyed) -> RunningLaw:  # noqa: ANN401 - `Tuning` itself imports this module
        """Prepare the law for a run: make its object, check its inputs, and call its ``start`` if it has one."""
        name = self.name
        law = own_code.guarded(name, CommandError, self.given) if callable(self.given) else self.given
        inputs = _inputs(name, law)
        own_code.guarded(
            name, CommandError, lambda: law.start(tuning, tuning.period_s) if hasattr(law, "start") else None
        )
        make = namedtuple("Sample", inputs)._make
        step, preview = law.step, _core.ControlReference(json.dumps(motion))
        return RunningLaw(name, lambda values: step(values[0], make(values[1:]), preview), ["time", *inputs])


def signals() -> dict[str, tuple[str, str]]:
    """Return the inputs that a custom law may request: name -> unit and meaning.

    Examples
    --------
    >>> signals()["velocity"]
    ('m/s', 'velocity, estimated')
    """
    return {key: (unit, what) for key, unit, what in _core.control_signals() if key != "time"}


def is_own(given: object) -> bool:
    """Return whether a law is custom: an object, a class, or the name of a code file or module."""
    if isinstance(given, str):
        return given not in _core.control_laws() and own_code.split(given) is not None
    return own_code.guarded(type(given).__name__, CommandError, lambda: hasattr(given, "step"))


def own_law(given: object, *, allow_code: str | None = None, found_in: str = "") -> OwnLaw:
    """Load a custom law and check it.

    Parameters
    ----------
    given : object or str
        A class, an instance, ``"mine.py:Law"`` or ``"package.module:Law"``.
    allow_code : str, optional
        SHA-256 of a code file; required if a file names the code, and the user does not.
    found_in : str
        File that names the code; empty if the user of this run has named it.

    Raises
    ------
    CommandError
        The code does not exist, is not allowed to run, or is not a law.
    """
    if not isinstance(given, str):
        kind = given if isinstance(given, type) else type(given)
        return OwnLaw(kind.__name__, uuid.uuid4().hex, given)
    module, _ = own_code.split(given) or (given, "")
    if module.endswith((".so", ".dylib", ".dll")):
        raise CommandError.of("control.shared-library", given=given, rule=_RULE)
    if found_in:
        law = own_code.load_allowed(given, allow_code, found_in, "--law", CommandError)
    else:
        law = own_code.load(given, CommandError)
    return OwnLaw(given, own_code.sha256(given) or uuid.uuid4().hex, law)


def _inputs(name: str, law: object) -> list[str]:
    """Return the names of the signals that a law requests.

    Raises
    ------
    CommandError
        The object is not a law, or an input is not a known signal or is listed twice.
    """
    known = list(signals())
    inputs, step = own_code.guarded(
        name, CommandError, lambda: (getattr(law, "inputs", None), getattr(law, "step", None))
    )
    if inputs is None or not callable(step):
        lacks = "inputs" if inputs is None else "step"
        raise CommandError.of("control.no_law", name=name, rule=_RULE, lacks=lacks, names=", ".join(known))
    if not isinstance(inputs, (tuple, list)):
        is_text = isinstance(inputs, str)
        what = f"inputs is {'the text ' if is_text else ''}{inputs!r}"
        remedy = f"inputs = ({inputs!r},)" if is_text else f"Known names: {', '.join(known)}."
        raise CommandError(f"{name}: {what}", rule="inputs must be a tuple of names", remedy=remedy)
    for one in inputs:
        if one not in known:
            raise CommandError(f"{name}: there is no input {one!r}", remedy=nearest(str(one), known))
        if inputs.count(one) > 1:
            raise CommandError(f"{name}: the input {one!r} is listed twice", remedy="List each input once.")
    with suppress(ValueError):  # code without a readable signature
        try:
            inspect.signature(step).bind(0.0, None, None)
        except TypeError as error:
            raise CommandError(f"{name}: step cannot be called: {error}", rule=_RULE) from None
    return list(inputs)
