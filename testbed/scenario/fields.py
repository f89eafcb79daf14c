"""Types of scenario fields: numbers with their bounds, names, and the base class of every table."""

from __future__ import annotations

import math
import re
from typing import Annotated

from pydantic import AfterValidator, BaseModel, ConfigDict, Field


def in_degrees(rate: float) -> float:
    """ValueError for a turn rate that only makes sense in radians per second."""
    if 0 < abs(rate) < 0.5:
        raise ValueError(
            f"{rate:g} deg/s is a circle of kilometres; if rad/s was meant, give {math.degrees(rate):.4g}"
        )
    return rate


# Wide enough for anything that flies, narrow enough that no square or cube of them overflows.
LARGEST = 1e6
Positive = Annotated[float, Field(gt=0, le=LARGEST)]
# Of what is divided by.
Divisor = Annotated[float, Field(ge=1e-6, le=LARGEST)]
NonNegative = Annotated[float, Field(ge=0, le=LARGEST)]
Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Speed = Annotated[float, Field(ge=0.01, le=1000)]
SpeedRatio = Annotated[float, Field(ge=1e-3, le=1e3)]
ClimbRate = Annotated[float, Field(ge=-1000, le=1000)]
TurnRate = Annotated[float, Field(ge=-360, le=360), AfterValidator(in_degrees)]
TurnLimit = Annotated[float, Field(ge=0, le=360), AfterValidator(in_degrees)]


def _folder_name(name: str) -> str:
    """A name becomes a folder's: it may not lead out of one, hide, or mean something to a terminal."""
    if not re.fullmatch(r"[\w+][\w+ .,=()-]*", name):
        raise ValueError(
            "it names a folder: letters, digits, blanks and any of _ + - . , = ( ), no other first"
        )
    return name


Name = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(_folder_name)]


class Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, allow_inf_nan=False)
