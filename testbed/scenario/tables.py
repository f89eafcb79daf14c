"""The tables of a scenario file, each with its defaults and the checks it can make alone."""

from __future__ import annotations

import math
import re
from typing import Annotated, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator


def _in_degrees(rate: float) -> float:
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
TurnRate = Annotated[float, Field(ge=-360, le=360), AfterValidator(_in_degrees)]


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


def _whole(name: str, period_s: float, unit_name: str, unit_s: float) -> None:
    """ValueError with the nearest remedies unless one period is a whole multiple of the other."""
    ratio = period_s / unit_s
    if abs(ratio - round(ratio)) > 1e-6 or round(ratio) < 1:
        below, above = max(1, math.floor(ratio)), max(1, math.ceil(ratio))
        choices = " or ".join(f"{k * unit_s:g}" for k in sorted({below, above}))
        raise ValueError(
            f"{name} period {period_s:g} s is not a multiple of the {unit_name} period {unit_s:g} s;"
            f" try {choices}"
        )


class Rates(Section):
    """Periods of the flight dynamics, of the filter and of recording; the latter two are multiples."""

    fdm_dt_s: Annotated[float, Field(ge=1e-4, le=1)] = Field(
        default=0.005, description="of flight dynamics and autopilot"
    )
    filter_dt_s: Annotated[float, Field(gt=0, le=10)] = Field(
        default=0.005, description="of the filter: a multiple of fdm_dt_s"
    )
    record_dt_s: Annotated[float, Field(gt=0, le=86400)] = Field(
        default=0.005, description="of the tables: a multiple of filter_dt_s"
    )

    @model_validator(mode="after")
    def divide(self) -> Rates:
        _whole("filter", self.filter_dt_s, "FDM", self.fdm_dt_s)
        _whole("record", self.record_dt_s, "FDM", self.fdm_dt_s)
        _whole("record", self.record_dt_s, "filter", self.filter_dt_s)
        return self

    @property
    def fdm_steps(self) -> int:
        """FDM periods per filter period."""
        return round(self.filter_dt_s / self.fdm_dt_s)

    @property
    def record_steps(self) -> int:
        """Filter periods per recording."""
        return round(self.record_dt_s / self.filter_dt_s)


class InputSet(Section):
    """The input set U: what the filter may command."""

    v_min_mps: Speed = Field(default=15.0, description="least ground speed")
    v_max_mps: Speed = Field(default=25.0, description="largest ground speed")
    omega_max_degps: Annotated[float, Field(ge=0, le=360), AfterValidator(_in_degrees)] = Field(
        default=13.0, description="largest turn rate, to either side"
    )
    zeta_max_mps: Annotated[float, Field(ge=0, le=1000)] = Field(
        default=3.9, description="largest climb and sink rate"
    )

    @model_validator(mode="after")
    def ordered(self) -> InputSet:
        if self.v_min_mps > self.v_max_mps:
            raise ValueError(f"v_min_mps {self.v_min_mps:g} is above v_max_mps {self.v_max_mps:g}")
        return self


class Place(Section):
    """Where one vehicle starts, and its goal."""

    x_m: Coordinate = Field(description="east")
    y_m: Coordinate = Field(description="north")
    course_deg: Annotated[float, Field(ge=-720, le=720)] = Field(description="counter-clockwise from east")
    z_m: Coordinate = Field(default=0.0, description="height above the shared origin")
    goal_x_m: Coordinate = Field(description="east")
    goal_y_m: Coordinate = Field(description="north")
    goal_z_m: Coordinate = Field(default=0.0, description="height")


class Start(Section):
    """Initial poses: on a circle facing its centre with the goal opposite, or listed one by one."""

    pattern: Literal["circle", "list"] = Field(
        default="circle", description="on a circle, or listed in places"
    )
    radius_m: Positive = Field(default=200.0, description="of the circle")
    course_offset_deg: Annotated[float, Field(ge=-180, le=180)] = Field(
        default=0.0, description="added to the course towards the centre, counter-clockwise"
    )
    heights_m: list[Coordinate] = Field(
        default=[0.0], min_length=1, description="one for all, or one per vehicle, repeated in turn"
    )
    places: list[Place] = Field(default=[], description="for pattern = 'list': one per vehicle")
    speed_mps: Speed = Field(
        default=20.0, description="an aircraft's first ground speed; a unicycle has none"
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


class Nominal(Section):
    """The goal-seeking controller that the filter alters."""

    controller: Literal["near-identity", "manoeuvre"] = Field(
        default="near-identity",
        description="near-identity: towards the goal; manoeuvre: the evading manoeuvre for ever",
    )
    lookahead_m: Divisor = Field(
        default=1.0, description="near-identity: the point ahead that is steered, the paper's lambda"
    )
    gain_per_s: Positive = Field(default=0.1, description="near-identity: on position and height")
    delay_steps: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=0, description="filter steps by which u_hat is old; before there is one it is zero"
    )


class Alpha(Section):
    """The extended class-K function alpha(h)."""

    kind: Literal["linear", "cubic", "odd-polynomial"] = Field(
        default="cubic", description="a h, a h^3, or a sum of odd powers"
    )
    coefficient: Positive = Field(default=0.1, description="a, of linear and cubic")
    coefficients: list[NonNegative] = Field(
        default=[], max_length=5, description="of h, h^3, h^5, ... for odd-polynomial"
    )

    @model_validator(mode="after")
    def complete(self) -> Alpha:
        if self.kind == "odd-polynomial" and not any(self.coefficients):
            raise ValueError("coefficients: an odd polynomial needs at least one positive coefficient")
        return self


