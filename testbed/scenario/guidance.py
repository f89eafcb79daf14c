"""The [guidance] table: what the vehicles want to do, before the filter alters it."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import AfterValidator, BeforeValidator, Discriminator, Field, Tag, model_validator

from testbed.scenario.fields import Coordinate, Divisor, NonNegative, Positive, Section, Speed
from testbed.scenario.installed import installed
from testbed.scenario.kinds import INSTALLED, Kinds
from testbed.scenario.track_file import MOST_ROWS, faulty, sha256


class _Guidance(Section):
    delay_steps: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="filter steps by which u_hat is old; before there is one it is zero"
    )


class NearIdentity(_Guidance):
    """Flies towards the goal."""

    kind: Literal["near-identity"] = "near-identity"
    lookahead_m: Divisor = Field(
        default=1.0, description="the point ahead that is steered, the paper's lambda"
    )
    gain_per_s: Positive = Field(default=0.1, description="on position and height")


class EvadingManoeuvre(_Guidance):
    """Flies the barrier's evading manoeuvre for ever."""

    kind: Literal["manoeuvre"]


class _Following(_Guidance):
    course_gain_per_s: Positive = Field(default=0.5, description="on the course: its error decays at it")


class Hold(_Following):
    """Holds course, speed and height."""

    kind: Literal["hold"]
    course_deg: Annotated[float, Field(ge=-720, le=720)] = Field(description="counter-clockwise from east")
    speed_mps: Speed = Field(default=20.0, description="ground speed")
    height_m: Coordinate = Field(default=0.0, description="above the shared origin")
    height_gain_per_s: Positive = Field(default=0.3, description="on the height")


class Waypoints(_Following):
    """Follows the straight legs from each waypoint to the next; the vehicle joins the first leg."""

    kind: Literal["waypoints"]
    waypoints_m: list[Annotated[list[Coordinate], Field(min_length=3, max_length=4)]] = Field(
        max_length=1000,
        description="[x, y, z] each, or [x, y, z, speed in m/s] flown on the way to it; the last is the goal",
    )
    speed_mps: Speed = Field(default=20.0, description="ground speed where a waypoint says none")
    closed: bool = Field(
        default=False, description="after the last waypoint the first again; false: flies on straight"
    )
    approach_m: Positive | None = Field(
        default=None,
        description="distance from a leg at which the course is 45 deg towards it; absent: what half of the"
        " turn rate can follow",
    )
    height_gain_per_s: Positive = Field(default=0.3, description="on the height, which changes along a leg")

    @model_validator(mode="after")
    def legs(self) -> Waypoints:
        listed = self.waypoints_m
        if len(listed) < 2:
            raise ValueError(
                f"waypoints_m: {len(listed)} waypoint{'s' if len(listed) != 1 else ''}; a leg runs from one"
                " to the next, so list two or more (kind = 'loiter' circles one place)"
            )
        ends = list(zip(listed, listed[1:] + listed[:1], strict=True))
        for k, (one, other) in enumerate(ends if self.closed else ends[:-1]):
            if one[:2] == other[:2]:
                number = (k + 1) % len(listed) + 1
                raise ValueError(
                    f"waypoints_m: {k + 1} and {number} are at one place, x {one[0]:g} m and y {one[1]:g} m;"
                    " a leg needs a length, so move or leave out one of them"
                )
        for k, place in enumerate(listed):
            if len(place) == 4 and not 0.01 <= place[3] <= 1000:
                raise ValueError(f"waypoints_m: {k + 1} has the speed {place[3]:g} m/s; give 0.01 to 1000")
        return self

    def places(self) -> tuple[list[list[float]], list[float]]:
        """(x, y, z) [m] and speed [m/s] of each waypoint."""
        speeds = [place[3] if len(place) == 4 else self.speed_mps for place in self.waypoints_m]
        return [place[:3] for place in self.waypoints_m], speeds


class Loiter(_Following):
    """Flies onto a circle and around it."""

    kind: Literal["loiter"]
    centre_m: Annotated[list[Coordinate], Field(min_length=2, max_length=2)] = Field(description="[x, y]")
    radius_m: Positive = Field(description="of the circle; at least speed / turn rate")
    sense: Literal["left", "right"] = Field(
        default="left", description="left: turning left, counter-clockwise seen from above"
    )
    speed_mps: Speed = Field(default=20.0, description="ground speed")
    height_m: Coordinate = Field(default=0.0, description="above the shared origin")
    approach_m: Positive | None = Field(
        default=None, description="as of 'waypoints', from the circle outwards and inwards"
    )
    height_gain_per_s: Positive = Field(default=0.3, description="on the height")


