"""The [[fence]] tables: areas that vehicles stay in or out of, and height bands."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from filters.barriers.fences.polygon import Polygon
from filters.barriers.fences.shapes import Area, Disc, Heights, Shape
from testbed.scenario.fields import Coordinate, NonNegative, Positive, Section
from testbed.scenario.kinds import Kinds

Point = Annotated[list[Coordinate], Field(min_length=2, max_length=2)]
Corners = Annotated[list[Point], Field(max_length=1000)]


class _Fence(Section):
    name: Annotated[str, Field(max_length=100)] = Field(default="", description="for figures and messages")
    margin_m: NonNegative = Field(default=0.0, description="distance to keep from it")
    vehicles: list[Annotated[int, Field(ge=1, le=1000)]] = Field(
        default=[], max_length=1000, description="that it is for, from 1; absent: all"
    )

    @model_validator(mode="after")
    def distinct(self) -> _Fence:
        if len(set(self.vehicles)) < len(self.vehicles):
            raise ValueError("vehicles: a vehicle is listed twice")
        return self

    def shape(self, buffer_m: float = 0.0) -> Shape:
        """What `filters` makes of it, with a margin larger by `buffer_m`; ValueError if that is no shape."""
        raise NotImplementedError


class KeepIn(_Fence):
    """Vehicles stay inside a polygon."""

    kind: Literal["keep-in"]
    polygon_m: Corners = Field(description="corners [x, y] in order round it; it may be non-convex")

    @model_validator(mode="after")
    def simple(self) -> KeepIn:
        self.shape()
        return self

    def shape(self, buffer_m: float = 0.0) -> Shape:
        """As `_Fence.shape`."""
        return Area(Polygon(self.polygon_m), inside=True, margin=self.margin_m + buffer_m)


class KeepOut(_Fence):
    """Vehicles stay outside a polygon or a circle."""

    kind: Literal["keep-out"]
    polygon_m: Corners | None = Field(default=None, description="corners [x, y] in order round it")
    centre_m: Point | None = Field(default=None, description="[x, y] of a circle")
    radius_m: Positive | None = Field(default=None, description="of the circle")

    @model_validator(mode="after")
    def one_shape(self) -> KeepOut:
        circle = [name for name in ("centre_m", "radius_m") if getattr(self, name) is not None]
        if self.polygon_m is not None and circle:
            raise ValueError(f"polygon_m and {circle[0]} are two shapes; write two [[fence]] tables")
        if self.polygon_m is None and len(circle) < 2:
            said = f"{circle[0]} alone is none" if circle else "it has none"
            raise ValueError(f"a shape is needed, and {said}; give polygon_m, or centre_m and radius_m")
        self.shape()
        return self

    def shape(self, buffer_m: float = 0.0) -> Shape:
        """As `_Fence.shape`."""
        margin = self.margin_m + buffer_m
        if self.polygon_m is not None:
            return Area(Polygon(self.polygon_m), inside=False, margin=margin)
        assert self.centre_m is not None
        assert self.radius_m is not None
        return Disc(complex(*self.centre_m), self.radius_m, margin)


class HeightBand(_Fence):
    """Vehicles stay between two heights, or above or below one."""

    kind: Literal["heights"]
    floor_m: Coordinate | None = Field(default=None, description="above the shared origin; absent: none")
    ceiling_m: Coordinate | None = Field(default=None, description="above the shared origin; absent: none")

    @model_validator(mode="after")
    def band(self) -> HeightBand:
        if self.floor_m is None and self.ceiling_m is None:
            raise ValueError("a height band needs floor_m or ceiling_m")
        self.shape()
        return self

    def shape(self, buffer_m: float = 0.0) -> Shape:
        """As `_Fence.shape`."""
        floor = -math.inf if self.floor_m is None else self.floor_m
        ceiling = math.inf if self.ceiling_m is None else self.ceiling_m
        return Heights(floor, ceiling, self.margin_m + buffer_m)


FENCES = Kinds(
    "kind",
    "",
    {"keep-in": KeepIn, "keep-out": KeepOut, "heights": HeightBand},
    {"keep-in": "a fence to stay in", "keep-out": "a fence to stay out of", "heights": "a height band"},
)
Fence = Annotated[
    Annotated[KeepIn, Tag("keep-in")]
    | Annotated[KeepOut, Tag("keep-out")]
    | Annotated[HeightBand, Tag("heights")],
    Discriminator(FENCES.tag),
]


def title(number: int, name: str) -> str:
    """What a fence is called in messages and tables, `number` from 1."""
    return f"fence {number} ({name})" if name else f"fence {number}"
