"""Requests of the page as models, whose fields are checked once, when they are read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, FiniteFloat, StrictInt, StrictStr, ValidationError

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from typing_extensions import Self

WRONG_REQUEST = "the request is not one of this page"
MOST_PIXELS, LEAST_PIXELS = 4000, 10
#: Width of a drawing; one that is out of bounds is cut to them.
Pixels = Annotated[StrictInt, AfterValidator(lambda width: max(LEAST_PIXELS, min(width, MOST_PIXELS)))]
#: Text or number of a value that a field of the page changes; a truth is a number.
Value = StrictStr | StrictInt | FiniteFloat


class PageRequest(BaseModel):
    """A request of the page. Additional fields are ignored, because one message may contain several requests."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    @classmethod
    def of(cls, given: Mapping[str, Any]) -> Self:
        """Read a request.

        Raises
        ------
        CommandError
            A part is missing or of another type.
        """
        try:
            return cls.model_validate(given)
        except ValidationError:
            raise CommandError(WRONG_REQUEST, remedy="Reload the page.") from None