class RecordedTrack(_Following):
    """Follows a recorded track by its times; after its last row its course, speed and height stay."""

    kind: Literal["track"]
    file: Annotated[str, Field(max_length=1000)] = Field(
        default="",
        description="CSV with columns t_s, x_m, y_m and, if wanted, z_m; relative to the scenario's file",
    )
    sha256: Annotated[str, Field(max_length=64)] = Field(
        default="", description="of the rows; filled in when the file is read, and checked"
    )
    rows: list[Annotated[list[float], Field(min_length=3, max_length=4)]] = Field(
        default=[], max_length=MOST_ROWS, description="the track itself: filled in when the file is read"
    )
    position_gain_per_s: Positive = Field(default=0.5, description="on the place it should be at, and height")

    @model_validator(mode="after")
    def complete(self) -> RecordedTrack:
        if not self.rows:
            said = f"file: {self.file} was not read" if self.file else "file: no track is named"
            raise ValueError(f"{said}; name a CSV file beside the scenario's, or give rows")
        if wrong := faulty(self.rows):
            raise ValueError(f"rows: {wrong}")
        if self.sha256 and self.sha256 != sha256(self.rows):
            raise ValueError("sha256: it is not that of the rows; leave it out, and it is filled in")
        return self


class Layers(_Following):
    """Flies to the goal in a layer of height of its own: climbs to it, holds it, descends to the goal."""

    kind: Literal["layers"]
    speed_mps: Speed = Field(default=20.0, description="ground speed")
    layers: Annotated[int, Field(ge=1, le=1000)] | None = Field(
        default=None,
        description="how many, dealt in turn to the vehicles that fly so; absent: as many as the shortest way"
        " leaves time to climb to and to descend from, at most one a vehicle",
    )
    spacing_m: Positive | None = Field(default=None, description="between layers; absent: Ds + 3 m")
    middle_m: Coordinate = Field(default=0.0, description="height of the middle of all layers")
    height_m: Coordinate | None = Field(
        default=None, description="the layer itself, of a [vehicle.guidance]; absent: dealt"
    )
    goal_offset_m: NonNegative = Field(
        default=0.0, description="the goal is passed at the layer's height where that is so near to it"
    )
    evading: bool = Field(
        default=False,
        description="turns of more than 90 deg have the evading turn's sense, and after the goal that turn is"
        " flown at a height beyond all layers; a vehicle that comes no nearer to its goal changes its layer",
    )
    climb_mps: Positive | None = Field(
        default=None, description="of the descent to the goal; absent: 0.7 of the climb rate limit"
    )
    height_gain_per_s: Positive = Field(default=0.3, description="on the height")


class Roundabout(_Following):
    """Flies around the centroid of the goals, against the evading turn, and leaves to its goal."""

    kind: Literal["roundabout"]
    speed_mps: Speed = Field(default=20.0, description="ground speed")
    radius_m: Positive | None = Field(
        default=None,
        description="of the ring; absent: from the number of vehicles and room_m, at least what 0.6 of the"
        " turn rate limit flies",
    )
    room_m: Positive = Field(
        default=8.0, description="h between neighbours evenly spread on the ring, which gives its radius"
    )
    centre_m: Annotated[list[Coordinate], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="[x, y]; absent: the centroid of the goals"
    )
    approach_m: Positive | None = Field(
        default=None, description="as of 'waypoints', from the ring outwards and inwards"
    )
    height_gain_per_s: Positive = Field(default=0.3, description="on the height, which is the goal's")


class InstalledGuidance(_Guidance):
    """Guidance that an installed package offers by name."""

    kind: Annotated[str, AfterValidator(installed("guidance"))]


GUIDANCES = Kinds(
    "kind",
    "near-identity",
    {
        "near-identity": NearIdentity,
        "manoeuvre": EvadingManoeuvre,
        "waypoints": Waypoints,
        "loiter": Loiter,
        "hold": Hold,
        "track": RecordedTrack,
        "layers": Layers,
        "roundabout": Roundabout,
    },
    {
        "near-identity": "guidance towards the goal",
        "manoeuvre": "guidance that flies the manoeuvre",
        "waypoints": "guidance along waypoints",
        "loiter": "guidance around a circle",
        "hold": "guidance that holds a course",
        "track": "guidance along a recorded track",
        "layers": "guidance in layers of height",
        "roundabout": "guidance around a ring",
    },
    role="guidance",
    other=InstalledGuidance,
)
Guidance = Annotated[
    Annotated[NearIdentity, Tag("near-identity")]
    | Annotated[EvadingManoeuvre, Tag("manoeuvre")]
    | Annotated[Waypoints, Tag("waypoints")]
    | Annotated[Loiter, Tag("loiter")]
    | Annotated[Hold, Tag("hold")]
    | Annotated[RecordedTrack, Tag("track")]
    | Annotated[Layers, Tag("layers")]
    | Annotated[Roundabout, Tag("roundabout")]
    | Annotated[InstalledGuidance, Tag(INSTALLED)],
    Discriminator(GUIDANCES.tag),
    BeforeValidator(GUIDANCES.settled),
]
