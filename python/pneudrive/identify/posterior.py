"""Error message for the removed posterior by emcee, with its replacement.

This module will be removed in the next release.
"""

from __future__ import annotations

from typing import NoReturn

from pneudrive.errors import FitError


def posterior(*_: object, **__: object) -> NoReturn:
    """Raise an error that names the intervals of a fit.

    Raises
    ------
    FitError
        Always.
    """
    raise FitError(
        "posterior intervals by emcee are removed",
        remedy="Use fit.intervals, fit.profile() or pneudrive.identify.bootstrap.bootstrap(fit).",
    )
