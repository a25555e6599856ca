"""Requests of the page as models, whose fields are checked once, when they are read."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, FiniteFloat, StrictInt, StrictStr, ValidationError

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from typing_extensions import Self

    from pneudrive.web.measured.recordings import OpenRecording

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


class ViewRequest(PageRequest):
    """A part of a recording: from and to in s or samples, width of the drawing, names of columns on lines.

    Attributes
    ----------
    start, end : float
    pixels : int
    columns : str
    shift : float
        Time shift of another recording that is drawn over it, s.
    """

    start: FiniteFloat = Field(alias="from")
    end: FiniteFloat = Field(alias="to")
    pixels: int = 1000
    columns: StrictStr = ""
    shift: FiniteFloat = 0.0

    @property
    def span(self) -> tuple[float, float]:
        """From and to.

        Raises
        ------
        CommandError
            They do not rise, or the drawing is too wide.
        """
        if not (self.start < self.end and 1 <= self.pixels <= MOST_PIXELS):
            raise CommandError("the view is out of bounds", rule=f"from < to, 1 to {MOST_PIXELS} pixels")
        return self.start, self.end

    def columns_in(self, found: OpenRecording) -> list[str]:
        """Return the requested columns that a recording has."""
        known = [one.column for one in found.channels]
        return [name for name in self.columns.split("\n") if name in known]
