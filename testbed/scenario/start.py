"""The [start] table: where vehicles start and their goals: on a circle, listed, drawn, or in two streams."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag, model_validator

from testbed.scenario.fields import Coordinate, NonNegative, Positive, Section, Speed
from testbed.scenario.kinds import Kinds


class Place(Section):
    """Where one vehicle starts, and its goal."""

    x_m: Coordinate = Field(description="east")
    y_m: Coordinate = Field(description="north")
    course_deg: Annotated[float, Field(ge=-720, le=720)] = Field(description="counter-clockwise from east")
    z_m: Coordinate = Field(default=0.0, description="height above the shared origin")
    goal_x_m: Coordinate = Field(description="east")
    goal_y_m: Coordinate = Field(description="north")
    goal_z_m: Coordinate = Field(default=0.0, description="height")


class _Start(Section):
    speed_mps: Speed = Field(
        default=20.0,
        description="ground speed at t = 0; unicycles without lags fly the first command at once",
    )
    round_decimals: Annotated[int, Field(ge=0, le=12)] | None = Field(
        default=None, description="x, y [m] and course [deg] rounded so, as in the published runs"
    )
    lateral_perturbation_m: NonNegative = Field(default=0.0, description="uniform, across the course")
    heading_perturbation_deg: Annotated[float, Field(ge=0, le=180)] = Field(
        default=0.0, description="uniform"
    )
    height_perturbation_m: NonNegative = Field(default=0.0, description="uniform")
    lateral_offsets_m: list[Annotated[float, Field(ge=-1e5, le=1e5)]] = Field(
        default=[], description="per vehicle, to the left of its course; absent: none"
    )
    heading_offsets_deg: list[Annotated[float, Field(ge=-180, le=180)]] = Field(
        default=[], description="per vehicle, counter-clockwise; absent: none"
    )
    height_offsets_m: list[Annotated[float, Field(ge=-1e5, le=1e5)]] = Field(
        default=[], description="per vehicle, up; absent: none"
    )


class Circle(_Start):
    """On a circle, each vehicle facing its centre with the goal opposite."""

    pattern: Literal["circle"] = "circle"
    radius_m: Positive = Field(default=200.0, description="of the circle")
    course_offset_deg: Annotated[float, Field(ge=-180, le=180)] = Field(
        default=0.0, description="added to the course towards the centre, counter-clockwise"
    )
    heights_m: list[Coordinate] = Field(
        default=[0.0], min_length=1, description="one for all, or one per vehicle, repeated in turn"
    )


class Places(_Start):
    """Listed one by one."""

    pattern: Literal["list"]
    places: list[Place] = Field(default=[], description="one per vehicle")


class RandomGoals(_Start):
    """Starts and goals drawn from the seed in a square, courses towards the goals, every pair safe."""

    pattern: Literal["random-goals"]
    square_m: Positive = Field(default=700.0, description="side of the square about the origin, level")
    goal_distance_m: NonNegative = Field(default=350.0, description="from a start to its goal, at least")
    start_h_m: NonNegative = Field(
        default=4.0, description="h of every pair at the start, at least; perturbations are added afterwards"
    )

    @model_validator(mode="after")
    def fits(self) -> RandomGoals:
        if self.goal_distance_m > self.square_m:
            raise ValueError(
                f"goal_distance_m: goals {self.goal_distance_m:g} m away hardly fit into a square of"
                f" {self.square_m:g} m; make square_m larger"
            )
        return self


class Streams(_Start):
    """Two streams that cross at the origin, one eastwards; numbers alternate between them."""

    pattern: Literal["streams"]
    crossing_deg: Annotated[float, Field(ge=10, le=180)] = Field(
        default=90.0, description="course of the second stream, counter-clockwise; 180 is head-on"
    )
    ahead_m: Positive = Field(
        default=200.0,
        description="from the first vehicle of each to the crossing, and from there to its goal",
    )
    spacing_m: Positive = Field(
        default=60.0, description="between vehicles of a stream; each flies as far as all others"
    )


STARTS = Kinds(
    "pattern",
    "circle",
    {"circle": Circle, "list": Places, "random-goals": RandomGoals, "streams": Streams},
    {
        "circle": "a start on a circle",
        "list": "a start from listed places",
        "random-goals": "a start drawn at random",
        "streams": "a start in streams",
    },
)
Start = Annotated[
    Annotated[Circle, Tag("circle")]
    | Annotated[Places, Tag("list")]
    | Annotated[RandomGoals, Tag("random-goals")]
    | Annotated[Streams, Tag("streams")],
    Discriminator(STARTS.tag),
    BeforeValidator(STARTS.settled),
]