class Manoeuvre(Section):
    """A constant input: straight, a turn, a climb, or any mixture."""

    v_mps: Speed = Field(description="ground speed")
    omega_degps: TurnRate = Field(default=0.0, description="turn rate, counter-clockwise")
    zeta_mps: ClimbRate = Field(default=0.0, description="climb rate")


class Pair(Section):
    """The turn that one pair evades by, where every pair has a manoeuvre of its own."""

    i: Annotated[int, Field(ge=1)] = Field(description="vehicle")
    j: Annotated[int, Field(ge=2)] = Field(description="vehicle, above i")
    v_mps: Speed = Field(description="ground speed of their turn")
    omega_degps: TurnRate = Field(description="turn rate")


class Barrier(Section):
    """The evading manoeuvre gamma and the barrier function built from it."""

    kind: Literal["turn", "straight", "rollout", "euclidean"] = Field(
        default="turn",
        description="h by a turn, by straight flight, by any constant manoeuvre, or the distance alone",
    )
    form: Literal["root", "squared"] = Field(default="root", description="root: h in m; squared: h in m^2")
    v_mps: Speed = Field(default=16.0, description="ground speed of the manoeuvre")
    omega_degps: TurnRate = Field(default=11.7, description="of the turn")
    sigma: SpeedRatio | Annotated[list[SpeedRatio], Field(min_length=1)] = Field(
        default=1.0, description="turn: speed ratio, one or per vehicle"
    )
    delta_m2: NonNegative = Field(default=0.01, description="turn: the paper's rounding of the kink")
    smoothing_m2: NonNegative = Field(
        default=0.0, description="turn: eps of the smoothed barrier; 0 is the paper's, we recommend 30"
    )
    speed_step: Annotated[float, Field(ge=0, le=10)] = Field(
        default=0.01, description="straight: vehicle i (from 1) evades at v_mps (1 + speed_step i)"
    )
    zeta_mps: ClimbRate | Annotated[list[ClimbRate], Field(min_length=1)] = Field(
        default=0.0, description="straight: climb rate, one or per vehicle"
    )
    manoeuvres: list[Manoeuvre] = Field(default=[], description="rollout: one for all, or one per vehicle")
    shared: bool = Field(
        default=True, description="false lets every pair have its own manoeuvre, which voids Theorem 3"
    )
    pairs: list[Pair] = Field(default=[], description="turn, with shared = false: each pair's manoeuvre")
    gradient: Literal["analytic", "forward"] = Field(
        default="analytic", description="forward: by differences, as in the published runs"
    )
    gradient_step: Annotated[float, Field(gt=0, le=1)] = Field(default=1e-4, description="m and rad")

    @model_validator(mode="after")
    def complete(self) -> Barrier:
        if self.kind == "turn" and self.omega_degps == 0:
            raise ValueError("omega_degps: a turn needs a turn rate other than zero")
        if self.kind == "rollout" and not self.manoeuvres:
            raise ValueError("manoeuvres: a rollout needs at least one manoeuvre")
        if self.pairs and self.shared:
            raise ValueError(
                "pairs: a manoeuvre for each pair breaks the shared-manoeuvre assumption"
                " (Assumption 1 of the paper); say shared = false to study just that"
            )
        if not self.shared and not self.pairs:
            raise ValueError("pairs: shared = false needs each pair's manoeuvre listed")
        return self


class Filter(Section):
    """What stands between the nominal controller and the vehicles."""

    kind: Literal["centralised", "limited", "navigation", "none"] = Field(
        default="centralised", description="one QP for all, one per vehicle, the navigation function, or none"
    )
    solver: Literal["auto", "osqp"] = Field(
        default="auto", description="of the QPs: auto is the fastest one measured; every answer is checked"
    )
    monitor: bool = Field(default=False, description="check Theorems 3 and 4 at every step, and compare QPs")


class Checks(Section):
    """Checks that cost more than watching the run."""

    manoeuvre_instants: Annotated[int, Field(ge=0, le=1000)] = Field(
        default=6,
        description="instants from which vehicles really fly gamma, most where pairs drew near; 0 is none",
    )


class Navigation(Section):
    """The navigation-function baseline, with the parameters its authors' comparison used."""

    speed_mps: Positive = Field(default=20.0, description="constant ground speed")
    heading_gain_per_s: Positive = Field(default=0.6, description="turn rate per heading error")
    path_radius_m: Positive = Field(default=20.0, description="r_p: closer to the goal the path fades")
    path_gain: NonNegative = Field(default=20.0, description="K_p: pull towards the line from start to goal")
    potential_exponent: Positive = Field(default=0.2, description="k of the navigation function")
    swirl: NonNegative = Field(default=0.08, description="K_s: share of the gradient across lines of sight")
    vehicle_radius_m: NonNegative = Field(default=0.0, description="rho_j: contact with a vehicle")
    vehicle_margin_m: Positive = Field(default=5.0, description="delta_j: a vehicle repels from there on")
    disc_radius_m: Positive = Field(default=2000.0, description="rho_c: disc about the origin to stay in")
    disc_margin_m: Positive = Field(default=5.0, description="delta_c: its edge repels from there on")
    sensing_range_m: Positive = Field(default=400.0, description="vehicles farther away are not seen")
    difference_step_m: Positive = Field(default=1.0, description="of the gradient's central differences")
